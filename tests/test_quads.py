"""Quads out of integer-grid maps whose quads are known."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from grid_maps import (
    CUBE,
    L_SHAPE,
    QUARTER,
    RING,
    TRIPOD,
    TWO_RINGS,
    broken,
    bumpy,
    flat,
    on_squares,
    polycube,
    quad_areas,
    random_sheet,
    torus_map,
    with_motions,
)
from shapes import grid as rectangle
from shapes import renumber

from coneflat import read_mesh
from coneflat.errors import GridError, UnknownFormatError
from coneflat.geometry.nearest import surface_distances
from coneflat.grid.exact_grid import exact_grid
from coneflat.grid.extract import extract_quads
from coneflat.grid.quality import measure_quads

TOOL = Path(__file__).resolve().parents[2] / "shared" / "tools" / "quads.py"


def oriented_sides(quads):
    """Return the directed sides of all quads as sorted pairs."""
    sides = np.stack([quads.ravel(), np.roll(quads, -1, axis=1).ravel()], axis=1)
    return sides[np.lexsort(sides.T)]


def as_set(mesh):
    """Return the quads as places, from the least corner on, sorted."""
    places = np.round(mesh.vertices[mesh.quads], 6) + 0.0
    rolled = [np.roll(quad, -min(range(4), key=lambda i, q=quad: tuple(q[i])), axis=0) for quad in places]
    return np.array(sorted(rolled, key=lambda quad: quad.ravel().tolist()))


# Corners of polycubes have valence 3 where one cube is, 5 where three are; the tripod's inner one has 6.
SHAPES = {
    "cube": (CUBE, 2, {3: 8}),
    "l": (L_SHAPE, 2, {3: 10, 5: 2}),
    "tripod": (TRIPOD, 2, {3: 13, 5: 3, 6: 1}),
    "ring": (RING, 0, {3: 8, 5: 8}),
    "double torus": (TWO_RINGS, -2, {3: 8, 5: 16}),
}


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize(("cells", "inside"), [(1, 0), (1, 9), (2, 3), (5, 12), (7, 1)])
def test_polycubes(name, cells, inside):
    cubes, euler, valences = SHAPES[name]
    points, squares = polycube(cubes)
    grid = on_squares(points, squares, cells, inside=inside, along=min(inside, 3), seed=cells)
    mesh = extract_quads(grid)
    count = len(squares) * cells**2
    assert len(mesh.quads) == count
    assert len(mesh.vertices) == count + euler  # E is 2 F
    assert mesh.euler_characteristic == mesh.surface_euler == euler
    which, many = np.unique(mesh.valences[mesh.irregular], return_counts=True)
    assert dict(zip(which.tolist(), many.tolist(), strict=True)) == valences
    # On flat squares all quads are squares, at corners that are whole multiples, and they cover all.
    np.testing.assert_allclose(quad_areas(mesh), 1 / cells**2, rtol=1e-9)
    np.testing.assert_allclose(mesh.vertices * cells, np.round(mesh.vertices * cells), atol=1e-9)
    assert len(np.unique(np.round(mesh.vertices * cells), axis=0)) == len(mesh.vertices)
    # Each side runs once each way; normals point outwards as those of the triangles do.
    sides = oriented_sides(mesh.quads)
    assert len(np.unique(sides, axis=0)) == len(sides)
    corners = mesh.vertices[mesh.quads]
    volume = (np.cross(corners[:, 0], corners[:, 1]) * corners[:, 2]).sum()
    volume += (np.cross(corners[:, 0], corners[:, 2]) * corners[:, 3]).sum()
    assert volume / 6 == pytest.approx(len(cubes))
    # Cones are vertices of the input.
    places = grid.vertices[grid.cones]
    assert set(map(tuple, np.round(mesh.vertices[mesh.irregular], 9))) == set(map(tuple, places))


@pytest.mark.parametrize("turned", range(4))
@pytest.mark.parametrize("moved", [(0, 0), (-17, 4000)])
def test_rectangle_on_grid_lines(turned, moved):
    points, faces = rectangle(7, 5)
    places = points[:, :2] * [9, 4] @ np.linalg.matrix_power(QUARTER, turned).T + moved
    mesh = extract_quads(flat(places, faces))
    assert (len(mesh.quads), mesh.left_out) == (36, 0)
    assert mesh.area_left_out == pytest.approx(0, abs=1e-9)
    assert mesh.is_boundary_edge.sum() == 26
    assert mesh.is_boundary_vertex.sum() == 26
    assert len(mesh.irregular) == 0


def test_boundary_within_rounding_of_grid_lines():
    points, faces = rectangle(7, 5)
    places = points[:, :2] * [9, 4] + 1e-12 * np.random.default_rng(0).normal(size=(len(points), 2))
    mesh = extract_quads(flat(places, faces))
    assert (len(mesh.quads), mesh.left_out) == (36, 0)


def test_shear_within_whole_numbers():
    # A parallelogram over (0, 0), (6, 2), (8, 8), (2, 6): 32 squares, of which those whole inside are counted here.
    points, faces = rectangle(11, 13)
    places = points[:, :2] @ np.array([[6, 2], [2, 6]])
    mesh = extract_quads(flat(places, faces))
    inverse = np.linalg.inv(np.array([[6, 2], [2, 6]]))
    x, y = (z.ravel() for z in np.meshgrid(np.arange(9), np.arange(9), indexing="ij"))
    corners = np.stack(
        [np.stack([x + i, y + j], axis=1) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))], axis=1
    )
    inside = ((corners @ inverse > -1e-9) & (corners @ inverse < 1 + 1e-9)).all(axis=(1, 2))
    assert len(mesh.quads) == inside.sum()
    assert {tuple(q) for q in np.round(mesh.vertices[mesh.quads].mean(axis=1) - 0.5)[:, :2].astype(int)} == {
        (a, b) for a, b in zip(x[inside], y[inside], strict=True)
    }
    assert mesh.area_left_out == pytest.approx(32 - inside.sum())
    assert mesh.left_out > 0


@pytest.mark.parametrize("seed", range(6))
def test_free_boundaries(seed):
    """Of a random sheet, those squares are quads whose sides and inside lie on it."""
    grid = random_sheet(seed)
    mesh = extract_quads(grid)
    whole = {
        tuple(place)
        for place in np.round(mesh.vertices[mesh.quads].mean(axis=1) - 0.5).astype(int)[:, :2].tolist()
    }
    assert whole == grid.whole_squares
    assert len(whole) == len(mesh.quads)
    assert mesh.area_left_out == pytest.approx(grid.area - len(whole))
    np.testing.assert_allclose(quad_areas(mesh), 1.0)
    # Manifold: at every vertex one fan, so its quads are one fewer than its edges on the boundary, as many inside.
    used = np.bincount(mesh.quads.ravel(), minlength=len(mesh.vertices))
    np.testing.assert_array_equal(mesh.valences - used, mesh.is_boundary_vertex.astype(int))


@pytest.mark.parametrize(("along", "across", "shear"), [(12, 8, 0), (9, 7, 4), (3, 3, 0), (31, 5, 13)])
def test_torus(along, across, shear):
    grid = torus_map(along, across, shear)
    mesh = extract_quads(grid)
    assert len(mesh.quads) == len(mesh.vertices) == along * across
    assert (mesh.valences == 4).all()
    assert mesh.euler_characteristic == 0


def test_torus_too_coarse():
    with pytest.raises(GridError, match="more quads"):
        extract_quads(torus_map(2, 8, 0))
    with pytest.raises(GridError, match="vertex twice"):
        extract_quads(torus_map(1, 8, 0))


def test_points_know_where_they_lie():
    grid = on_squares(*polycube(TRIPOD), 4, seed=3)
    mesh = extract_quads(grid)
    np.testing.assert_allclose(mesh.barycentric.sum(axis=1), 1.0)
    assert (mesh.barycentric >= 0).all()
    places = np.einsum("qi,qix->qx", mesh.barycentric, grid.corner_grid[mesh.faces])
    np.testing.assert_allclose(places, np.round(places), atol=1e-9)


def test_numbering_does_not_matter():
    grid = on_squares(*polycube(L_SHAPE), 5, seed=4)
    mesh = extract_quads(grid)
    again = extract_quads(grid)
    for name in ("vertices", "quads", "faces", "barycentric"):
        np.testing.assert_array_equal(getattr(mesh, name), getattr(again, name))
    vertices, faces, new = renumber(grid.vertices, grid.faces)
    corner = {tuple(np.sort(new[face])): face for face in grid.faces}
    place = {
        (tuple(np.sort(new[face])), int(new[v])): p
        for face, places in zip(grid.faces, grid.corner_grid, strict=True)
        for v, p in zip(face, places, strict=True)
    }
    assert len(corner) == len(faces)
    corner_grid = np.array([[place[tuple(np.sort(face)), int(v)] for v in face] for face in faces])
    other = extract_quads(with_motions(vertices, faces, corner_grid))
    np.testing.assert_array_equal(as_set(other), as_set(mesh))


def test_exact_across_every_edge():
    grid = on_squares(*polycube(TRIPOD), 5, seed=7)
    rng = np.random.default_rng(0)
    grid.corner_grid = grid.corner_grid + 1e-12 * rng.normal(size=grid.corner_grid.shape)
    exact = exact_grid(grid)
    one = np.flatnonzero(exact.twin >= 0)
    two = exact.twin[one]
    for k, j in ((1, 2), (2, 1)):
        x, y = np.moveaxis(exact.corners[one // 3, (one % 3 + k) % 3], -1, 0)
        for turn in range(4):
            here = exact.turns[one] == turn
            moved = np.stack([x, y], 1)[here] @ np.linalg.matrix_power(QUARTER, turn).T
            moved += exact.shifts[one][here]
            np.testing.assert_array_equal(moved, exact.corners[two // 3, (two % 3 + j) % 3][here])


def test_what_is_no_grid_map_is_refused():
    grid = on_squares(*polycube(CUBE), 3)
    shifts = grid.shifts.copy()
    shifts[4] += 1
    with pytest.raises(GridError, match=r"2 half-edges with a motion that is not the inverse"):
        extract_quads(broken(grid, shifts=shifts))
    corners = grid.corner_grid.copy()
    corners[5, 1] += 0.25
    with pytest.raises(GridError, match="grid units apart|upside down"):
        extract_quads(broken(grid, corner_grid=corners))
    with pytest.raises(
        GridError, match=r"8 vertices with other angles than said: .* has 3 quarter turns, not 4"
    ):
        extract_quads(broken(grid, cones=grid.cones[:0], quarters=grid.quarters[:0]))
    with pytest.raises(GridError, match="upside down"):
        extract_quads(mirrored(grid))


def mirrored(grid):
    """Return the map with its axes exchanged: all triangles are clockwise."""
    turns = np.where(grid.turns < 0, -1, -grid.turns % 4)
    return broken(grid, corner_grid=grid.corner_grid[..., ::-1], turns=turns, shifts=grid.shifts[:, ::-1])


def test_cones_off_the_grid_are_refused():
    # Moving everything by half a unit in one chart leaves motions whole only if the cones are off by a half.
    points, squares = polycube(CUBE)
    grid = on_squares(points, squares, 3)
    moved = with_motions(grid.vertices, grid.faces, grid.corner_grid + 0.5)
    with pytest.raises(GridError, match="8 vertices around which the grid does not close"):
        extract_quads(moved)


def test_quads_that_touch_in_a_point_have_a_vertex_each():
    outline = [(0, 0), (1, 0), (1.2, 0.8), (2, 1), (2, 2), (1, 2), (0.8, 1.2), (0, 1), (1, 1)]
    faces = np.array([[8, k, (k + 1) % 8] for k in range(8)])
    mesh = extract_quads(flat(outline, faces))
    assert (len(mesh.quads), len(mesh.vertices), mesh.left_out) == (2, 8, 2)
    assert (np.round(mesh.vertices, 9) == [1, 1, 0]).all(axis=1).sum() == 2
    assert mesh.area_left_out == pytest.approx(0.4)


def test_no_whole_square():
    points, faces = rectangle(3, 3)
    with pytest.raises(GridError, match="no whole square"):
        extract_quads(flat(points[:, :2] * 0.9 + 0.05, faces))


def test_measures_by_hand():
    # A sheet of 2 x 1 rhombi with angles of 60 degrees; the surface is the same plane.
    points, faces = rectangle(4, 4)
    grid = flat(points[:, :2] * 4, faces)
    grid.vertices = (points[:, :2] * 4) @ np.array([[1, 0, 0], [0.5, 0.75**0.5, 0]])
    mesh = extract_quads(grid)
    measures = measure_quads(mesh)
    assert measures.quads == 16
    assert measures.boundary_edges == 16
    assert measures.angle_mean == pytest.approx(30)
    assert measures.angle_max == pytest.approx(30)
    assert measures.edge_mean == pytest.approx(1)
    assert measures.edge_cv == pytest.approx(0, abs=1e-9)
    assert measures.jacobian_min == measures.jacobian_mean == pytest.approx(0.75**0.5)
    assert measures.hausdorff == pytest.approx(0, abs=1e-12)


def test_gaps_by_hand():
    """Squares across the ridge of a roof: their diagonals cut it, so they are as far off as it is high there."""
    x, y = (z.ravel() for z in np.meshgrid(np.arange(5) / 2, np.arange(3), indexing="ij"))
    index = np.arange(15).reshape(5, 3)
    a, b, c, d = (index[i : i + 4, j : j + 2].ravel() for i, j in ((0, 0), (1, 0), (1, 1), (0, 1)))
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    grid = flat(np.column_stack([x, y]), faces)
    height = np.where(x == 0.5, 0.3, 0.0)  # within the first column of quads, 0 at its two sides
    grid.vertices = np.column_stack([x, y, height])
    measures = measure_quads(extract_quads(grid))
    assert measures.from_surface == pytest.approx(0.3)
    # From the middle of the quad to the slopes, which rise by 0.3 over 0.5.
    assert measures.to_surface == pytest.approx(0.15 / np.hypot(0.5, 0.3) * 1.0)


def test_vertices_without_a_face_are_no_part_of_the_surface():
    grid = on_squares(*polycube(L_SHAPE), 3, inside=7, along=2, seed=3)
    far = broken(grid, vertices=np.concatenate([grid.vertices, [[1e3, 0, 0]]]))
    assert measure_quads(extract_quads(far)).hausdorff == measure_quads(extract_quads(grid)).hausdorff


def test_distances_are_the_least_of_all_triangles():
    rng = np.random.default_rng(0)
    vertices, faces = rng.normal(size=(40, 3)), rng.integers(0, 40, (23, 3))
    faces = faces[(np.diff(np.sort(faces, axis=1), axis=1) > 0).all(axis=1)]
    queries = rng.normal(size=(50, 3)) * 2
    u, v = (z.ravel() for z in np.meshgrid(np.linspace(0, 1, 201), np.linspace(0, 1, 201), indexing="ij"))
    weights = np.stack([1 - u - v, u, v], axis=1)[u + v <= 1 + 1e-12]
    samples = (weights @ vertices[faces]).reshape(-1, 3)
    dense = np.array([np.linalg.norm(samples - query, axis=1).min() for query in queries])
    found = surface_distances(vertices, faces, queries)
    assert (found <= dense + 1e-12).all()
    # Samples are 0.005 sides apart, and a distance is off by no more than half of that.
    assert (found >= dense - 0.03).all()


def test_files(tmp_path):
    mesh = extract_quads(on_squares(*polycube(TRIPOD), 3))
    for name in ("quads.obj", "quads.ply"):
        path = mesh.save(tmp_path / name)
        read = read_mesh(path)
        np.testing.assert_array_equal(read.vertices, mesh.vertices)
        np.testing.assert_array_equal(read.corners, mesh.quads.ravel())
        np.testing.assert_array_equal(np.diff(read.offsets), 4)
    with pytest.raises(UnknownFormatError, match=r"\.obj, \.ply"):
        mesh.save(tmp_path / "quads.stl")


@pytest.mark.skipif(not TOOL.exists(), reason="the measuring tool is not here")
def test_measures_agree_with_another_program(tmp_path):
    grid = bumpy(1)
    mesh = extract_quads(grid)
    path = mesh.save(tmp_path / "quads.obj")
    run = subprocess.run([sys.executable, TOOL, path], capture_output=True, text=True, check=True)
    theirs, ours = json.loads(run.stdout), measure_quads(mesh)
    assert theirs["faces"] == theirs["quads"] == ours.quads
    assert theirs["open"] == ours.boundary_edges == 0
    assert theirs["nonmanifold"] == 0
    assert theirs["euler"] == ours.euler_characteristic == -2
    assert theirs["irregular"] == ours.irregular
    valences = {int(v): n for v, n in theirs["valences"].items() if v != "4"}
    assert valences == ours.irregular_valences
    for name in ("angle_mean", "angle_p95", "angle_max", "edge_cv", "jacobian_min"):
        assert theirs[name] == pytest.approx(getattr(ours, name), rel=1e-9)
