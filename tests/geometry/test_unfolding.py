"""From a flat metric to points in the plane: unfolding, and untangling before it."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

from coneflat import TriangleMesh, errors
from coneflat.geometry import edge_lengths, flat_triangles
from coneflat.geometry.intrinsic import halfedge_twins
from coneflat.geometry.planar import heights
from coneflat.geometry.straight import FlatTriangles, rest_sides, straight_triangles
from coneflat.geometry.unfolding import _close_gaps, unfold
from coneflat.mesh import cut_open
from coneflat.metric.exact import exact_metric
from coneflat.optimise.untangling import DEGENERATE_HEIGHT, untangle
from coneflat.seams import find_seams


def flat_surface(shape, cones, seed=0):
    """A mesh, its cut, its flat triangles, and the cones, where phi is 0."""
    mesh = TriangleMesh(*shape)
    inside = np.flatnonzero(~mesh.is_boundary_vertex)
    chosen = np.random.default_rng(seed).choice(inside, cones, replace=False)
    fixed = mesh.is_boundary_vertex.copy()
    fixed[chosen] = True
    metric = exact_metric(mesh, edge_lengths(*shape), np.zeros(len(fixed)), fixed=fixed)
    assert metric.converged
    costs = np.linalg.norm(mesh.vertices[mesh.edges[:, 0]] - mesh.vertices[mesh.edges[:, 1]], axis=1)
    cut_mesh = cut_open(mesh, find_seams(mesh, chosen, costs))
    return mesh, cut_mesh, straight_triangles(metric.triangulation, metric.flips), chosen


def planar(points, faces):
    """Flat triangles of a drawing in the plane, one frame for all."""
    mesh = TriangleMesh(np.column_stack([points, np.zeros(len(points))]), faces)
    place = (points[:, 0] + 1j * points[:, 1])[faces]
    sides = place[:, [2, 0, 1]] - place[:, [1, 2, 0]]
    return mesh, FlatTriangles(sides.ravel(), np.ones(sides.size, dtype=complex), halfedge_twins(mesh))


def side_vectors(uv, corners):
    points = (uv[:, 0] + 1j * uv[:, 1])[corners]
    return points[:, [2, 0, 1]] - points[:, [1, 2, 0]]


def test_a_flat_torus_unfolds_to_its_parallelogram():
    """A metric of one's own: every side 1, so six triangles of 60 degrees at each vertex and no curvature at all."""
    mesh = TriangleMesh(*shapes.grid(5, 4, wrap=(True, True)))
    flat = flat_triangles(mesh, np.ones(mesh.faces.shape))
    seams = find_seams(mesh, np.empty(0, dtype=np.int64), np.ones(len(mesh.edges)))
    disk = cut_open(mesh, seams).mesh
    points = unfold(flat, disk.faces)
    np.testing.assert_allclose(np.abs(side_vectors(points, disk.faces)), 1, rtol=1e-12)
    assert len(points) == len(disk.vertices)
    hull = points - points.mean(axis=0)
    assert np.abs(hull).max() < 6
    first, second = (points[disk.faces[:, k]] - points[disk.faces[:, 0]] for k in (1, 2))
    areas = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2
    np.testing.assert_allclose(areas, np.sqrt(3) / 4, rtol=1e-12)


def test_corners_that_do_not_fit():
    mesh = TriangleMesh(*shapes.grid(3, 3))
    flat = flat_triangles(mesh, edge_lengths(mesh.vertices, mesh.faces))
    with pytest.raises(errors.ArrayShapeError, match=r"shape \(18, 3\), .* got \(17, 3\)"):
        unfold(flat, mesh.faces[1:])
    with pytest.raises(errors.FaceIndexError, match=r"outside 0\.\.53"):
        unfold(flat, mesh.faces + 60)
    spread = unfold(flat, 2 * mesh.faces)
    # NumPy 1 adds the same products, and zeros, in another order.
    rounding = 1e-15 if np.lib.NumpyVersion(np.__version__) < "2.0.0" else 0.0
    np.testing.assert_allclose(spread[::2], unfold(flat, mesh.faces), rtol=0, atol=rounding)
    np.testing.assert_array_equal(spread[1::2], 0)
    with pytest.raises(errors.ArrayShapeError, match=r"lengths must have the shape \(18, 3\)"):
        flat_triangles(mesh, np.ones((18, 2)))


def turns(mesh):
    """The angle around each vertex that turns by a full or a half turn: none has curvature."""
    return np.where(mesh.is_boundary_vertex, np.pi, 2 * np.pi)


def angles_around(flat, mesh):
    """The angle around each vertex of flat triangles, none of them inverted."""
    sides = flat.sides.reshape(-1, 3)
    angles = np.abs(np.angle(-sides[:, [1, 2, 0]] / sides[:, [2, 0, 1]]))
    return np.bincount(mesh.faces.ravel(), angles.ravel(), len(mesh.vertices))


def seam_mismatch(flat, cut, uv, corners):
    lengths = np.abs(side_vectors(uv, corners)).ravel()
    seam = cut & (flat.twin >= 0)
    return np.abs(lengths[seam] / lengths[flat.twin[seam]] - 1).max(initial=0)


SURFACES = {
    "sphere": (shapes.sphere(3), 6),
    "annulus": (shapes.annulus(), 2),
    "genus 2": (shapes.genus(2), 5),
}


class TestUnfold:
    @pytest.mark.parametrize("name", SURFACES)
    def test_every_triangle_keeps_its_shape(self, name):
        _, cut_mesh, flat, _ = flat_surface(*SURFACES[name])
        corners = cut_mesh.mesh.faces
        sides = side_vectors(unfold(flat, corners), corners)
        shape = flat.sides.reshape(-1, 3)
        turn = sides[:, 0] / shape[:, 0]
        np.testing.assert_allclose(np.abs(turn), 1, rtol=1e-10)
        np.testing.assert_allclose(turn[:, None] * shape, sides, rtol=1e-9)

    @pytest.mark.parametrize("name", SURFACES)
    def test_both_sides_of_a_seam_are_equal(self, name):
        _, cut_mesh, flat, _ = flat_surface(*SURFACES[name])
        corners = cut_mesh.mesh.faces
        cut = halfedge_twins(cut_mesh.mesh) < 0
        uv = unfold(flat, corners)
        assert seam_mismatch(flat, cut, uv, corners) < 1e-12
        lengths, flat_lengths = np.abs(side_vectors(uv, corners)).ravel(), np.abs(flat.sides)
        np.testing.assert_allclose(lengths, flat_lengths, rtol=1e-11)

    def test_a_planar_mesh_stays_unchanged(self):
        points, faces = shapes.grid(9, 7)
        _, flat = planar(points[:, :2], faces)
        uv = unfold(flat, faces)
        np.testing.assert_allclose(uv - uv[0], points[:, :2] - points[0, :2], atol=1e-14)

    def test_charts_are_laid_out_one_by_one(self):
        points, faces = shapes.join(shapes.grid(4, 3), shapes.grid(3, 5))
        _, flat = planar(points[:, :2], faces)
        uv = unfold(flat, faces)
        count = 5 * 4
        for part in (slice(0, count), slice(count, None)):
            plane_points = points[part, :2]
            np.testing.assert_allclose(uv[part] - uv[part][0], plane_points - plane_points[0], atol=1e-14)

    def test_triangles_turned_over_are_laid_out_that_way(self):
        points, faces = shapes.grid(4, 4)
        points[12] += [0.6, 0.1, 0]  # an inner vertex, across its neighbours
        _, flat = planar(points[:, :2], faces)
        assert flat.is_inverted.any()
        uv = unfold(flat, faces)
        np.testing.assert_allclose(uv - uv[0], points[:, :2] - points[0, :2], atol=1e-14)


class TestUntangle:
    def test_one_vertex_on_the_wrong_side(self):
        points, faces = shapes.grid(8, 8)
        points[40] += [0.2, 0.05, 0]
        mesh, flat = planar(points[:, :2], faces)
        border = mesh.is_boundary_vertex
        result = untangled(flat, mesh, turns(mesh), border, np.zeros_like(border))
        assert len(result.left) == 0
        assert not border[result.moved].any()
        assert len(result.moved) < 20
        assert 0 < result.largest_move < 3
        uv = unfold(result.flat, faces)
        assert (heights(side_vectors(uv, faces)) > DEGENERATE_HEIGHT).all()
        still = np.setdiff1d(np.arange(len(points)), result.moved)
        offset = uv[still] - points[still, :2]
        np.testing.assert_allclose(offset, offset[:1].repeat(len(still), 0), atol=1e-13)

    def test_nothing_to_do(self):
        points, faces = shapes.grid(4, 4)
        mesh, flat = planar(points[:, :2], faces)
        result = untangled(flat, mesh, turns(mesh), mesh.is_boundary_vertex)
        assert result.flat.sides is flat.sides
        assert len(result.moved) == len(result.left) == 0
        assert result.largest_move == 0

    def test_what_cannot_be_untangled_is_reported(self):
        points, faces = shapes.grid(4, 4)
        points[12] += [0.6, 0.1, 0]
        mesh, flat = planar(points[:, :2], faces)
        result = untangled(flat, mesh, turns(mesh), np.ones(len(points), dtype=bool))
        np.testing.assert_array_equal(result.left, np.flatnonzero(flat.is_inverted))
        assert len(result.moved) == 0

    def test_seams_stay_equal_where_their_vertices_move(self):
        """A vertex on a seam is dragged across its neighbours, on the surface: both copies with it."""
        mesh, cut_mesh, flat, cones = flat_surface(shapes.sphere(3), 4)
        n = len(mesh.vertices)
        pinned = np.zeros(n, dtype=bool)
        pinned[cones] = True
        seam = np.bincount(cut_mesh.origin, minlength=n) > 1
        victim = int(np.flatnonzero(seam & ~pinned)[3])
        tangled = drag(flat, mesh.faces, victim, 1.3)
        assert tangled.is_inverted.any()
        result = untangled(tangled, mesh, angles_around(flat, mesh), pinned)
        assert len(result.left) == 0
        assert victim in result.moved
        assert not pinned[result.moved].any()
        inner = result.flat.twin
        np.testing.assert_allclose(
            result.flat.turns * result.flat.sides[inner], -result.flat.sides, rtol=1e-10
        )
        cut = halfedge_twins(cut_mesh.mesh) < 0
        corners = cut_mesh.mesh.faces
        uv = unfold(result.flat, corners)
        assert (heights(side_vectors(uv, corners)) > DEGENERATE_HEIGHT).all()
        assert seam_mismatch(result.flat, cut, uv, corners) < 1e-12

    def test_vertices_beside_a_seam_are_moved_first(self):
        mesh, cut_mesh, flat, cones = flat_surface(shapes.sphere(3), 4)
        n = len(mesh.vertices)
        pinned = np.zeros(n, dtype=bool)
        pinned[cones] = True
        seam = np.bincount(cut_mesh.origin, minlength=n) > 1
        is_adjacent = np.zeros(n, dtype=bool)
        is_adjacent[mesh.faces[seam[mesh.faces].any(axis=1)]] = True
        victim = int(np.flatnonzero(is_adjacent & ~seam)[0])
        tangled = drag(flat, mesh.faces, victim, 1.3)
        result = untangled(tangled, mesh, angles_around(flat, mesh), pinned | seam, pinned)
        assert len(result.left) == 0
        assert not seam[result.moved].any()


def untangled(flat, mesh, angles, *stays):
    """Flat triangles untangled."""
    target_shapes = rest_sides(np.abs(flat.sides).reshape(-1, 3))
    return untangle(flat, mesh.faces, angles, mesh.is_boundary_vertex, stays, target_shapes)


def drag(flat, faces, vertex, amount):
    """Move a flat vertex along one of its edges by a multiple of its length."""
    sides = flat.sides.copy()
    tails = faces[:, [1, 2, 0]].ravel()
    h = first = int(np.flatnonzero(tails == vertex)[0])
    shift = amount * sides[h]
    while True:
        before = h - h % 3 + (h + 2) % 3
        sides[h] -= shift
        sides[before] += shift
        h = int(flat.twin[before])
        if h == first:
            return FlatTriangles(sides, flat.turns, flat.twin)
        shift *= flat.turns[h]


def test_gaps_whose_squares_underflow_are_left():
    """Their product with the stiffness would be zero, the divisor of a step."""
    exact = np.array([0, 1, 1j])
    sides = exact[[2, 0, 1]] - exact[[1, 2, 0]]
    points, free = exact.copy(), np.zeros(3, dtype=bool)
    points[0] = 1e-160
    before = points.copy()
    _close_gaps(sides, np.arange(3), np.ones(1, dtype=complex), points, free)
    np.testing.assert_array_equal(points, before)
    points[0] = 0.1
    _close_gaps(sides, np.arange(3), np.ones(1, dtype=complex), points, free)
    assert np.abs(np.diff(points) - np.diff(exact)).max() < 0.07
