"""Integer grids: integer transitions, cones on grid points, no triangle flipped, any topology."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapes
from scipy.spatial import Delaunay

import coneflat
from coneflat import errors, flatten, integer_grid
from coneflat.geometry import edge_lengths
from coneflat.mesh.connectivity import TriangleMesh
from coneflat.quadmesh import policies
from coneflat.quadmesh.alignment import aligned
from coneflat.quadmesh.grid_layout import with_sides
from coneflat.quadmesh.no_grid import NoGrid
from coneflat.quadmesh.request import GridRequest
from coneflat.quadmesh.rounding import find_rounding
from coneflat.quadmesh.splitting import split_between_nodes
from coneflat.quadmesh.transitions import find_transitions

TURNS = np.array([1, 1j, -1, -1j])
QUARTER = {"quantise": np.pi / 2, "charts": "one", "min_cone_angle": 1.5 * np.pi, "max_cone_angle": 3 * np.pi}


def pair(*parts):
    """Several meshes as one of several components."""
    ends = np.cumsum([0] + [len(v) for v, _ in parts])
    faces = np.concatenate([f + end for (_, f), end in zip(parts, ends, strict=False)])
    return np.concatenate([v + 3 * i for i, (v, _) in enumerate(parts)]), faces


SHAPES = {
    "sphere": shapes.sphere(3),
    "torus": shapes.torus(),
    "hill": shapes.hill(),
    "two": pair(shapes.sphere(3), shapes.torus()),
}


def spiked(every, height):
    """A sphere from which some of the vertices are pulled out."""
    vertices, faces = shapes.sphere(2)
    return vertices * (1 + height * (np.arange(len(vertices)) % every == 0))[:, None], faces


def complex_corners(grid):
    return grid.corner_grid[..., 0] + 1j * grid.corner_grid[..., 1]


def double_areas(grid):
    z = complex_corners(grid)
    return (np.conj(z[:, 1] - z[:, 0]) * (z[:, 2] - z[:, 0])).imag


def angle_sums(grid):
    z = complex_corners(grid)
    sides = z[:, [2, 0, 1]] - z[:, [1, 2, 0]]
    angles = np.angle(-sides[:, [1, 2, 0]] * np.conj(sides[:, [2, 0, 1]]))
    return np.bincount(grid.faces.ravel(), angles.ravel(), len(grid.vertices))


def check_laws(grid):
    """All that an integer grid promises."""
    mesh = TriangleMesh(grid.vertices, grid.faces)
    z = complex_corners(grid)
    starts, ends = z[:, [1, 2, 0]].ravel(), z[:, [2, 0, 1]].ravel()
    inner = mesh.edge_halfedges[~mesh.is_boundary_edge]
    shift = grid.shifts @ [1, 1j]
    for h, t in (inner.T, inner[:, ::-1].T):
        across = TURNS[grid.turns[h]]
        # Not near but equal: coordinates are rounded so that sums with integers are exact.
        assert (across * ends[t] + shift[h] == starts[h]).all()
        assert (across * starts[t] + shift[h] == ends[h]).all()
    border = mesh.edge_halfedges[mesh.is_boundary_edge, 0]
    assert (grid.turns[border] == -1).all()
    assert not grid.shifts[border].any()
    assert grid.turns.dtype == grid.shifts.dtype == np.int64
    at = grid.corner_grid[np.isin(grid.faces, grid.cones)]
    assert (at == np.rint(at)).all()
    assert double_areas(grid).min() > 0
    inside = ~mesh.is_boundary_vertex & np.isin(np.arange(len(mesh.vertices)), mesh.faces)
    quarters = np.full(len(mesh.vertices), 4)
    quarters[grid.cones] = grid.quarters
    assert (grid.quarters != 4).all()
    assert angle_sums(grid)[inside] == pytest.approx(np.pi / 2 * quarters[inside], abs=1e-6)


@pytest.mark.parametrize("quads", [40, 1000])
@pytest.mark.parametrize("name", ["sphere", "torus", "hill", pytest.param("two", marks=pytest.mark.slow)])
def test_laws_on_shapes(name, quads):
    grid = integer_grid(*SHAPES[name], quads=quads)
    check_laws(grid)
    assert np.isin(grid.quarters, [3, 5, 6]).all()


def test_the_coarsest_grid_of_a_box_is_a_cube():
    """Eight cones of three quads, and no other vertex: six quads."""
    grid = integer_grid(*shapes.box(4, (1.0, 1.1, 1.2)), quads=1)
    check_laws(grid)
    assert double_areas(grid).sum() / 2 == pytest.approx(6, abs=1e-9)
    assert grid.quarters.tolist() == [3] * 8
    assert "6 squares, not 1" in " ".join(grid.notes)


def test_a_flattening_is_accepted():
    shape = shapes.sphere(3)
    grid = integer_grid(flatten(*shape, **QUARTER), quads=200)
    assert (grid.corner_grid == integer_grid(*shape, quads=200, cones="sparse").corner_grid).all()


def check_sides(grid):
    """Boundary edges lie on grid lines, corners on grid points; an integer of squares is covered."""
    mesh = TriangleMesh(grid.vertices, grid.faces)
    border = mesh.edge_halfedges[mesh.is_boundary_edge, 0]
    starts = grid.corner_grid[:, [1, 2, 0]].reshape(-1, 2)[border]
    ends = grid.corner_grid[:, [2, 0, 1]].reshape(-1, 2)[border]
    assert ((starts == ends) & (starts == np.rint(starts))).any(axis=1).all()
    at = grid.corner_grid[np.isin(grid.faces, grid.corners)]
    assert (at == np.rint(at)).all()
    on = np.flatnonzero(mesh.is_boundary_vertex)
    quarters = np.full(len(mesh.vertices), 2)
    quarters[grid.corners] = grid.corner_quarters
    assert (grid.corner_quarters != 2).all()
    assert angle_sums(grid)[on] == pytest.approx(np.pi / 2 * quarters[on], abs=1e-6)
    assert (4 - grid.quarters).sum() + (2 - grid.corner_quarters).sum() == 4 * mesh.euler_characteristic
    area = double_areas(grid).sum() / 2
    assert area == pytest.approx(round(area), abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("quads", [20, 100, 1000])
@pytest.mark.parametrize("shape", [shapes.hill(), shapes.annulus()], ids=["hill", "annulus"])
def test_straight_sides_lie_on_grid_lines(shape, quads):
    grid = integer_grid(*shape, quads=quads, boundary="straight")
    check_laws(grid)
    check_sides(grid)


def askew():
    """A bumpy sheet with two square holes, neither of which is parallel to it or to the other."""
    vertices, faces = shapes.hill(30, 24)
    places = vertices[faces].mean(axis=1)[:, :2] @ [1, 1j] / np.ptp(vertices[:, 0])
    is_inside = np.ones(len(faces), dtype=bool)
    for centre, half, angle in ((0.3 + 0.3j, 0.1, 0.5), (0.7 + 0.4j, 0.09, 0.2)):
        turned = (places - centre) * np.exp(-1j * angle)
        is_inside &= np.maximum(np.abs(turned.real), np.abs(turned.imag)) > half
    vertices_of_faces, faces = np.unique(faces[is_inside], return_inverse=True)
    return vertices[vertices_of_faces], faces.reshape(-1, 3)


@pytest.mark.slow
@pytest.mark.parametrize("quads", [300, 2000])
def test_loops_that_are_askew_come_to_lie_on_grid_lines(quads):
    grid = integer_grid(*askew(), quads=quads, repair=True)
    check_laws(grid)
    check_sides(grid)
    assert TriangleMesh(grid.vertices, grid.faces).euler_characteristic == -1


def test_a_flat_rectangle_keeps_its_shape():
    """Three by two, asked for 24 squares: six by four, each of half a unit."""
    vertices, faces = shapes.grid(9, 6)
    grid = integer_grid(vertices * [3, 2, 0], faces, quads=24, boundary="straight")
    check_laws(grid)
    check_sides(grid)
    assert len(grid.corners) == 4
    assert grid.corner_quarters.tolist() == [1] * 4
    assert sorted(np.ptp(grid.corner_grid.reshape(-1, 2), axis=0)) == [4, 6]
    first, second, third = grid.vertices[grid.faces].transpose(1, 0, 2)
    expected = np.linalg.norm(np.cross(second - first, third - first), axis=1)
    assert (double_areas(grid) * grid.size**2 / expected).min() == pytest.approx(1)


@pytest.mark.slow
def test_a_grid_that_is_too_coarse_is_made_finer():
    """A sphere with spikes and more than forty cones, in six squares."""
    result = flatten(*spiked(7, 0.8), quantise=np.pi / 2, charts="one", correct_handles=True)
    assert len(result.cones) > 40
    grid = integer_grid(result, quads=6)
    check_laws(grid)
    assert any("squares, not 6." in note for note in grid.notes)


def test_a_note_says_what_cones_are_not_chosen_for(monkeypatch):
    reason = NoGrid(errors.GridError("no place for them"))
    monkeypatch.setattr(policies, "aligned_map", lambda *_: reason)
    note = "Cones are not chosen for the boundary, sharp edges or curvature, because no grid with such cones was found"
    assert f"{note}: no place for them." in integer_grid(*shapes.sphere(3), quads=300).notes


def test_numbering_changes_nothing():
    vertices, faces = shapes.sphere(3)
    shuffled, turned, number = shapes.renumber(vertices, faces)
    grid, shuffled_grid = (
        integer_grid(*shape, quads=300) for shape in ((vertices, faces), (shuffled, turned))
    )
    assert sorted(number[grid.cones]) == sorted(shuffled_grid.cones)
    assert np.sort(double_areas(grid)) == pytest.approx(np.sort(double_areas(shuffled_grid)), rel=1e-6)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"quads": 10, "size": 1.0}, "must not be given together"),
        ({"quads": 0}, "quads must be an integer, 1 or more, got 0"),
        ({"size": -1.0}, "size must be a number above 0, .*got -1"),
        ({"stretch": -1.0}, "stretch must be"),
        ({"boundary": "foo"}, "unknown boundary 'foo'"),
        ({"boundary": {"a": 1}}, "a corner's vertex must be a number"),
        ({"min_cone_angle": -1.0}, "the smallest cone angle must be positive"),
        ({"max_cone_angle": 1.0}, "must exceed the smallest"),
        ({"cones": "foo"}, "unknown cones 'foo'"),
        ({"threads": 0}, "threads must be an integer"),
        ({"progress": 1}, "progress must be a function"),
    ],
)
def test_invalid_options_are_refused_before_the_mesh_is_read(options, message):
    for find in (integer_grid, coneflat.quads):
        with pytest.raises(errors.OptionError, match=message):
            find("missing.obj", **options)


def test_cones_that_are_no_quarter_turns_are_refused():
    free = flatten(*shapes.sphere(3), charts="one")
    with pytest.raises(errors.GridError, match="from quarter turns"):
        integer_grid(free)
    with pytest.raises(errors.OptionError, match="faces and options"):
        integer_grid(free, charts="one")


@pytest.mark.parametrize(
    ("every", "height"),
    [(7, 1.5), *(pytest.param(*spikes, marks=pytest.mark.slow) for spikes in ((9, 1.5), (13, 0.8)))],
)
def test_charts_stay_joined_where_edges_between_them_are_split(every, height):
    """The first chain between two charts is another one then."""
    options = {**QUARTER, "charts": "atlas", "correct_handles": True, "distortion": 0.1}
    result = flatten(*spiked(every, height), **options)
    layout = aligned(result, GridRequest.of(result, None, {"quads": 1000}, {}).size)
    split = split_between_nodes(layout)
    assert result.distortion.charts > 1
    assert len(split.mesh.faces) > len(layout.mesh.faces)
    transitions = find_transitions(split)
    np.testing.assert_allclose(transitions.equations @ transitions.values, 0, atol=1e-9)


def test_the_number_of_squares_is_that_in_given_side_lengths():
    vertices, faces = shapes.grid(8, 8)
    options = {"lengths": 3 * edge_lengths(vertices, faces), "boundary": "straight"}
    grid = integer_grid(vertices, faces, quads=64, **options)
    assert grid.squares == pytest.approx(64)
    flat = flatten(vertices, faces, charts="one", min_cone_angle=np.pi / 2, quantise=np.pi / 2, **options)
    assert integer_grid(flat, quads=64).squares == pytest.approx(64)
    assert integer_grid(flat, size=grid.size).squares == pytest.approx(64)


@pytest.mark.parametrize(
    ("scale", "size"), [(1e100, 1e-60), (1e-150, 1e60), (1e-250, 1e-60), (1e-250, 1e60), (1, 1e300)]
)
def test_sizes_far_from_that_of_the_mesh_are_refused(scale, size):
    vertices, faces = shapes.grid(8, 8)
    with pytest.raises(errors.GridError):
        integer_grid(scale * vertices, faces, size=size)


def test_given_side_lengths_are_those_of_the_grid():
    vertices, faces = shapes.sphere(2)
    plain = integer_grid(vertices, faces, quads=60, cones="sparse")
    grid_of_lengths = integer_grid(vertices, faces, quads=60, lengths=edge_lengths(vertices, faces))
    assert np.array_equal(grid_of_lengths.faces, plain.faces)
    assert grid_of_lengths.corner_grid == pytest.approx(plain.corner_grid, abs=1e-9)


def layout_of_rectangle(inside, cones):
    """Return the layout of a rectangle of 10 by 2 with straight sides; cones are vertices without curvature.

    Its long sides are single edges.
    """
    border = [[0, 0], [10, 0], [10, 2], [0, 2]]
    points = np.array([*border, *inside])
    points = np.column_stack([points, np.zeros(len(points))])
    triangles = Delaunay(points[:, :2]).simplices
    corners = dict.fromkeys(range(4), np.pi / 2)
    options = {"boundary": "straight", "charts": "one", "cones": corners, "repair": True}
    layout = with_sides(aligned(flatten(points, triangles, **options), 1.0))
    return replace(layout, cones=np.array(cones))


def test_a_cone_stays_apart_from_a_side_whose_vertices_are_far():
    """The vertices of the side are more than ten times as far from the cone as the side is."""
    layout = split_between_nodes(layout_of_rectangle([[2.5, 0.2], [3.7, 0.12], [5, 1]], [4]))
    before = np.abs(find_rounding(layout).pairs.before)
    assert np.isclose(before, [0, 0.2], atol=1e-6).all(axis=1).sum() == 1


def test_edges_between_cones_and_lines_are_split():
    """A triangle of two cones and a vertex where two lines meet degenerates if the three are on one line."""
    layout = layout_of_rectangle([[4, 1], [6, 1], [5, 1.6]], [4, 5])
    ends = layout.mesh.edges
    lines = np.flatnonzero((ends == [2, 6]).all(axis=1) | (ends == [3, 6]).all(axis=1))
    mesh = split_between_nodes(layout, lines).mesh
    assert len(lines) == 2
    assert not np.isin(mesh.edges, [4, 5, 6]).all(axis=1).any()
    assert np.isin(split_between_nodes(layout).mesh.edges, [4, 5, 6]).all(axis=1).any()


def test_components_without_area_are_refused_by_name():
    line = np.array([[0, 0, 0], [1, 2, 0], [0, 0, 0], [2, -1, 0.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [2, 1, 0], [3, 2, 0]])
    with pytest.raises(errors.GridError, match="4 components: they have no area"):
        integer_grid(np.concatenate([line, line]), np.concatenate([faces, faces + 4]), quads=50, repair=True)
