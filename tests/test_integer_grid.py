"""Integer grids: transitions that are whole, cones on grid points, no triangle turned over, any topology."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

from coneflat import errors, flatten, integer_grid, sample_path
from coneflat.mesh import TriangleMesh

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
    inside = ~mesh.is_boundary_vertex
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


def test_the_coarsest_grid_of_a_sphere_is_a_cube():
    """Eight cones of three quads, and no other vertex: six quads."""
    grid = integer_grid(*shapes.sphere(3), quads=1)
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


def test_grids_are_the_same_every_time():
    one, two = (integer_grid(*shapes.sphere(3), quads=123) for _ in range(2))
    assert (one.corner_grid == two.corner_grid).all()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"quads": 10, "size": 1.0}, "give one of them"),
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
