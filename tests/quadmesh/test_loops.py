"""Short loops: separatrices of grids, separatrices that stay joined, strips and patches."""

from __future__ import annotations

import sys

import numpy as np
import pytest
import shapes
from grid_maps import CUBE, L_SHAPE, RING, TRIPOD, on_squares, polycube, torus_map
from stored_meshes import SHARED

import coneflat
from coneflat.geometry import double_areas, edge_lengths
from coneflat.optimise import StretchEnergy
from coneflat.quadmesh.alignment import aligned
from coneflat.quadmesh.extract import extract_quads
from coneflat.quadmesh.integer_map import grid_of_corners
from coneflat.quadmesh.loops import MAX_ENERGY, SCALES, grid_with_loops, nearest_grid
from coneflat.quadmesh.quad_mesh import opposite_sides
from coneflat.quadmesh.relaxing import GridGoal
from coneflat.quadmesh.rounding import find_rounding
from coneflat.quadmesh.separatrices import find_separatrices
from coneflat.quadmesh.splitting import split_between_nodes
from coneflat.quadmesh.strips import find_patches, find_strips

QUARTER = {"quantise": np.pi / 2, "charts": "one", "min_cone_angle": 1.5 * np.pi, "max_cone_angle": 3 * np.pi}
TOOLS = SHARED.parent / "tools"


def polycube_grid(shape, cells):
    plain = on_squares(*polycube(shape), cells=cells)
    return grid_of_corners(plain.vertices, plain.faces, plain.corner_grid)


def lengths_in_quads(mesh):
    """The lengths of the lines from irregular vertices of a closed mesh, followed from vertex to vertex."""
    twin, starts = opposite_sides(mesh.quads), mesh.quads.ravel()
    is_irregular = np.bincount(starts) != 4
    lengths = []
    for side in np.flatnonzero(is_irregular[starts]):
        length = 1
        while not is_irregular[starts[following := side - side % 4 + (side + 1) % 4]]:
            across = twin[following]
            side = across - across % 4 + (across + 1) % 4
            length += 1
        lengths.append(length)
    return sorted(lengths)


def rounding_of(mesh, squares):
    flattening = coneflat.flatten(*mesh, **QUARTER)
    area = double_areas(edge_lengths(*mesh)).sum() / 2
    size = np.sqrt(area / squares)
    return find_rounding(split_between_nodes(aligned(flattening, size)))


def ends_of(grid):
    """The irregular vertices at both ends of each separatrix, sorted."""
    lines = find_separatrices(grid)
    ends = np.stack([grid.faces.ravel()[lines.starts], grid.faces.ravel()[lines.ends]], axis=1)
    return ends[np.lexsort(ends.T)].tolist()


def test_the_size_of_squares_is_that_of_the_grid():
    """Layouts are scaled for loops, here to 416 squares instead of 400."""
    mesh = shapes.sphere(4)
    grid = coneflat.integer_grid(*mesh, quads=400, loops=True, symmetry="none")
    area = double_areas(edge_lengths(*mesh)).sum() / 2
    assert grid.squares > 410
    assert grid.size == pytest.approx(np.sqrt(area / grid.squares), rel=0.01)


def test_separatrices_of_a_cube_are_its_edges_in_both_directions():
    grid = polycube_grid(CUBE, 5)
    lines = find_separatrices(grid)
    assert lines.lengths.tolist() == [5] * 24
    assert np.array_equal(np.bincount(grid.faces.ravel()[lines.starts])[grid.cones], [3] * 8)


@pytest.mark.parametrize("shape", [L_SHAPE, TRIPOD, RING])
def test_separatrices_of_a_grid_are_those_of_its_quads(shape):
    grid = polycube_grid(shape, 4)
    assert sorted(find_separatrices(grid).lengths) == lengths_in_quads(extract_quads(grid))


def test_separatrices_of_a_rounded_grid_are_those_of_its_quads():
    grid = coneflat.integer_grid(coneflat.sample_path(), quads=600)
    lines = find_separatrices(grid)
    assert len(lines.lengths) == grid.quarters.sum()
    assert sorted(lines.lengths) == lengths_in_quads(extract_quads(grid))


def test_joined_separatrices_stay_joined():
    """Integers with the same offsets, at twice the number of squares, join the same vertices."""
    rounding, goal = rounding_of(shapes.sphere(4), 400), GridGoal(StretchEnergy(0.3))
    grid = nearest_grid(rounding, goal)
    rows = find_separatrices(grid).offsets(rounding.transitions, rounding.layout.corners)
    assert not (rows @ rounding.nearest()).any()
    finer = rounding.scaled(4.0).with_zeros(rows)
    values = finer.nearest()
    assert not (rows @ values).any()
    assert finer.energy(values) >= rounding.scaled(4.0).energy(rounding.scaled(4.0).nearest()) - 1e-12
    assert ends_of(nearest_grid(finer, goal)) == ends_of(grid)


def test_energy_is_that_of_the_displacement():
    """It scales with the square of the size, and is 0 for the layout itself."""
    rounding = rounding_of(shapes.sphere(4), 400)
    assert rounding.energy(rounding.basis @ rounding.start) == pytest.approx(0, abs=1e-12)
    values = rounding.nearest()
    assert rounding.scaled(9.0).energy(3 * values) == pytest.approx(9 * rounding.energy(values))


def test_a_grid_with_short_loops_is_near_the_layout():
    rounding, goal = rounding_of(shapes.sphere(4), 2000), GridGoal(StretchEnergy(0.3))
    nearest, short = nearest_grid(rounding, goal), grid_with_loops(rounding, goal)
    assert find_separatrices(short).lengths.mean() < find_separatrices(nearest).lengths.mean() / 2
    scales = np.square(SCALES) * [0.99, *[1.0] * (len(SCALES) - 2), 1.01]  # relaxing changes areas a little
    assert scales.min() <= short.squares / rounding.layout.area <= scales.max()
    assert not short.notes
    assert 0 < MAX_ENERGY < 0.1


def test_strips_and_patches_of_a_cube():
    mesh = extract_quads(polycube_grid(CUBE, 5))
    strips = find_strips(mesh)
    assert strips.lengths.tolist() == [20] * 15
    assert find_patches(mesh).max() + 1 == 6


@pytest.mark.parametrize(("shear", "count", "longest"), [(0, 20, 12), (2, 10, 48), (1, 9, 96)])
def test_strips_of_a_sheared_torus(shear, count, longest):
    """Of 12 by 8 squares, the 12 strips of 8 join to as many as the greatest common divisor of 12 and the shear."""
    mesh = extract_quads(torus_map(12, 8, shear))
    lengths = find_strips(mesh).lengths
    assert (len(lengths), lengths.max(), lengths.sum()) == (count, longest, 2 * 96)
    assert find_patches(mesh).max() == 0


def test_patches_of_a_grid_with_a_notch():
    """Two lines from the corner with three quads divide it into three."""
    square = np.arange(49).reshape(7, 7)
    points = np.array([[x, y, 0.0] for x in range(8) for y in range(8)])
    corner = (square + square // 7).ravel()
    quads = np.stack([corner, corner + 8, corner + 9, corner + 1], axis=1)
    quads = quads[(corner // 8 < 4) | (corner % 8 < 4)]
    vertices, numbers = np.unique(quads, return_inverse=True)
    triangles = np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])
    surface = coneflat.TriangleMesh(
        points[vertices], np.unique(triangles, return_inverse=True)[1].reshape(-1, 3)
    )
    nothing = np.zeros(len(vertices), dtype=int), np.zeros((len(vertices), 3))
    mesh = coneflat.QuadMesh(points[vertices], numbers.reshape(-1, 4), *nothing, 0, 0.0, surface)
    assert find_patches(mesh).max() + 1 == 3
    assert len(find_strips(mesh).lengths) == 14


@pytest.mark.skipif(not (TOOLS / "quad_loops.py").exists(), reason="the tool is not there")
@pytest.mark.parametrize("mesh", [shapes.sphere(3), shapes.torus(), shapes.hill()])
def test_measures_agree_with_an_independent_program(mesh, monkeypatch):
    monkeypatch.syspath_prepend(str(TOOLS))
    from quad_loops import loops

    quads = coneflat.quads(*mesh, quads=400)
    measures, expected = coneflat.measure_quads(quads), loops(quads.quads, len(quads.vertices))
    assert (measures.strips, measures.patches) == (expected["strips"], expected["base"])
    assert measures.longest_strip == round(expected["strip_max"] * len(quads.quads) ** 0.5)
    assert "quad_loops" in sys.modules


def test_short_loops_have_few_patches():
    long = coneflat.measure_quads(coneflat.quads(*shapes.sphere(4), quads=3000))
    short = coneflat.measure_quads(coneflat.quads(*shapes.sphere(4), quads=3000, loops=True))
    assert short.patches < 30 * short.irregular < long.patches
    assert short.longest_strip < long.longest_strip
    assert (short.irregular, short.inverted) == (long.irregular, 0)


def test_short_loops_do_not_depend_on_numbering_motion_and_scale():
    vertices, faces = shapes.sphere(4)
    other_points, other_faces, _ = shapes.renumber(vertices, faces)
    moved = 7 * other_points @ shapes.rotation().T + 3
    first = coneflat.quads(vertices, faces, quads=1500, loops=True)
    second = coneflat.quads(moved, other_faces, quads=1500, loops=True)
    strips = [np.sort(find_strips(mesh).lengths) for mesh in (first, second)]
    assert np.array_equal(*strips)
    assert find_patches(first).max() == find_patches(second).max()


def test_loops_of_a_given_grid_are_those_of_its_integers():
    grid = polycube_grid(CUBE, 2)
    with pytest.raises(coneflat.errors.OptionError, match="a grid already has"):
        coneflat.quads(grid, loops=True)


def test_few_quads_have_no_short_loops():
    mesh = coneflat.quads(*shapes.sphere(3), quads=40, loops=True)
    assert any("Loops are as by default" in note for note in mesh.notes)
