"""Quads out of integer-grid maps whose quads are known."""

from __future__ import annotations

import re

import numpy as np
import pytest
import shapes
from grid_maps import (
    CUBE,
    L_SHAPE,
    QUARTER,
    RING,
    TRIPOD,
    TWO_RINGS,
    broken,
    flat,
    on_squares,
    polycube,
    quad_areas,
    torus_map,
    with_motions,
)
from shapes import grid as rectangle

import coneflat
from coneflat.errors import DegenerateFaceError, GridError
from coneflat.geometry.nearest import surface_distances
from coneflat.quadmesh import attempt, policies
from coneflat.quadmesh.alignment import aligned
from coneflat.quadmesh.extract import DegenerateQuads, extract_quads, find_quads
from coneflat.quadmesh.no_grid import NoGrid
from coneflat.quadmesh.quad_mesh import degenerate_quads, least_jacobians
from coneflat.quadmesh.quality import measure_quads
from coneflat.quadmesh.request import GridRequest


def oriented_sides(quads):
    """Return the directed sides of all quads as sorted pairs."""
    sides = np.stack([quads.ravel(), np.roll(quads, -1, axis=1).ravel()], axis=1)
    return sides[np.lexsort(sides.T)]


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
    which, counts = np.unique(mesh.valences[mesh.irregular], return_counts=True)
    assert dict(zip(which.tolist(), counts.tolist(), strict=True)) == valences
    # On flat squares all quads are squares, at corners that are integer multiples, and they cover all.
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


@pytest.mark.parametrize(("along", "across", "shear"), [(12, 8, 0), (9, 7, 4), (3, 3, 0), (31, 5, 13)])
def test_torus(along, across, shear):
    grid = torus_map(along, across, shear)
    mesh = extract_quads(grid)
    assert len(mesh.quads) == len(mesh.vertices) == along * across
    assert (mesh.valences == 4).all()
    assert mesh.euler_characteristic == 0


def test_maps_that_are_no_integer_grid_are_refused():
    grid = on_squares(*polycube(CUBE), 3)
    shifts = grid.shifts.copy()
    shifts[4] += 1
    with pytest.raises(GridError, match="grid units apart|does not close"):
        extract_quads(broken(grid, shifts=shifts))
    corners = grid.corner_grid.copy()
    corners[5, 1] += 0.25
    with pytest.raises(GridError, match="grid units apart|flipped"):
        extract_quads(broken(grid, corner_grid=corners))
    with pytest.raises(GridError, match="flipped"):
        extract_quads(mirrored(grid))


def mirrored(grid):
    """Return the map with its axes exchanged: all triangles are clockwise."""
    turns = np.where(grid.turns < 0, -1, -grid.turns % 4)
    return broken(grid, corner_grid=grid.corner_grid[..., ::-1], turns=turns, shifts=grid.shifts[:, ::-1])


def test_cones_off_the_grid_are_refused():
    # Moving everything by half a unit in one chart leaves integer motions only if the cones are off by a half.
    points, squares = polycube(CUBE)
    grid = on_squares(points, squares, 3)
    moved = with_motions(grid.vertices, grid.faces, grid.corner_grid + 0.5)
    with pytest.raises(GridError, match="8 cones off the grid points"):
        extract_quads(moved)


def test_quads_that_touch_in_a_point_have_a_vertex_each():
    outline = [(0, 0), (1, 0), (1.2, 0.8), (2, 1), (2, 2), (1, 2), (0.8, 1.2), (0, 1), (1, 1)]
    faces = np.array([[8, k, (k + 1) % 8] for k in range(8)])
    mesh = extract_quads(flat(outline, faces))
    assert (len(mesh.quads), len(mesh.vertices), mesh.left_out) == (2, 8, 2)
    assert (np.round(mesh.vertices, 9) == [1, 1, 0]).all(axis=1).sum() == 2
    assert mesh.area_left_out == pytest.approx(0.4)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "quads"),
    [
        ("hill", 300),
        ("annulus", 200),
        ("annulus", 250),
        ("annulus", 350),
        ("annulus", 400),
        ("rotated square", 0),
    ],
)
def test_open_borders_are_covered_to_the_last_quad(name, quads):
    if name == "rotated square":  # its corners are kept, though the grid is not aligned with its sides
        vertices, faces = shapes.grid(9, 9)
        turn = np.exp(0.4j) * (vertices[:, 0] + 1j * vertices[:, 1])
        grid = flat(np.column_stack([turn.real, turn.imag]) * 7, faces)
        assert extract_quads(grid).left_out > 0
        mesh, area = coneflat.quads(grid), 49.0
        corners = np.array([0, 7, 7j, 7 + 7j]) * np.exp(0.4j)
        off = np.abs(mesh.vertices[:, 0] + 1j * mesh.vertices[:, 1] - corners[:, None]).min(axis=1)
        np.testing.assert_allclose(off, 0, atol=1e-9)
    else:
        vertices, faces = shapes.hill(12, 12) if name == "hill" else shapes.annulus(48, 8)
        mesh = coneflat.quads(vertices, faces, quads=quads, boundary="free")
        area = area_of(vertices, faces)
    assert (mesh.left_out, mesh.area_left_out) == (0, pytest.approx(0, abs=1e-9))
    assert mesh.euler_characteristic == mesh.surface_euler
    assert area_of(mesh.vertices, mesh.triangles) > 0.985 * area
    border = mesh.surface.vertices[mesh.surface.is_boundary_vertex]
    ends = mesh.vertices[mesh.edges[mesh.is_boundary_edge]]
    along = (ends[:, :1] + np.linspace(0, 1, 20)[:, None] * (ends[:, 1:] - ends[:, :1])).reshape(-1, 3)
    side = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).mean()
    assert np.linalg.norm(border[:, None] - along, axis=2).min(axis=1).max() < 0.3 * side
    assert (least_jacobians(mesh.vertices, mesh.quads) > 0).all()


def area_of(vertices, faces):
    a, b, c = vertices[faces].transpose(1, 0, 2)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


def test_edges_between_boundary_vertices_do_not_prevent_straight_sides():
    """Triangles with two sides on the boundary degenerate where it is straight, unless the third side is split."""
    vertices, faces = shapes.sphere(3, 0.2)
    vertices, faces = vertices, faces[vertices[faces].mean(axis=1) @ [0.3, 0.2, 1] > -0.1]
    mesh = coneflat.quads(vertices, faces, quads=300)
    checked = coneflat.check_mesh(vertices, faces).mesh
    inner = checked.edges[~checked.is_boundary_edge]
    assert checked.is_boundary_vertex[inner].all(axis=1).any()
    assert mesh.left_out == 0


def test_measures_by_hand():
    # A sheet of 2 x 1 rhombi with angles of 60 degrees; the surface is the same plane.
    points, faces = rectangle(4, 4)
    grid = flat(points[:, :2] * 4, faces)
    grid.vertices = (points[:, :2] * 4) @ np.array([[1, 0, 0], [0.5, 0.75**0.5, 0]])
    mesh = extract_quads(grid)
    measures = measure_quads(mesh)
    assert measures.quads == 16
    assert mesh.is_boundary_edge.sum() == 16
    assert measures.angle_mean == pytest.approx(30)
    assert measures.angle_max == pytest.approx(30)
    assert measures.edge_mean == pytest.approx(1)
    assert measures.edge_cv == pytest.approx(0, abs=1e-9)
    assert measures.jacobian_min == measures.jacobian_mean == pytest.approx(0.75**0.5)
    assert measures.hausdorff == pytest.approx(0, abs=1e-12)


@pytest.mark.slow
def test_distances_are_the_least_of_all_triangles():
    rng = np.random.default_rng(0)
    vertices, faces = rng.normal(size=(40, 3)), rng.integers(0, 40, (23, 3))
    faces = faces[(np.diff(np.sort(faces, axis=1), axis=1) > 0).all(axis=1)]
    queries = rng.normal(size=(50, 3)) * 2
    u, v = (z.ravel() for z in np.meshgrid(np.linspace(0, 1, 201), np.linspace(0, 1, 201), indexing="ij"))
    weights = np.stack([1 - u - v, u, v], axis=1)[u + v <= 1 + 1e-12]
    samples = (weights @ vertices[faces]).reshape(-1, 3)
    dense = np.array([np.linalg.norm(samples - query, axis=1).min() for query in queries])
    distances = surface_distances(vertices, faces, queries)
    assert (distances <= dense + 1e-12).all()
    # Samples are 0.005 sides apart, and a distance is off by no more than half of that.
    assert (distances >= dense - 0.03).all()


def test_components_without_area_get_no_quads():
    vertices, faces = rectangle(4, 4)
    line = np.array([[0, 9, 0], [1, 9, 0], [2, 9, 0]])
    alone = coneflat.quads(vertices, faces, quads=100)
    with_line = coneflat.quads(
        np.concatenate([vertices, line]), [*faces, len(vertices) + np.arange(3)], quads=100
    )
    assert len(with_line.quads) == len(alone.quads)


@pytest.mark.slow
def test_cones_may_be_of_any_angle():
    without, bounded = (
        coneflat.quads(*shapes.genus(2), quads=500, max_cone_angle=max_angle) for max_angle in (None, 20.0)
    )
    np.testing.assert_array_equal(without.quads, bounded.quads)


@pytest.mark.slow
def test_components_with_few_vertices_get_quads():
    """A tetrahedron has four vertices for the eight cones of a cube: its triangles are split."""
    vertices, faces = shapes.join(shapes.sphere(3), shapes.tetrahedron())
    mesh = coneflat.quads(vertices, faces, quads=300)
    assert mesh.euler_characteristic == mesh.surface_euler == 4
    assert len(mesh.grid.faces) > len(faces)


@pytest.mark.slow
def test_quads_that_meet_themselves_are_made_smaller():
    """Around each hole of a surface with three handles there are too few squares."""
    options = {"quads": 10, "cones": "sparse", "distortion": 0.3}
    grid = coneflat.integer_grid(*shapes.genus(3), **options)
    with pytest.raises(GridError, match="degenerate quads? of .*: use more quads"):
        extract_quads(grid)
    assert all("Left out" in note for note in find_quads(grid, leave_out=True).notes)
    mesh = coneflat.quads(*shapes.genus(3), **options)
    assert mesh.euler_characteristic == mesh.surface_euler == -4
    assert any("More quads than requested" in note for note in mesh.notes)
    assert not degenerate_quads(mesh.quads, edges_of(mesh.quads)).any()


@pytest.mark.slow
def test_bad_quads_are_left_out_where_no_finer_grid_is_found(monkeypatch):
    options = {"quads": 10, "cones": "sparse", "distortion": 0.3}
    grid_of_size, searches = policies.grid_of_size, []

    def fail_if_finer(request, flattening_of):
        searches.append(request.size)
        if request.size < requested:
            return NoGrid(GridError("none"))
        return grid_of_size(request, flattening_of)

    monkeypatch.setattr(policies, "grid_of_size", fail_if_finer)
    requested = GridRequest.of(*shapes.genus(3), {"quads": 10}, {}).size
    mesh = coneflat.quads(*shapes.genus(3), **options)
    assert any("Left out" in note for note in mesh.notes)
    assert not any("More quads than requested" in note for note in mesh.notes)
    assert searches[0] == requested > searches[1]
    assert mesh.grid.seconds.keys() >= {"flatten", "grid"}


@pytest.mark.slow
def test_cones_are_chosen_once_for_all_sizes_of_one_price(monkeypatch):
    chosen, sizes, choose = [], [], policies.aligned_flattening

    def count(*arguments, **options):
        chosen.append(arguments)
        return choose(*arguments, **options)

    def fail_twice(grid):
        sizes.append(grid.size)
        if len(sizes) < 3:
            return DegenerateQuads("none")
        return find_quads(grid)

    monkeypatch.setattr(policies, "aligned_flattening", count)
    monkeypatch.setattr(attempt, "find_quads", fail_twice)
    monkeypatch.setattr(attempt, "QUADS_AT_UNIT_PRICE", 1)
    monkeypatch.setattr(policies, "MAX_SPLIT_TRIANGLES", 0)
    mesh = coneflat.quads(*shapes.sphere(3), quads=200)
    assert len(chosen) == 1
    # The second grid is that of the fewest cones.
    assert sizes[0] == sizes[1] > sizes[2] == mesh.grid.size
    monkeypatch.setattr(attempt, "QUADS_AT_UNIT_PRICE", 1e6)
    sizes.clear()
    coneflat.quads(*shapes.sphere(3), quads=200)
    assert len(chosen) == 3


@pytest.mark.slow
def test_components_of_equal_price_have_grids_of_their_own():
    vertices, faces = shapes.sphere(3)
    mesh = coneflat.quads(*shapes.join((vertices, faces), (vertices + 5, faces)), quads=5000)
    assert np.ptp(mesh.vertices, axis=0).min() > 5 + 0.9 * np.ptp(vertices, axis=0).min()


@pytest.mark.slow
def test_a_large_grid_that_is_much_finer_than_requested_is_not_refined(monkeypatch):
    grids = []

    def fail_at_first(grid):
        grids.append(grid.squares)
        if len(grids) < 3:
            return DegenerateQuads("too coarse")
        return find_quads(grid)

    monkeypatch.setattr(attempt, "find_quads", fail_at_first)
    options = {"cones": "sparse", "quads": 2000}
    assert coneflat.quads(*shapes.sphere(3), **options).left_out == 0
    assert len(grids) == 3
    grids.clear()
    monkeypatch.setattr(attempt, "aligned", lambda result, size, angle: aligned(result, size / 1.9, angle))
    coneflat.quads(*shapes.sphere(3), **options)
    assert len(grids) == 1


@pytest.mark.slow
def test_grids_whose_bad_quads_are_left_out_keep_all_notes(monkeypatch):
    """The first grid, of aligned cones, is taken, not that of the fewest cones."""

    monkeypatch.setattr(attempt, "find_quads", lambda grid: DegenerateQuads("too coarse"))
    sizes = np.linspace(1, 2, len(shapes.sphere(3)[0]))
    even, graded = (coneflat.quads(*shapes.sphere(3), quads=200, size=size) for size in (None, sizes))
    assert not any("Cones are not chosen" in note for note in even.notes)
    assert any("Sizes of quads have a correlation" in note for note in graded.notes)
    monkeypatch.setattr(policies, "aligned_map", lambda *_: NoGrid(GridError("none")))
    assert any("Cones are not chosen" in note for note in coneflat.quads(*shapes.sphere(3), quads=200).notes)


@pytest.mark.slow
def test_a_thin_component_does_not_make_the_others_finer(monkeypatch):
    sizes = []

    def fail_for_few(grid):
        sizes.append(grid.squares)
        if grid.squares < 60:
            return DegenerateQuads("as thin as a square")
        return find_quads(grid)

    monkeypatch.setattr(attempt, "find_quads", fail_for_few)
    small, triangles = shapes.sphere(2)
    mesh = coneflat.quads(*shapes.join(shapes.sphere(3), (small / 3 + 3, triangles)), quads=500)
    assert max(sizes) == pytest.approx(450, rel=0.1)
    assert 60 <= len(mesh.quads) - max(sizes) < 160
    assert sum("More quads than requested" in note for note in mesh.notes) == 1
    assert mesh.euler_characteristic == 4


def test_quads_with_a_vertex_or_an_edge_twice():
    quads = np.array([[0, 1, 2, 3], [1, 0, 4, 5], [6, 7, 6, 8], [9, 10, 11, 12], [10, 9, 13, 14]])
    edges = edges_of(quads)
    assert degenerate_quads(quads, edges).tolist() == [False, False, True, False, False]
    edges[4, 0] = edges.max() + 1  # another edge from 9 to 10
    assert degenerate_quads(quads, edges).tolist() == [False, False, True, True, True]


def edges_of(quads):
    """Edges by their vertices."""
    pairs = np.sort(np.stack([quads, np.roll(quads, -1, axis=1)], axis=-1), axis=-1)
    return np.unique(pairs.reshape(-1, 2), axis=0, return_inverse=True)[1].reshape(quads.shape)


@pytest.mark.parametrize("factor", [1e-100, 1e100])
def test_coordinates_out_of_range_are_refused_and_named(factor):
    square = factor * np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    with pytest.raises(GridError, match=re.escape(f"largest coordinate is {factor:g}")):
        coneflat.quads(square, [[0, 1, 2], [0, 2, 3]], quads=16)


def test_triangles_on_a_point_are_refused_without_a_warning():
    with pytest.raises(DegenerateFaceError, match="no area"):
        coneflat.quads(np.zeros((3, 3)), [[0, 1, 2], [0, 2, 1]], quads=900)
