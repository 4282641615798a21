"""Integer grids: transitions that are whole, cones on grid points, no triangle turned over, any topology."""

from __future__ import annotations

import importlib

import numpy as np
import pytest
import shapes

from coneflat import errors, flatten, integer_grid, sample_path
from coneflat import quads as find_quads
from coneflat.mesh import TriangleMesh

# The function of its name is what the package has under it.
integer_grid_module = importlib.import_module("coneflat.grid.integer_grid")
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
        # Not near but equal: coordinates are rounded so that sums with whole numbers are exact.
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
@pytest.mark.parametrize("name", SHAPES)
def test_laws_on_shapes(name, quads):
    grid = integer_grid(*SHAPES[name], quads=quads)
    check_laws(grid)
    assert np.isin(grid.quarters, [3, 5, 6]).all()


@pytest.mark.parametrize("quads", [100, 1000, 20_000])
def test_laws_on_the_sample(quads):
    grid = integer_grid(sample_path(), quads=quads)
    check_laws(grid)
    # Quads of a closed surface are counted: as many as squares.
    area = double_areas(grid).sum() / 2
    assert area == pytest.approx(round(area), abs=1e-6)
    assert area == pytest.approx(quads, rel=0.25)


@pytest.mark.parametrize("quads", [1000, 5000, 20_000])
@pytest.mark.parametrize(
    "name", ["hand.obj", "bunny.obj", "fandisk.obj", "rocker-arm.obj", "3holes.off", "spot.obj"]
)
def test_laws_on_models(shared, name, quads):
    grid = integer_grid(shared(name), quads=quads)
    check_laws(grid)
    assert double_areas(grid).sum() / 2 == pytest.approx(quads, rel=0.05)
    assert grid.qc_mean < 1.15
    assert grid.move_max < 2


def test_cones_closer_than_a_square_do_not_fall_together(shared):
    """Bunny with a hundred squares: the nearest whole places put cones on one another."""
    grid = integer_grid(shared("bunny.obj"), quads=100)
    check_laws(grid)
    assert double_areas(grid).sum() / 2 == pytest.approx(100, rel=0.25)


def test_the_coarsest_grid_of_a_box_is_a_cube():
    """Eight cones of three quads, and no other vertex: six quads."""
    grid = integer_grid(*shapes.box(4, (1.0, 1.1, 1.2)), quads=1)
    check_laws(grid)
    assert double_areas(grid).sum() / 2 == pytest.approx(6, abs=1e-9)
    assert grid.quarters.tolist() == [3] * 8
    assert "6 squares, not 1" in " ".join(grid.notes)


def test_cones_obey_gauss_bonnet():
    for name, chi in (("sphere", 2), ("torus", 0)):
        grid = integer_grid(*SHAPES[name], quads=300)
        assert (4 - grid.quarters).sum() == 4 * chi


def test_rigid_motions_and_scales_change_nothing_but_the_size():
    vertices, faces = shapes.sphere(3)
    turn, _ = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))
    turn *= np.linalg.det(turn)
    one = integer_grid(vertices, faces, quads=300)
    two = integer_grid(7.5 * vertices @ turn + [1, 2, 3], faces, quads=300)
    assert two.size == pytest.approx(7.5 * one.size)
    assert (one.cones == two.cones).all()
    for sums in (double_areas, angle_sums):
        assert sums(one) == pytest.approx(sums(two), rel=1e-4, abs=1e-6)


def test_a_size_is_as_good_as_a_number():
    shape = shapes.torus()
    by_number = integer_grid(*shape, quads=500)
    by_size = integer_grid(*shape, size=by_number.size)
    assert (by_size.shifts == by_number.shifts).all()
    assert by_size.corner_grid == pytest.approx(by_number.corner_grid, abs=1e-9)


def test_a_result_will_do():
    shape = shapes.sphere(3)
    one = integer_grid(flatten(*shape, **QUARTER), quads=200)
    assert (one.corner_grid == integer_grid(*shape, quads=200).corner_grid).all()


def test_a_result_of_several_charts_is_joined(shared):
    atlas = flatten(shared("spot.obj"), **{**QUARTER, "charts": "atlas"})
    assert atlas.distortion.charts > 1
    several = integer_grid(atlas, quads=2000)
    check_laws(several)
    one = integer_grid(flatten(shared("spot.obj"), **QUARTER), quads=2000)
    assert (one.cones == several.cones).all()
    assert double_areas(several).sum() == pytest.approx(double_areas(one).sum(), rel=0.05)


def test_stretch_keeps_areas():
    shape = shapes.torus()
    spread = []
    for stretch in (0.0, 1.0):
        grid = integer_grid(*shape, quads=1000, stretch=stretch)
        check_laws(grid)
        space = np.cross(*(grid.vertices[grid.faces[:, i]] - grid.vertices[grid.faces[:, 0]] for i in (1, 2)))
        scale = np.log(double_areas(grid) / np.linalg.norm(space, axis=1))
        spread.append(scale.std())
    assert spread[1] < 0.8 * spread[0]


def annulus(around=40, across=12):
    """A bumpy cylinder, wider above than below."""
    points, faces = shapes.grid(around, across, wrap=(True, False))
    s, t = 2 * np.pi * points[:, 0], points[:, 1]
    r = 1 + 0.3 * t + 0.2 * t * np.sin(2 * s + 1)
    return np.stack([r * np.cos(s), r * np.sin(s), 2 * t], axis=1), faces


def check_sides(grid):
    """Boundary edges lie on grid lines, corners on grid points; a whole number of squares is covered."""
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


@pytest.mark.parametrize("quads", [20, 100, 1000])
@pytest.mark.parametrize("shape", [shapes.hill(), annulus()], ids=["hill", "annulus"])
def test_straight_sides_lie_on_grid_lines(shape, quads):
    grid = integer_grid(*shape, quads=quads, boundary="straight")
    check_laws(grid)
    check_sides(grid)


@pytest.mark.parametrize("quads", [500, 5000])
def test_straight_sides_of_a_face(shared, quads):
    grid = integer_grid(shared("face.obj"), quads=quads, boundary="straight")
    check_laws(grid)
    check_sides(grid)


def askew():
    """A bumpy sheet with two square holes, neither of which is parallel to it or to the other."""
    vertices, faces = shapes.hill(30, 24)
    places = vertices[faces].mean(axis=1)[:, :2] @ [1, 1j] / np.ptp(vertices[:, 0])
    kept = np.ones(len(faces), dtype=bool)
    for centre, half, angle in ((0.3 + 0.3j, 0.1, 0.5), (0.7 + 0.4j, 0.09, 0.2)):
        turned = (places - centre) * np.exp(-1j * angle)
        kept &= np.maximum(np.abs(turned.real), np.abs(turned.imag)) > half
    used, faces = np.unique(faces[kept], return_inverse=True)
    return vertices[used], faces.reshape(-1, 3)


@pytest.mark.parametrize("quads", [300, 2000])
def test_loops_that_are_askew_come_to_lie_on_grid_lines(quads):
    grid = integer_grid(*askew(), quads=quads, repair=True)
    check_laws(grid)
    check_sides(grid)
    assert TriangleMesh(grid.vertices, grid.faces).euler_characteristic == -1


def test_loops_around_the_holes_of_a_scan(shared):
    """Its sides have to turn by up to 45 degrees, without any of them folding over."""
    grid = integer_grid(shared("stanford-bunny.obj"), quads=1000)
    check_laws(grid)
    check_sides(grid)


def test_a_boundary_lies_on_grid_lines_unless_told_otherwise():
    usual, straight, free = (
        integer_grid(*shapes.hill(), quads=100, **options)
        for options in ({}, {"boundary": "straight"}, {"boundary": "free"})
    )
    np.testing.assert_array_equal(usual.corner_grid, straight.corner_grid)
    assert len(free.corners) == 0
    assert not free.notes


def test_where_no_boundary_on_grid_lines_is_found_it_is_free(monkeypatch):
    search = integer_grid_module._Search
    usual = search.with_boundary

    def none_is_straight(self, boundary, whole_sides=False):
        if boundary == "straight":
            raise errors.GridError("too few quads")
        return usual(self, boundary, whole_sides)

    monkeypatch.setattr(search, "with_boundary", none_is_straight)
    grid = integer_grid(*shapes.hill(), quads=100)
    assert any("none was found with it on grid lines: too few quads." in note for note in grid.notes)
    with pytest.raises(errors.GridError):
        integer_grid(*shapes.hill(), quads=100, boundary="straight")


def test_a_flat_rectangle_keeps_its_shape():
    """Three by two, asked for 24 squares: six by four, each of half a unit."""
    vertices, faces = shapes.grid(9, 6)
    grid = integer_grid(vertices * [3, 2, 0], faces, quads=24, boundary="straight")
    check_laws(grid)
    check_sides(grid)
    assert len(grid.corners) == 4
    assert grid.corner_quarters.tolist() == [1] * 4
    assert sorted(np.ptp(grid.corner_grid.reshape(-1, 2), axis=0)) == [4, 6]
    assert grid.qc_mean == pytest.approx(1)
    assert grid.least_area == pytest.approx(1)


def test_sides_of_loops_that_are_askew_are_said_to_be_on_no_line(shared):
    """The holes of this plate are straight each, but seams between them turn by any angle."""
    grid = integer_grid(shared("plane-holes.obj"), quads=3000, boundary="straight", refine=True)
    check_laws(grid)
    assert not len(grid.corners)
    assert "of the boundary are on no grid line" in " ".join(grid.notes)


def test_what_is_too_coarse_is_told_what_would_do(shared):
    """A chess piece with 114 cones, in thirty squares."""
    result = flatten(shared("knight.off"), **{**QUARTER, "correct_handles": True})
    with pytest.raises(errors.GridError, match=r"no grid of about 30 quads was found: .*would do") as caught:
        integer_grid(result, quads=30)
    advised = int(str(caught.value).rsplit("; ", 1)[1].split()[0].replace(",", ""))
    check_laws(integer_grid(result, quads=advised))


@pytest.mark.parametrize("quads", [1000, 2000])
def test_triangles_of_three_cones_are_split(shared, quads):
    """Of a thousand triangles, 14 have cones at all corners, which rounding puts in a row."""
    result = flatten(shared("knight.off"), **{**QUARTER, "correct_handles": True})
    grid = integer_grid(result, quads=quads)
    check_laws(grid)
    assert double_areas(grid).sum() / 2 == pytest.approx(quads, rel=0.1)
    assert "edges between cones" in " ".join(grid.notes)
    is_cone = np.zeros(len(grid.vertices), dtype=bool)
    is_cone[grid.cones] = True
    assert is_cone[grid.faces].sum(axis=1).max() == 1
    # The same surface: vertices of the input, then middles of its edges; triangles within those they were.
    count = len(result.vertices)
    assert (grid.vertices[:count] == result.vertices).all()
    area = [
        np.linalg.norm(np.cross(v[f[:, 1]] - v[f[:, 0]], v[f[:, 2]] - v[f[:, 0]]), axis=1).sum()
        for v, f in ((grid.vertices, grid.faces), (result.vertices, result.faces))
    ]
    assert area[0] == pytest.approx(area[1])


def test_holes_of_a_free_boundary_turn_by_quarters(shared):
    """Rotations around holes are made whole, as those along handles are."""
    grid = integer_grid(shared("stanford-bunny.obj"), quads=3000)
    check_laws(grid)
    assert double_areas(grid).sum() / 2 == pytest.approx(3000, rel=0.05)


@pytest.mark.parametrize("name", ["sphere", "torus"])
def test_the_coarsest_grid(name):
    """Fewest quads: six of a sphere with eight cones; of a torus with few, about that many."""
    said = []
    grid = integer_grid(*SHAPES[name], coarsest=True, progress=lambda text, part: said.append((text, part)))
    check_laws(grid)
    squares = double_areas(grid).sum() / 2
    least = max(1, len(grid.cones) - TriangleMesh(grid.vertices, grid.faces).euler_characteristic)
    assert least - 1e-6 <= squares <= 8 * least
    assert f"has {squares:,.0f} quads" in " ".join(grid.notes)
    assert any("coarsest grid" in text for text, _ in said)
    assert all(0 <= part <= 1 for _, part in said)


def test_the_coarsest_grid_is_a_quad_layout(shared):
    """Each of its quads becomes k by k: finer grids of the same cones have many times the quads."""
    result = flatten(shared("spot.obj"), **{**QUARTER, "correct_handles": True})
    grid = integer_grid(result, coarsest=True)
    check_laws(grid)
    mesh = find_quads(grid)
    assert mesh.euler_characteristic == 2
    assert len(mesh.quads) < 80
    assert set(mesh.irregular) <= set(range(len(mesh.vertices)))
    assert len(mesh.irregular) == len(result.cones)


def test_cones_far_too_near_each_other_are_kept_apart():
    """The torus' smooth layout is a hundred times smaller in one place than it should be, with cones there."""
    shape = pair(shapes.sphere(2), shapes.torus(24, 12))
    grid = integer_grid(*shape, quads=900)
    check_laws(grid)


def test_numbering_changes_nothing():
    vertices, faces = shapes.sphere(3)
    shuffled, turned, new = shapes.renumber(vertices, faces)
    one, two = (integer_grid(*shape, quads=300) for shape in ((vertices, faces), (shuffled, turned)))
    assert sorted(new[one.cones]) == sorted(two.cones)
    assert np.sort(double_areas(one)) == pytest.approx(np.sort(double_areas(two)), rel=1e-6)


def test_grids_are_the_same_every_time():
    one, two = (integer_grid(*shapes.sphere(3), quads=123) for _ in range(2))
    assert (one.corner_grid == two.corner_grid).all()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"quads": 10, "size": 1.0}, "give one of them"),
        ({"quads": 10, "coarsest": True}, "give one of them"),
        ({"size": 1.0, "coarsest": True}, "give one of them"),
        ({"quads": 0}, "quads must be a positive number"),
        ({"size": -1.0}, "size must be a positive number"),
        ({"stretch": -1.0}, "stretch must be"),
    ],
)
def test_options_that_make_no_sense(options, message):
    with pytest.raises(errors.OptionError, match=message):
        integer_grid(*shapes.sphere(2), **options)


def test_cones_that_are_no_quarter_turns_are_refused():
    free = flatten(*shapes.sphere(3), charts="one")
    with pytest.raises(errors.GridError, match="beside quarter turns"):
        integer_grid(free)
    with pytest.raises(errors.OptionError, match="faces and options"):
        integer_grid(free, charts="one")
