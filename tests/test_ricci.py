"""Discrete Ricci flow: angles and their derivatives, flips, known metrics, other routes to the same answer."""

from __future__ import annotations

import sys
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import shapes
from scipy.spatial import Delaunay

from coneflat import TriangleMesh, errors, flatten
from coneflat.cones import ConeSolution
from coneflat.flat.exact.hessian import HessianPattern
from coneflat.flat.exact.metric import exact_metric
from coneflat.flat.ricci import PackingProblem, packed_radii, ricci_flow
from coneflat.geometry import angle_defect, corner_angles, edge_lengths
from coneflat.geometry.delaunay import other_inversive_distance, tilts
from coneflat.geometry.intrinsic import intrinsic_triangulation

BENCHMARKS = Path(__file__).resolve().parents[1] / "benchmarks"


def lengths_of(mesh):
    return edge_lengths(mesh.vertices, mesh.faces)


def noisy(shape, noise, seed=0):
    vertices, faces = shape
    size = edge_lengths(vertices, faces).mean()
    return TriangleMesh(
        vertices + noise * size * np.random.default_rng(seed).normal(size=vertices.shape), faces
    )


def cones_on(mesh, count, seed=0):
    """Random curvatures that sum to what they must, at random inner vertices."""
    rng = np.random.default_rng(seed)
    total, values = 2 * np.pi * mesh.euler_characteristic, rng.uniform(-4 * np.pi, 1.8 * np.pi, count)
    for _ in range(1000):
        values = np.clip(values + (total - values.sum()) / count, -6 * np.pi, 1.9 * np.pi)
    target = np.zeros(len(mesh.vertices))
    target[rng.choice(np.flatnonzero(~mesh.is_boundary_vertex), count, replace=False)] = values
    return target


class FixedPackingProblem(PackingProblem):
    """Packings on the triangles as they are, as first published; a minimum may lie where some break."""

    def flip(self, log_scale, suspects):
        return np.empty(0, dtype=np.int64)


def without_flips(monkeypatch):
    monkeypatch.setattr("coneflat.flat.ricci.PackingProblem", FixedPackingProblem)
    monkeypatch.setattr("coneflat.flat.ricci.exact_metric", partial(exact_metric, delaunay=False))


def problem_on(mesh, kind=FixedPackingProblem):
    n = len(mesh.vertices)
    flat_turn = np.where(mesh.is_boundary_vertex, np.pi, 2 * np.pi)
    fixed = np.zeros(n, dtype=bool)
    problem = kind(intrinsic_triangulation(mesh, lengths_of(mesh)), flat_turn, np.zeros(n), fixed, fixed)
    problem.prepare(delaunay=False)
    return problem


def cross(one, two):
    return one[0] * two[1] - one[1] * two[0]


def curvature_of(metric, is_boundary_vertex):
    angles = corner_angles(metric.triangulation.length.reshape(-1, 3))
    return angle_defect(metric.triangulation.faces, angles, is_boundary_vertex)


class TestPacking:
    def test_the_lengths_are_those_given_and_circles_do_not_overlap(self):
        mesh = noisy(shapes.hill(), 0.2)
        problem = problem_on(mesh)
        lengths = lengths_of(mesh)
        np.testing.assert_allclose(
            problem.flat_lengths(np.zeros(len(mesh.vertices))), lengths.ravel(), rtol=1e-13
        )
        assert problem.triangulation.length.min() > 1 - 1e-12
        radii = packed_radii(lengths, mesh.faces)
        ends = radii[mesh.faces[:, [1, 2, 0]]] + radii[mesh.faces[:, [2, 0, 1]]]
        assert (ends <= lengths * (1 + 1e-12)).all()
        touching = np.isclose(ends, lengths).any(axis=1)
        assert 0 < touching.sum()

    @pytest.mark.parametrize("shape", [shapes.sphere(1), shapes.hill(5, 4)])
    def test_the_hessian_is_the_derivative_of_the_curvature(self, shape):
        mesh = noisy(shape, 0.1)
        problem, n = problem_on(mesh), len(mesh.vertices)
        u = np.random.default_rng(0).normal(0, 0.1, n)
        state = problem.evaluate(u)
        assert state.broken == 0
        angles = corner_angles(problem.flat_lengths(u).reshape(-1, 3))
        expected = angle_defect(mesh.faces, angles, mesh.is_boundary_vertex)
        np.testing.assert_allclose(state.curvature, expected, atol=1e-12)
        hessian = HessianPattern(problem.triangulation).matrix(state.cots, np.zeros(n, dtype=bool))
        numeric = [
            (problem.evaluate(u + 1e-6 * e).curvature - problem.evaluate(u - 1e-6 * e).curvature) / 2e-6
            for e in np.eye(n)
        ]
        np.testing.assert_allclose(hessian.toarray(), numeric, atol=1e-7)

    def test_four_circles_across_one_circle_have_the_inversive_distance_of_the_plane(self):
        """There an edge and the one that replaces it are both weighted Delaunay: both metrics are one."""
        rng = np.random.default_rng(0)
        for _ in range(20):
            turn = np.sort(rng.uniform(0, 2 * np.pi, 4) / 4 + np.arange(4) * np.pi / 2)
            points = rng.uniform(1.05, 1.4, 4) * np.exp(1j * turn)
            radii = np.sqrt(np.abs(points) ** 2 - 1)

            def inversive(i, j, points=points, radii=radii):
                return (abs(points[i] - points[j]) ** 2 - radii[i] ** 2 - radii[j] ** 2) / (
                    2 * radii[i] * radii[j]
                )

            tail = np.array([0, 2, 1, 2, 0, 3])
            pairs = [(0, 2), (2, 1), (1, 0), (2, 0), (0, 3), (3, 2)]
            around = np.array([inversive(i, j) for i, j in pairs])
            if around[0] <= 1:
                continue
            flipped = other_inversive_distance(around[0], around[2], around[1], around[4], around[5])
            assert flipped == pytest.approx(inversive(1, 3), rel=1e-10)
            sides = tilts(tail, around, radii, False, 0)[0], tilts(tail, around, radii, False, 3)[0]
            assert sides[0] + sides[1] == pytest.approx(0, abs=1e-10)

    def test_the_slope_along_a_side_has_the_sign_of_the_height_of_the_radical_centre(self):
        rng = np.random.default_rng(1)
        seen = set()
        for _ in range(50):
            points, radii = rng.normal(size=(3, 2)), rng.uniform(0.01, 0.3, 3)
            away = points[1:] - points[0]
            if cross(*away) < 0:
                points, away = points[[0, 2, 1]], away[::-1]
            power = (points**2).sum(axis=1) - radii**2
            centre = np.linalg.solve(2 * away, power[1:] - power[0])
            ends = points[[1, 2, 0]] - points[[2, 0, 1]]
            inversive = ((ends**2).sum(axis=1) - radii[[1, 2, 0]] ** 2 - radii[[2, 0, 1]] ** 2) / (
                2 * radii[[1, 2, 0]] * radii[[2, 0, 1]]
            )
            for h in range(3):
                tail, head = points[(h + 1) % 3], points[(h + 2) % 3]
                height = cross(head - tail, centre - tail)
                slope = tilts(np.array([1, 2, 0]), inversive, radii, False, h)[0]
                assert np.sign(slope) == np.sign(height)
                seen.add(np.sign(slope))
        assert seen == {-1.0, 1.0}


class TestConvergence:
    @pytest.mark.parametrize("seed", range(6))
    def test_random_cones_on_a_sphere(self, seed):
        mesh = noisy(shapes.sphere(3), 0.2, seed)
        target = cones_on(mesh, 12, seed)
        metric = exact_metric(mesh, lengths_of(mesh), target, kind=PackingProblem)
        assert metric.converged
        assert metric.ptolemy_flips
        np.testing.assert_allclose(curvature_of(metric, mesh.is_boundary_vertex), target, atol=1e-10)

    @pytest.mark.parametrize("shape", [shapes.torus(), shapes.genus(2), shapes.genus(4)])
    def test_surfaces_with_handles(self, shape):
        mesh = TriangleMesh(*shape)
        target = cones_on(mesh, 5)
        metric = exact_metric(mesh, lengths_of(mesh), target, kind=PackingProblem)
        assert metric.converged
        np.testing.assert_allclose(curvature_of(metric, mesh.is_boundary_vertex), target, atol=1e-10)

    def test_flips_leave_no_edge_that_is_not_weighted_delaunay(self):
        mesh = noisy(shapes.sphere(3), 0.2)
        problem = problem_on(mesh, PackingProblem)
        u = np.random.default_rng(0).normal(0, 0.3, len(mesh.vertices))
        state = problem.evaluate(u)
        twin, weights = problem.triangulation.twin, state.cots
        assert state.broken == 0
        assert len(problem.records)
        assert (weights + weights[twin]).min() > -1e-9

    def test_a_free_boundary_keeps_its_lengths(self):
        mesh = TriangleMesh(*shapes.annulus())
        solution = ConeSolution(np.empty(0, dtype=np.int64), *np.zeros((2, len(mesh.vertices))))
        metric = ricci_flow(mesh, lengths_of(mesh), solution)
        assert not metric.solved.doubled
        border = np.flatnonzero(metric.solved.triangulation.twin < 0)
        np.testing.assert_allclose(
            np.sort(metric.solved.triangulation.length[border]),
            np.sort(lengths_of(mesh).ravel()[mesh.edge_halfedges[mesh.is_boundary_edge, 0]]),
            rtol=1e-12,
        )


class TestRoutes:
    def test_the_start_does_not_matter(self):
        mesh = TriangleMesh(*shapes.torus())
        target = cones_on(mesh, 4)
        one = exact_metric(mesh, lengths_of(mesh), target, kind=PackingProblem)
        start = np.random.default_rng(0).normal(0, 1, len(target))
        two = exact_metric(mesh, lengths_of(mesh), target, kind=PackingProblem, start=start)
        np.testing.assert_allclose(one.log_scale, two.log_scale, atol=1e-9)

    def test_small_circles_are_conformal_factors(self, monkeypatch):
        """The limit of no radii at all is vertex scaling (Luo 2004): another solver of ours."""
        mesh = TriangleMesh(*shapes.sphere(2))
        target = cones_on(mesh, 8)
        exact = exact_metric(mesh, lengths_of(mesh), target)
        gaps = []
        for part in (1e-1, 1e-2, 1e-3):
            monkeypatch.setattr(
                "coneflat.flat.ricci.packed_radii",
                lambda *given, part=part: part * packed_radii(*given),
            )
            metric = exact_metric(mesh, lengths_of(mesh), target, kind=PackingProblem)
            gaps.append(np.ptp(metric.log_scale - exact.log_scale))
        assert gaps[2] < 1e-3
        assert gaps[1] < gaps[0] / 2

    def test_with_and_without_flips_where_none_are_needed(self, monkeypatch):
        mesh = TriangleMesh(*shapes.sphere(3, bumps=0.0))
        target = np.full(len(mesh.vertices), 4 * np.pi / len(mesh.vertices))
        solution = ConeSolution(np.arange(len(target)), target, np.zeros(len(target)))
        one = ricci_flow(mesh, lengths_of(mesh), solution)
        without_flips(monkeypatch)
        two = ricci_flow(mesh, lengths_of(mesh), solution)
        assert len(one.solved.flips) == 0
        np.testing.assert_allclose(one.solved.log_scale, two.solved.log_scale, atol=1e-12)

    def test_without_flips_broken_triangles_are_counted(self, monkeypatch):
        mesh = noisy(shapes.sphere(3), 0.3)
        target = cones_on(mesh, 8)
        solution = ConeSolution(np.flatnonzero(target), target, np.zeros(len(target)))
        assert ricci_flow(mesh, lengths_of(mesh), solution).solved.converged
        without_flips(monkeypatch)
        with pytest.raises(
            errors.ConvergenceError, match=r"Ricci flow did not converge.* [1-9]\d* triangles? broke"
        ):
            ricci_flow(mesh, lengths_of(mesh), solution)
        metric = ricci_flow(mesh, lengths_of(mesh), solution, best_effort=True)
        assert metric.notes[0].startswith("The Ricci flow did not converge")


def test_a_plane_comes_back_as_it_is():
    points = np.random.default_rng(0).random((300, 2))
    vertices = np.column_stack([points, np.zeros(300)])
    for mesh in ((vertices, Delaunay(points).simplices), shapes.grid()):
        result = flatten(*mesh, cones="none", method="ricci")
        assert result.distortion.qc_max < 1 + 1e-7
        assert np.ptp(result.log_scale) < 1e-8


def test_what_can_be_unrolled_is_unrolled():
    for mesh in (shapes.cylinder(), shapes.box()):
        result = flatten(*mesh, method="ricci")
        assert result.distortion.qc_max < 1 + 1e-7
        assert result.distortion.area_std < 1e-8


def test_impossible_curvatures():
    mesh = TriangleMesh(*shapes.sphere(2))
    for value, message in ((2 * np.pi, "2 pi or more"), (np.pi, "must sum to")):
        target = np.zeros(len(mesh.vertices))
        target[[0, 9]] = value
        with pytest.raises(errors.CurvatureError, match=message):
            ricci_flow(mesh, lengths_of(mesh), ConeSolution(np.array([0, 9]), target, np.zeros(len(target))))


@pytest.mark.parametrize(
    ("name", "qc"),
    [("fandisk.obj", 1.0116), ("rocker-arm.obj", 1.0277), ("camelhead.off", None), ("knight.off", None)],
)
def test_real_models(shared, name, qc):
    result = flatten(shared(name), cones="greedy", method="ricci")
    assert result.solve.residual < 1e-10
    assert result.distortion.curvature_error_max < 1e-10
    assert result.distortion.flipped == 0
    if qc:
        assert result.distortion.qc_mean == pytest.approx(qc, abs=0.0005)


def test_circle_patterns_packings_and_factors_converge_to_one_metric(monkeypatch):
    """Three discretisations that share no equation; see benchmarks/convergence.py."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    monkeypatch.delitem(sys.modules, "convergence", raising=False)
    import convergence

    rows = [found for *_, found in convergence.measured(6000, 0.3, 0.4)]
    assert len(rows) == 3
    for coarse, fine in pairwise(rows):
        assert (fine[:, 0] < coarse[:, 0] / 2).all()
        assert (fine[:, 1] < coarse[:, 1] / 1.7).all()
    assert rows[-1][:, 0].max() < 1e-3
