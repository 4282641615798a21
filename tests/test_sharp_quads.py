"""Sharp edges on grid lines: exactly, all along, and quads' edges along them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shapes
from grid_maps import L_SHAPE, polycube
from scipy.sparse import csr_matrix
from test_integer_grid import check_laws

from coneflat import errors, flatten, integer_grid, quads
from coneflat.grid.bisect import edge_indices, split_for_features
from coneflat.grid.extract import extract_quads
from coneflat.grid.features import feature_chains, opened, sharp_edges, without_stubs
from coneflat.grid.quality import measure_quads
from coneflat.layout.relax import Lines, PointConstraints, relax
from coneflat.layout.relax.elimination import orthogonal_solutions, sparse_solutions
from coneflat.mesh import TriangleMesh

MODELS = Path(__file__).resolve().parents[2] / "shared" / "meshes"
SHARP = np.deg2rad(40)


def prism(corners: int):
    """A prism over a regular polygon, with caps of one triangle per side."""
    return shapes.cylinder(corners, 3, 1.5, caps=True)


def l_block(size: int = 2):
    """Three unit cubes in the form of an L, their square faces split alike."""
    vertices, squares = polycube(L_SHAPE)
    a, b, c, d = squares.T
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    for _ in range(size):
        vertices, faces = shapes.subdivide(vertices, faces)
    return vertices, faces


def open_box():
    vertices, faces = shapes.box(4, (1.0, 1.0, 1.0))
    faces = faces[vertices[faces].mean(axis=1)[:, 2] < 1 - 1e-9]
    used, number = np.unique(faces, return_inverse=True)
    return vertices[used], number.reshape(faces.shape)


SHAPES = {
    "cube": shapes.box(1, (1.0, 1.0, 1.0)),
    "box": shapes.box(3),
    "L": l_block(),
    "cylinder": shapes.cylinder(caps=True),
    "hexagon": prism(6),
    "open box": open_box(),
    "two": shapes.join(shapes.box(2), (shapes.cylinder(caps=True)[0] + 5, shapes.cylinder(caps=True)[1])),
}


def check_features(grid):
    """Both ends of each sharp edge have the same whole coordinate, to the bit, in every triangle beside it."""
    mesh = TriangleMesh(grid.vertices, grid.faces)
    edges = edge_indices(mesh, grid.features)
    assert (mesh.edges[edges] == np.sort(grid.features, axis=1)).all()
    sides = mesh.edge_halfedges[edges]
    sides = sides[sides >= 0]
    start = grid.corner_grid[:, [1, 2, 0]].reshape(-1, 2)[sides]
    end = grid.corner_grid[:, [2, 0, 1]].reshape(-1, 2)[sides]
    assert ((start == end) & (start == np.rint(start))).any(axis=1).all()
    nodes = vertices_that_turn(mesh, edges)
    at = grid.corner_grid[np.isin(grid.faces, nodes)]
    assert (at == np.rint(at)).all()


def vertices_that_turn(mesh, edges):
    """Vertices at which other than two sharp edges meet."""
    degree = np.bincount(mesh.edges[edges].ravel(), minlength=len(mesh.vertices))
    return np.flatnonzero((degree != 2) & (degree > 0))


@pytest.mark.parametrize("count", [300, 2000])
@pytest.mark.parametrize("name", SHAPES)
def test_laws(name, count):
    grid = integer_grid(*SHAPES[name], quads=count, sharp_angle=SHARP)
    assert grid.notes == ()
    check_laws(grid)
    check_features(grid)
    mesh = TriangleMesh(grid.vertices, grid.faces)
    sharp = sharp_edges(mesh, SHARP)
    assert set(sharp.tolist()) == set(edge_indices(mesh, grid.features).tolist())
    found = extract_quads(grid)
    assert found.left_out == 0
    assert found.euler_characteristic == found.surface_euler
    assert abs(found.area_left_out) < 1e-3


@pytest.mark.parametrize("count", [100, 1000])
def test_cube_is_of_squares(count):
    found = quads(*SHAPES["cube"], quads=count, sharp_angle=SHARP)
    assert found.valences[found.irregular].tolist() == [3] * 8
    measures = measure_quads(found)
    assert measures.angle_max < 1e-6
    assert measures.edge_cv < 1e-6
    assert measures.hausdorff < 1e-9
    corners = found.vertices[found.irregular]
    assert sorted(map(tuple, np.round(corners, 9).tolist())) == [
        (x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)
    ]


def test_edges_of_quads_cover_the_edges_of_a_box():
    vertices, faces = SHAPES["box"]
    found = quads(vertices, faces, quads=1500, sharp_angle=SHARP)
    ends = found.vertices[found.edges]
    at_end = (np.abs(ends - vertices.min(axis=0)) < 1e-9) | (np.abs(ends - vertices.max(axis=0)) < 1e-9)
    along = (at_end.all(axis=1).sum(axis=1)) >= 2
    length = np.linalg.norm(np.diff(ends[along], axis=1)[:, 0], axis=1).sum()
    assert length == pytest.approx(4 * np.ptp(vertices, axis=0).sum(), rel=1e-9)


def test_irregular_vertices_by_patch():
    """A disk without corners has quarter turns for four cones of three quads; six corners leave -2 (Gauss-Bonnet)."""
    round_one = quads(*SHAPES["cylinder"], quads=1000, sharp_angle=SHARP)
    assert (4 - round_one.valences[round_one.irregular]).sum() == 8
    height = round_one.vertices[:, 2]
    for level in (height.min(), height.max()):
        on_cap = round_one.irregular[np.abs(height[round_one.irregular] - level) < 1e-9]
        assert (4 - round_one.valences[on_cap]).sum() == 4
    six = quads(*SHAPES["hexagon"], quads=1000, sharp_angle=SHARP)
    place = six.vertices[six.irregular]
    cap = np.abs(place[:, 2] - place[:, 2].min()) < 1e-9
    at_corner = np.abs(np.hypot(place[:, 0], place[:, 1]) - 1) < 1e-6
    assert (4 - six.valences[six.irregular[cap & at_corner]]).sum() == 6
    assert (4 - six.valences[six.irregular[cap & ~at_corner]]).sum() == -2


def test_open_boundary_is_on_grid_lines():
    found = quads(*SHAPES["open box"], quads=500, sharp_angle=SHARP)
    border = found.vertices[found.edges[found.is_boundary_edge]]
    assert np.linalg.norm(np.diff(border, axis=1)[:, 0], axis=1).sum() == pytest.approx(4.0, rel=1e-9)
    assert measure_quads(found).angle_max < 1e-6


def test_scaled_and_moved_alike():
    vertices, faces = SHAPES["L"]
    one = quads(vertices, faces, quads=600, sharp_angle=SHARP)
    other = quads(1000 * vertices @ shapes.rotation() + 7, faces, quads=600, sharp_angle=SHARP)
    assert len(one.quads) == len(other.quads)
    assert sorted(one.valences.tolist()) == sorted(other.valences.tolist())


def test_surface_without_sharp_edges():
    grid = integer_grid(*shapes.sphere(3), quads=500, sharp_angle=SHARP)
    assert len(grid.features) == 0
    assert any("sharp edge" in note for note in grid.notes)
    check_laws(grid)


@pytest.mark.parametrize("count", [1000, 5000])
def test_fandisk(count):
    path = MODELS / "fandisk.obj"
    if not path.exists():
        pytest.skip("no model")
    grid = integer_grid(path, quads=count, sharp_angle=SHARP)
    assert grid.notes == ()
    check_laws(grid)
    check_features(grid)
    found = extract_quads(grid)
    assert found.euler_characteristic == 2


@pytest.mark.parametrize("angle", [0.0, -1.0, 4.0, np.nan])
def test_impossible_angles(angle):
    with pytest.raises(errors.OptionError, match=r"angle|number"):
        integer_grid(*SHAPES["cube"], quads=100, sharp_angle=angle)


def test_options_that_do_not_go_with_it():
    with pytest.raises(errors.OptionError, match="cone_count"):
        integer_grid(*SHAPES["cube"], quads=100, sharp_angle=SHARP, cone_count=8)
    with pytest.raises(errors.OptionError, match="straight boundary"):
        integer_grid(*SHAPES["open box"], quads=100, sharp_angle=SHARP, boundary="disk")
    flat = flatten(*shapes.sphere(2), quantise=np.pi / 2, charts="one")
    with pytest.raises(errors.OptionError, match="beside it"):
        integer_grid(flat, quads=100, sharp_angle=SHARP)


def test_split_keeps_surface_and_features():
    vertices, faces = SHAPES["hexagon"]
    mesh = TriangleMesh(vertices, faces)
    sharp = sharp_edges(mesh, SHARP)
    finer, edges, origin = split_for_features(vertices, faces, mesh.edges[sharp], 0.3)
    area, length = (
        (lambda m: shapes.lengths_of(m)),
        (lambda m, e: np.diff(m.vertices[m.edges[e]], axis=1)[:, 0]),
    )
    assert finer.euler_characteristic == mesh.euler_characteristic
    assert (finer.vertices[: len(vertices)] == vertices).all()
    parts = np.bincount(origin, np.linalg.norm(length(finer, edges), axis=1))
    assert parts == pytest.approx(np.linalg.norm(length(mesh, sharp), axis=1))
    assert area(finer).max() <= 0.3
    on = np.zeros(len(finer.vertices), dtype=bool)
    on[finer.edges[edges]] = True
    joins = np.flatnonzero(on[finer.edges].all(axis=1))
    assert set(joins.tolist()) == set(edges.tolist())
    assert (
        np.abs(np.cross(*np.moveaxis(np.diff(finer.vertices[finer.faces], axis=1), 1, 0))).sum(axis=1) > 0
    ).all()


def test_stubs_are_dropped():
    """On a box, edges of one loop with a stub of one edge: the stub goes, the loop stays."""
    mesh = TriangleMesh(*shapes.box(3))
    sharp = sharp_edges(mesh, SHARP)
    z = mesh.vertices[mesh.edges[sharp]][..., 2]
    loop = sharp[(z == z.min()).all(axis=1)]
    stub = sharp[(z.min(axis=1) == z.min()) & (z.max(axis=1) > z.min())][:1]
    both = np.concatenate([loop, stub])
    assert without_stubs(mesh, both, 0.0).tolist() == list(range(len(loop)))
    chain, _ = feature_chains(mesh, loop)
    assert chain.max() == 0


def test_angles_of_patches_sum_to_quarter_turns():
    mesh = TriangleMesh(*SHAPES["L"])
    opening = opened(mesh, sharp_edges(mesh, SHARP), shapes.lengths_of(mesh))
    total = np.bincount(opening.cut.origin, opening.quarters)
    convex, reflex = (total == 3).sum(), (total == 5).sum()
    # Twelve corners of an L: ten where one square fewer meets, two where one more does; 4 chi = 8 in all.
    assert (convex, reflex) == (10, 2)
    assert opening.cut.mesh.components[0] == 8


def two_halves(factor, turn):
    """A square cut in two halves: mesh, points, corners, and the points on either side of the cut, in order."""
    vertices, faces = shapes.grid(4, 4)
    mesh = TriangleMesh(vertices, faces)
    is_right = vertices[faces].mean(axis=1)[:, 0] > 0.5
    used, corners = np.unique(np.where(is_right[:, None], faces + len(vertices), faces), return_inverse=True)
    z = vertices[:, 0] + 1j * vertices[:, 1]
    z = np.concatenate([z, factor * np.exp(1j * turn) * z + 3])[used]
    seam = np.flatnonzero(np.abs(vertices[:, 0] - 0.5) < 1e-9)
    sides = np.searchsorted(used, seam), np.searchsorted(used, seam + len(vertices))
    return mesh, np.stack([z.real, z.imag], axis=1), corners.reshape(faces.shape), sides


@pytest.mark.parametrize("quarter", range(4))
def test_sides_become_quarter_turns_of_each_other(quarter):
    mesh, points, corners, (left, right) = two_halves(1.3, quarter * np.pi / 2 + 0.2)
    found = relax(mesh, points, corners, constraints=PointConstraints(quarter_turns=True)).points @ [1, 1j]
    off = found[right] - [1, 1j, -1, -1j][quarter] * found[left]
    assert np.abs(off - off[0]).max() < 1e-9


def test_points_within_seams_stay_on_lines():
    mesh, points, corners, sides = two_halves(1.1, 0.0)
    left, right = sides
    for side in sides:
        lines = Lines(side, np.zeros(len(side), dtype=int), [[0.0, 1.0]], [-0.75])
        held = PointConstraints(lines=lines, quarter_turns=True)
        found = relax(mesh, points, corners, constraints=held).points
        assert found[side, 0] == pytest.approx(0.75, abs=1e-9)
        assert np.ptp(found[right] - found[left], axis=0) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("solutions", [sparse_solutions, orthogonal_solutions])
@pytest.mark.parametrize("seed", range(5))
def test_elimination_spans_all_solutions(seed, solutions):
    rng = np.random.default_rng(seed)
    rows = rng.integers(-1, 2, (12, 30)) * (rng.random((12, 30)) < 0.2)
    rows = np.concatenate([rows, rows[:3] - rows[3:6]]).astype(float)
    right = rows @ rng.normal(size=30)
    found, left = solutions(csr_matrix(rows), right)
    basis = found.toarray()
    assert np.abs(left).max(initial=0.0) < 1e-9
    assert rows @ basis[:, -1] == pytest.approx(right, abs=1e-9)
    assert np.abs(rows @ basis[:, :-1]).max() < 1e-9
    assert np.linalg.matrix_rank(basis[:, :-1]) == 30 - np.linalg.matrix_rank(rows) == basis.shape[1] - 1
    right[-1] += 1
    missed = solutions(csr_matrix(rows), right)[1]
    if solutions is sparse_solutions:
        assert np.abs(missed).max() == pytest.approx(1)
    else:  # turned: as long as what least squares leave
        nearest = rows @ np.linalg.lstsq(rows, right)[0]
        assert np.linalg.norm(missed) == pytest.approx(np.linalg.norm(right - nearest))
