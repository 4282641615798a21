"""Intrinsic Delaunay triangulations: the condition, the flips, their undoing."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

from coneflat import TriangleMesh
from coneflat.geometry import angle_defect, corner_angles, double_areas, edge_lengths
from coneflat.geometry.delaunay import euclidean_suspects, intrinsic_delaunay, make_delaunay
from coneflat.geometry.intrinsic import halfedge_twins, intrinsic_triangulation
from coneflat.geometry.straight import straight_triangles

SURFACES = {
    "torus": shapes.torus(),
    "disk": shapes.hill(),
    "tetrahedron": shapes.tetrahedron(),
}


def noisy_mesh(shape, seed=0):
    vertices, faces = shape
    noise = np.random.default_rng(seed).normal(size=vertices.shape)
    size = edge_lengths(vertices, faces).mean()
    return TriangleMesh(vertices + 0.15 * size * noise, faces)


def opposite_angle_sums(triangulation):
    angles = corner_angles(triangulation.length.reshape(-1, 3)).ravel()
    inner = triangulation.twin >= 0
    return angles[inner] + angles[triangulation.twin[inner]]


def curvature(triangulation, is_boundary_vertex):
    angles = corner_angles(triangulation.length.reshape(-1, 3))
    return angle_defect(triangulation.faces, angles, is_boundary_vertex)


class TestIntrinsicDelaunay:
    @pytest.mark.parametrize("name", SURFACES)
    def test_every_edge_satisfies_the_condition(self, name):
        mesh = noisy_mesh(SURFACES[name])
        triangulation, _ = intrinsic_delaunay(mesh, edge_lengths(mesh.vertices, mesh.faces))
        assert opposite_angle_sums(triangulation).max() <= np.pi + 1e-9

    @pytest.mark.parametrize("name", SURFACES)
    def test_area_and_curvature_stay_the_same(self, name):
        mesh = noisy_mesh(SURFACES[name])
        lengths = edge_lengths(mesh.vertices, mesh.faces)
        triangulation, flips = intrinsic_delaunay(mesh, lengths)
        assert len(flips) or name == "tetrahedron"
        before = angle_defect(mesh.faces, corner_angles(lengths), mesh.is_boundary_vertex)
        np.testing.assert_allclose(curvature(triangulation, mesh.is_boundary_vertex), before, atol=1e-11)
        areas = double_areas(triangulation.length.reshape(-1, 3))
        assert areas.sum() == pytest.approx(double_areas(lengths).sum(), rel=1e-12)

    @pytest.mark.parametrize("stretch", [1, 30])
    def test_edges_that_are_left_out_at_first_need_no_flip(self, stretch):
        """Also those of a grid of squares, whose diagonals are Delaunay up to rounding."""
        for mesh in (noisy_mesh(SURFACES["torus"]), TriangleMesh(*shapes.grid(12, 12))):
            stretched = mesh.moved_to(mesh.vertices * [stretch, 1, 1])
            lengths = edge_lengths(stretched.vertices, stretched.faces)
            every = intrinsic_triangulation(stretched, lengths)
            suspects = euclidean_suspects(every)
            assert len(suspects) < len(every.twin)
            triangulation, flips = intrinsic_delaunay(stretched, lengths)
            np.testing.assert_array_equal(make_delaunay(every), flips)
            np.testing.assert_array_equal(every.length, triangulation.length)

    def test_gluing_is_consistent(self):
        triangulation, _ = intrinsic_delaunay(
            mesh := noisy_mesh(shapes.genus(2)), edge_lengths(mesh.vertices, mesh.faces)
        )
        slots = np.arange(len(triangulation.twin))
        twin, tail = triangulation.twin, triangulation.tail
        np.testing.assert_array_equal(twin[twin], slots)
        head = tail[slots - slots % 3 + (slots + 1) % 3]
        np.testing.assert_array_equal(head[twin], tail)
        np.testing.assert_array_equal(triangulation.length[twin], triangulation.length)

    def test_a_delaunay_mesh_needs_no_flip(self):
        mesh = TriangleMesh(*shapes.sphere(3, bumps=0.0))
        assert len(intrinsic_delaunay(mesh, edge_lengths(mesh.vertices, mesh.faces))[1]) == 0

    def test_one_flip_of_a_thin_quad(self):
        vertices = np.array([[0, 0, 0], [4, 0, 0], [2, 0.5, 0], [2, -0.5, 0]], dtype=float)
        mesh = TriangleMesh(vertices, np.array([[0, 1, 2], [1, 0, 3]]))
        triangulation, flips = intrinsic_delaunay(mesh, edge_lengths(mesh.vertices, mesh.faces))
        assert len(flips) == 1
        assert triangulation.length[flips[0]] == pytest.approx(1.0, rel=1e-15)

    def test_a_grid_of_squares_is_left_alone(self):
        mesh = TriangleMesh(*shapes.grid(12, 12))
        turned = TriangleMesh(mesh.vertices @ shapes.rotation(), mesh.faces)
        assert len(intrinsic_delaunay(turned, edge_lengths(turned.vertices, turned.faces))[1]) == 0

    @pytest.mark.parametrize("scale", [1e-30, 1e30])
    def test_scale_does_not_matter(self, scale):
        mesh = noisy_mesh(shapes.sphere(3))
        lengths = edge_lengths(mesh.vertices, mesh.faces)
        _, flips = intrinsic_delaunay(mesh, lengths)
        np.testing.assert_array_equal(intrinsic_delaunay(mesh, scale * lengths)[1], flips)


class TestPtolemyFlips:
    def test_they_agree_with_euclidean_flips_where_all_points_lie_on_a_circle(self):
        angles = np.sort(np.random.default_rng(3).uniform(0, 2 * np.pi, 12))
        points = np.stack([np.cos(angles), np.sin(angles), np.zeros(12)], axis=1)
        fan = np.stack([np.zeros(10), np.arange(1, 11), np.arange(2, 12)], axis=1).astype(np.int64)
        mesh = TriangleMesh(points, fan)
        triangulation = intrinsic_triangulation(mesh, edge_lengths(points, fan))
        phi = np.random.default_rng(4).normal(0, 0.5, 12)
        assert len(make_delaunay(triangulation, phi))
        faces = triangulation.faces
        chords = np.linalg.norm(points[faces[:, [2, 0, 1]]] - points[faces[:, [1, 2, 0]]], axis=2)
        np.testing.assert_allclose(triangulation.length.reshape(-1, 3), chords, rtol=1e-13)

    @pytest.mark.parametrize("name", ["torus", "tetrahedron"])
    def test_lengths_come_back_when_the_scaling_does(self, name):
        mesh = noisy_mesh(SURFACES[name])
        triangulation, _ = intrinsic_delaunay(mesh, edge_lengths(mesh.vertices, mesh.faces))
        before = np.sort(triangulation.length)
        phi = np.random.default_rng(5).normal(0, 1.5, len(mesh.vertices))
        assert len(make_delaunay(triangulation, phi))
        scale = np.exp(phi / 2)
        faces = triangulation.faces
        scaled = triangulation.length.reshape(-1, 3) * scale[faces[:, [1, 2, 0]]] * scale[faces[:, [2, 0, 1]]]
        # A triangulation that satisfies the ideal Delaunay condition has no broken triangle.
        assert (double_areas(scaled) > 0).all()
        make_delaunay(triangulation, np.zeros(len(phi)))
        np.testing.assert_allclose(np.sort(triangulation.length), before, rtol=1e-11)


class TestUndoing:
    @pytest.mark.parametrize("name", SURFACES)
    def test_the_input_comes_back(self, name):
        """Flipped and unflipped in one and the same metric, the triangles are the input's."""
        mesh = noisy_mesh(SURFACES[name])
        lengths = edge_lengths(mesh.vertices, mesh.faces)
        triangulation, flips = intrinsic_delaunay(mesh, lengths)
        flat = straight_triangles(triangulation, flips)
        np.testing.assert_array_equal(flat.twin, halfedge_twins(mesh))
        np.testing.assert_allclose(np.abs(flat.sides).reshape(-1, 3), lengths, rtol=1e-11)
        assert not flat.is_inverted.any()

    def test_triangles_agree_across_their_edges(self):
        mesh = noisy_mesh(shapes.genus(2))
        triangulation, flips = intrinsic_delaunay(mesh, edge_lengths(mesh.vertices, mesh.faces))
        flat = straight_triangles(triangulation, flips)
        np.testing.assert_allclose(flat.turns * flat.sides[flat.twin], -flat.sides, rtol=1e-12)
        assert np.abs(flat.sides.reshape(-1, 3).sum(axis=1)).max() < 1e-14


def test_flips_around_a_hub_take_no_square_of_its_edges():
    """A fan of 8,000 triangles with a wavy border: flipped in just any order it takes 80 flips an edge."""
    count = 8000
    turn = 2 * np.pi * np.arange(count) / count
    radius = 1 + 0.3 * np.sin(5 * turn)
    rim = np.stack([radius * np.cos(turn), radius * np.sin(turn), 0.1 * np.sin(3 * turn)], axis=1)
    ends = np.arange(1, count + 1)
    mesh = TriangleMesh(
        np.concatenate([[[0, 0, 0.5]], rim]),
        np.stack([np.zeros(count, dtype=np.int64), ends, np.roll(ends, -1)], axis=1),
    )
    triangulation, flips = intrinsic_delaunay(mesh, edge_lengths(mesh.vertices, mesh.faces))
    assert opposite_angle_sums(triangulation).max() <= np.pi + 1e-6
    assert count / 2 < len(flips) < 8 * count
