"""The exact conformal metric: convergence, independent routes to the same answer, refusals."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from spheres import cones_on, lengths_of, random_curvatures, random_sphere

from coneflat import TriangleMesh, errors
from coneflat.geometry import angle_defect, corner_angles, cotangent_laplacian, cotangents
from coneflat.geometry.intrinsic import intrinsic_triangulation
from coneflat.geometry.straight import straight_triangles
from coneflat.metric.conformal import find_suspects
from coneflat.metric.exact import double, exact_metric
from coneflat.metric.hessian import HessianPattern
from coneflat.metric.linear import scaled_lengths


def curvature_of(metric, is_boundary_vertex):
    angles = corner_angles(metric.triangulation.length.reshape(-1, 3))
    return angle_defect(metric.triangulation.faces, angles, is_boundary_vertex)


class TestConvergence:
    def test_one_number_for_all_vertices(self):
        """The metric of constant curvature on a sphere, and a flat torus."""
        ball, ring = TriangleMesh(*shapes.sphere(2)), TriangleMesh(*shapes.torus())
        even = exact_metric(ball, lengths_of(ball), 4 * np.pi / len(ball.vertices))
        np.testing.assert_allclose(even.curvature, 4 * np.pi / len(ball.vertices), atol=1e-12)
        assert np.abs(exact_metric(ring, lengths_of(ring), 0.0).curvature).max() < 1e-11

    def test_triangles_of_the_metric_have_its_curvature(self):
        """Sums of their angles, up to full turns: some may be flipped."""
        mesh = TriangleMesh(*shapes.hill(16, 12))
        target = np.zeros(len(mesh.vertices))
        border = np.flatnonzero(mesh.is_boundary_vertex)
        target[border] = 2 * np.pi / len(border)
        target[border[::2]] += 0.6
        target[border[1::2]] -= 0.6
        metric = exact_metric(mesh, lengths_of(mesh), target)
        flat = metric.straight()
        assert len(flat.sides) == mesh.faces.size
        sides = flat.sides.reshape(-1, 3)
        angles = np.angle(-sides[:, [1, 2, 0]] / sides[:, [2, 0, 1]])
        around = np.bincount(mesh.faces.ravel(), angles.ravel(), len(mesh.vertices))
        turned = np.where(mesh.is_boundary_vertex, np.pi, 2 * np.pi) - around - target
        np.testing.assert_allclose(np.exp(1j * turned), 1, atol=1e-9)

    @pytest.mark.parametrize("seed", range(4))
    def test_random_cones_on_a_sphere(self, seed):
        """Cone angles between 0.1 pi and 8 pi, in the manner of Campen et al. 2021."""
        rng = np.random.default_rng(seed)
        mesh = random_sphere(1000, seed)
        target = cones_on(mesh, random_curvatures(rng.integers(3, 31), 4 * np.pi, rng), seed)
        metric = exact_metric(mesh, lengths_of(mesh), target)
        assert metric.converged
        np.testing.assert_allclose(curvature_of(metric, mesh.is_boundary_vertex), target, atol=1e-10)

    @pytest.mark.parametrize("seed", range(4))
    def test_random_curvatures_on_the_boundary_of_a_disk(self, seed):
        rng = np.random.default_rng(seed)
        mesh = TriangleMesh(*shapes.hill(16, 12))
        target = np.zeros(len(mesh.vertices))
        border = mesh.is_boundary_vertex
        values = rng.normal(0, rng.uniform(0.1, 1.2), border.sum())
        for _ in range(1000):
            values = np.minimum(values + (2 * np.pi - values.sum()) / len(values), 0.95 * np.pi)
        target[border] = values
        metric = exact_metric(mesh, lengths_of(mesh), target)
        assert metric.converged
        np.testing.assert_allclose(metric.curvature, target, atol=1e-10)

    @pytest.mark.parametrize("genus", [1, 3])
    def test_one_cone_on_a_surface_with_handles(self, genus):
        mesh = TriangleMesh(*shapes.genus(genus))
        target = cones_on(mesh, [2 * np.pi * (2 - 2 * genus)], genus)
        metric = exact_metric(mesh, lengths_of(mesh), target)
        assert metric.converged
        np.testing.assert_allclose(curvature_of(metric, mesh.is_boundary_vertex), target, atol=1e-10)

    def test_two_needles(self):
        mesh = TriangleMesh(*shapes.sphere(3))
        target = cones_on(mesh, [1.999 * np.pi, 1.999 * np.pi, 0.002 * np.pi])
        assert exact_metric(mesh, lengths_of(mesh), target).converged

    def test_free_boundary(self):
        mesh = TriangleMesh(*shapes.annulus())
        fixed = mesh.is_boundary_vertex
        metric = exact_metric(mesh, lengths_of(mesh), np.zeros(len(fixed)), fixed=fixed)
        assert metric.converged
        assert np.abs(metric.curvature[~fixed]).max() < 1e-12
        np.testing.assert_array_equal(metric.log_scale[fixed], 0)
        assert metric.curvature.sum() == pytest.approx(0, abs=1e-10)


class TestTwoRoutes:
    def test_with_and_without_initial_flips_on_a_delaunay_mesh(self):
        mesh = TriangleMesh(*shapes.sphere(3, bumps=0.1))
        target = cones_on(mesh, np.full(8, np.pi / 2))
        flipped = exact_metric(mesh, lengths_of(mesh), target)
        plain = exact_metric(mesh, lengths_of(mesh), target, delaunay=False)
        assert flipped.euclidean_flips == plain.euclidean_flips == 0
        np.testing.assert_allclose(flipped.log_scale, plain.log_scale, atol=1e-12)

    def test_without_flips_it_is_newton_on_the_triangles_of_the_input(self):
        mesh = TriangleMesh(*shapes.sphere(3, bumps=0.0))
        lengths = lengths_of(mesh)
        target = cones_on(mesh, np.full(80, np.pi / 20))
        metric = exact_metric(mesh, lengths, target)
        assert len(metric.flips) == 0
        phi = np.zeros(len(target))
        for _ in range(12):
            scaled = scaled_lengths(lengths, mesh.faces, phi, "mean")
            miss = target - angle_defect(mesh.faces, corner_angles(scaled), mesh.is_boundary_vertex)
            hessian = cotangent_laplacian(mesh.faces, cotangents(scaled), len(phi)).toarray()
            phi[1:] += np.linalg.solve(hessian[1:, 1:], miss[1:])
        np.testing.assert_allclose(metric.log_scale - metric.log_scale[0], phi - phi[0], atol=1e-11)

    @pytest.mark.parametrize("shape", [shapes.sphere(3), shapes.torus(), shapes.hill(), shapes.genus(2)])
    def test_prescribing_the_resulting_curvatures_gives_the_same_metric(self, shape):
        mesh = TriangleMesh(*shape)
        fixed = mesh.is_boundary_vertex.copy()
        fixed[np.random.default_rng(1).choice(len(fixed), 6, replace=False)] = True
        free = exact_metric(mesh, lengths_of(mesh), np.zeros(len(fixed)), fixed=fixed)
        again = exact_metric(mesh, lengths_of(mesh), np.where(fixed, free.curvature, 0.0))
        assert free.converged
        assert again.converged
        assert np.ptp(again.log_scale - free.log_scale) < 1e-9

    def test_the_start_does_not_matter(self):
        mesh = TriangleMesh(*shapes.torus())
        target = cones_on(mesh, [np.pi, 0.5 * np.pi, -1.5 * np.pi])
        from_zero = exact_metric(mesh, lengths_of(mesh), target)
        start = np.random.default_rng(0).normal(0, 1, len(target))
        from_random = exact_metric(mesh, lengths_of(mesh), target, start=start)
        np.testing.assert_allclose(from_zero.log_scale, from_random.log_scale, atol=1e-9)

    def test_the_double_of_a_disk_has_the_metric_of_the_disk_twice(self):
        """A disk whose boundary edges see acute angles needs no flip of theirs, so both must agree."""
        mesh = TriangleMesh(*shapes.hill(10, 10))
        lengths = lengths_of(mesh)
        once = intrinsic_triangulation(mesh, lengths)
        doubled, original = double(once)
        n, m = len(mesh.vertices), len(mesh.faces)
        assert len(doubled.faces) == 2 * m
        np.testing.assert_array_equal(original[:n], np.arange(n))
        np.testing.assert_array_equal(doubled.twin[doubled.twin], np.arange(6 * m))
        heads = doubled.faces[:, [2, 0, 1]].ravel()
        np.testing.assert_array_equal(heads[doubled.twin], doubled.tail)
        closed = np.zeros(doubled.vertex_count, dtype=bool)
        curvature = angle_defect(doubled.faces, corner_angles(doubled.length.reshape(-1, 3)), closed)
        plain = angle_defect(mesh.faces, corner_angles(lengths), mesh.is_boundary_vertex)
        np.testing.assert_allclose(curvature, (np.where(mesh.is_boundary_vertex, 2, 1) * plain)[original])

    def test_surfaces_with_broken_boundary_triangles_are_doubled(self):
        mesh = TriangleMesh(*shapes.hill())
        rng = np.random.default_rng(0)
        border = mesh.is_boundary_vertex
        values = rng.normal(0, 2.0, border.sum())
        for _ in range(1000):
            values = np.minimum(values + (2 * np.pi - values.sum()) / len(values), 0.95 * np.pi)
        target = np.zeros(len(border))
        target[border] = values
        metric = exact_metric(mesh, lengths_of(mesh), target)
        assert metric.doubled
        assert metric.converged
        np.testing.assert_allclose(metric.curvature, target, atol=1e-10)
        flat = metric.straight()
        inner = flat.twin >= 0
        np.testing.assert_allclose(np.abs(flat.sides[inner]), np.abs(flat.sides[flat.twin[inner]]), rtol=1e-9)
        np.testing.assert_array_equal(flat.twin, intrinsic_triangulation(mesh, lengths_of(mesh)).twin)
        at_once = exact_metric(mesh, lengths_of(mesh), target, doubled=True)
        np.testing.assert_allclose(at_once.log_scale, metric.log_scale, atol=1e-9)
        assert at_once.steps < metric.steps


class TestInvariance:
    def test_scale_and_gauge(self):
        """The log conformal factor does not see the unit of length, and the total area stays."""
        mesh = TriangleMesh(*shapes.sphere(3))
        target = cones_on(mesh, [np.pi, 2.5 * np.pi - np.pi, 1.5 * np.pi])
        metric = exact_metric(mesh, lengths_of(mesh), target)
        scaled = exact_metric(mesh, 1e-20 * lengths_of(mesh), target)
        np.testing.assert_allclose(scaled.log_scale, metric.log_scale, atol=1e-10)
        flat = straight_triangles(metric.triangulation, metric.flips).sides.reshape(-1, 3)
        area = (np.conj(flat[:, 0]) * flat[:, 1]).imag.sum() / 2
        a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
        assert area == pytest.approx(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2, rel=1e-10)

    def test_renumbering(self):
        vertices, faces = shapes.sphere(3)
        renumbered_vertices, renumbered_faces, number = shapes.renumber(vertices, faces)
        mesh, renumbered = TriangleMesh(vertices, faces), TriangleMesh(renumbered_vertices, renumbered_faces)
        target = cones_on(mesh, np.full(4, np.pi))
        moved = np.empty_like(target)
        moved[number] = target
        metric = exact_metric(mesh, lengths_of(mesh), target)
        renumbered_metric = exact_metric(renumbered, lengths_of(renumbered), moved)
        np.testing.assert_allclose(renumbered_metric.log_scale[number], metric.log_scale, atol=1e-9)

    def test_the_same_input_gives_the_same_bits(self):
        mesh = TriangleMesh(*shapes.genus(2))
        target = cones_on(mesh, [-4 * np.pi])
        first, second = (exact_metric(mesh, lengths_of(mesh), target) for _ in range(2))
        np.testing.assert_array_equal(first.log_scale, second.log_scale)
        np.testing.assert_array_equal(first.flips, second.flips)

    def test_a_start_of_a_huge_range_takes_no_more_steps_than_none(self):
        mesh = TriangleMesh(*shapes.hill(12, 10))
        target = np.where(mesh.is_boundary_vertex, 2 * np.pi / mesh.is_boundary_vertex.sum(), 0.0)
        start = np.linspace(-120, 120, len(target))
        from_zero, from_start = (
            exact_metric(mesh, lengths_of(mesh), target, start=initial) for initial in (None, start)
        )
        assert from_start.converged
        assert from_start.steps == from_zero.steps
        np.testing.assert_array_equal(from_zero.log_scale, from_start.log_scale)

    def test_components_are_independent(self):
        joined = TriangleMesh(*shapes.join(shapes.sphere(2), shapes.torus(20, 10)))
        sphere = TriangleMesh(*shapes.sphere(2))
        target = cones_on(sphere, np.full(4, np.pi))
        joint_target = np.concatenate([target, np.zeros(len(joined.vertices) - len(target))])
        joint = exact_metric(joined, lengths_of(joined), joint_target)
        alone = exact_metric(sphere, lengths_of(sphere), target)
        assert joint.converged
        np.testing.assert_allclose(joint.log_scale[: len(target)], alone.log_scale, atol=1e-9)


class TestHessian:
    @pytest.mark.parametrize("shape", [shapes.sphere(2), shapes.hill(6, 5), shapes.genus(1)])
    def test_the_hessian_is_the_cotangent_laplacian(self, shape):
        mesh = TriangleMesh(*shape)
        cots = cotangents(lengths_of(mesh))
        pattern = HessianPattern(intrinsic_triangulation(mesh, lengths_of(mesh)))
        nobody = np.zeros(len(mesh.vertices), dtype=bool)
        matrix = pattern.matrix(cots.ravel(), nobody)
        expected = cotangent_laplacian(mesh.faces, cots, len(mesh.vertices))
        np.testing.assert_allclose(matrix.toarray(), expected.toarray(), atol=1e-12)
        assert matrix.has_sorted_indices

    def test_fixed_vertices_do_not_change_the_pattern(self):
        mesh = TriangleMesh(*shapes.hill(6, 5))
        pattern = HessianPattern(intrinsic_triangulation(mesh, lengths_of(mesh)))
        held = mesh.is_boundary_vertex
        cots = cotangents(lengths_of(mesh)).ravel()
        matrix, full = pattern.matrix(cots, held), pattern.matrix(cots, np.zeros_like(held))
        assert matrix.indices is full.indices or np.shares_memory(matrix.indices, full.indices)
        dense = matrix.toarray()
        np.testing.assert_array_equal(dense[held], np.eye(len(held))[held])
        np.testing.assert_array_equal(dense, dense.T)


class TestRefusal:
    def test_a_cone_of_a_full_turn(self):
        mesh = TriangleMesh(*shapes.sphere(2))
        with pytest.raises(
            errors.CurvatureError, match=r"2 pi or more inside: the target of vertex \d+ is 2 pi"
        ):
            exact_metric(mesh, lengths_of(mesh), cones_on(mesh, [2 * np.pi, 2 * np.pi]))

    def test_a_boundary_vertex_of_a_half_turn(self):
        mesh = TriangleMesh(*shapes.hill(6, 5))
        target = np.zeros(len(mesh.vertices))
        target[np.flatnonzero(mesh.is_boundary_vertex)[:2]] = np.pi
        with pytest.raises(errors.CurvatureError, match="pi or more on the boundary"):
            exact_metric(mesh, lengths_of(mesh), target)

    def test_a_sum_that_violates_gauss_bonnet(self):
        mesh = TriangleMesh(*shapes.sphere(2))
        with pytest.raises(errors.CurvatureError, match=r"4 pi, but the input sums to 3 pi"):
            exact_metric(mesh, lengths_of(mesh), cones_on(mesh, [np.pi, np.pi, np.pi]))

    @pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
    def test_a_curvature_that_is_not_finite(self, value):
        mesh = TriangleMesh(*shapes.sphere(2))
        with pytest.raises(errors.CurvatureError, match="NaN or infinite at 1 vertex: "):
            exact_metric(mesh, lengths_of(mesh), cones_on(mesh, [value, np.pi]))

    @pytest.mark.parametrize(
        ("change", "kind", "message"),
        [
            (
                {"target": np.zeros(7)},
                errors.ArrayShapeError,
                r"target must have the shape \(162,\), .* got \(7,\)",
            ),
            ({"target": "flat"}, errors.ArrayShapeError, "target must be an array of numbers"),
            ({"fixed": np.ones(3, dtype=bool)}, errors.ArrayShapeError, "fixed must have the shape"),
            ({"start": np.zeros((162, 1))}, errors.ArrayShapeError, "start must have the shape"),
            ({"fixed_log_scale": [1.0, 2.0]}, errors.ArrayShapeError, "fixed_log_scale must have the shape"),
            (
                {"fixed": np.arange(162) < 2, "fixed_log_scale": np.nan},
                errors.NonFiniteError,
                "fixed_log_scale is NaN or infinite at 2 vertices: 0, 1",
            ),
            ({"lengths": np.ones((320, 2))}, errors.ArrayShapeError, "lengths must have the shape"),
            ({"lengths": np.tile([1.0, 1, 2.5], (320, 1))}, errors.LengthError, "different lengths"),
            ({"mesh": shapes.sphere(2)}, errors.ArrayShapeError, "must be a TriangleMesh, .* got a tuple"),
        ],
    )
    def test_arrays_that_do_not_fit(self, change, kind, message):
        mesh = TriangleMesh(*shapes.sphere(2))
        arguments = {
            "mesh": mesh,
            "lengths": lengths_of(mesh),
            "target": np.full(162, 4 * np.pi / 162),
        } | change
        with pytest.raises(kind, match=message) as caught:
            exact_metric(**arguments)
        assert "\n" not in str(caught.value)

    def test_too_few_steps_are_reported(self):
        mesh = TriangleMesh(*shapes.sphere(3))
        metric = exact_metric(mesh, lengths_of(mesh), cones_on(mesh, np.full(4, np.pi)), max_steps=1)
        assert not metric.converged
        assert metric.residual > 1e-10
        assert abs(metric.curvature[metric.worst_vertex]) > 0


def test_edges_of_broken_triangles_are_suspects():
    # Two triangles on an edge: half-edges 0 and 3 are twins.
    twin = np.array([3, -1, -1, 0, -1, -1])
    suspects = np.empty(6, dtype=np.int64)
    for cots, expected in (
        ([1, 1, 1, 1, 1, 1], []),
        ([0, 1, 1, 1, 1, 1], []),  # a right angle
        ([0, 0, 0, 1, 1, 1], [0]),
        ([1, 1, 1, 0, 0, 0], [0]),
        ([0.5, 1, 1, -0.6, 2, 2], [0]),
    ):
        assert suspects[: find_suspects(twin, np.array(cots, dtype=float), suspects)].tolist() == expected
