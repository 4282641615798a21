"""Discrete Ricci flow: angles and their derivatives, flips, known metrics, other routes to the same answer."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from scipy.spatial import Delaunay
from shapes import laid_out, lengths_of

from coneflat import TriangleMesh, errors
from coneflat.apps.peers import flatten_by, ricci
from coneflat.apps.peers.ricci import Packing, packed_radii, ricci_flow
from coneflat.geometry import edge_lengths
from coneflat.metric.exact import exact_metric
from coneflat.stages import ConeSolution


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


def packing_on(mesh, target=None):
    n = len(mesh.vertices)
    target = np.zeros(n) if target is None else target
    pinned = np.arange(n) == (-1 if mesh.is_boundary_vertex.any() else 0)
    return Packing.of(mesh, lengths_of(mesh), target, mesh.is_boundary_vertex, pinned)


def without_flips(monkeypatch):
    """Packings on triangles as they are, as first published; a minimum may lie where some break."""
    monkeypatch.setattr(ricci, "flip_to_weighted_delaunay", lambda *_, **__: np.empty(0, dtype=np.int64))


def solution_of(target):
    return ConeSolution(np.flatnonzero(target), target, np.zeros(len(target)))


class TestPacking:
    @pytest.mark.parametrize("shape", [shapes.sphere(1), shapes.hill(5, 4)])
    def test_the_newton_step_undoes_a_change(self, shape, monkeypatch):
        """The Hessian is the derivative of the curvature."""
        without_flips(monkeypatch)
        mesh = noisy(shape, 0.1)
        packing, n = packing_on(mesh), len(mesh.vertices)
        free = ~(packing.border | packing.pinned)
        u = np.random.default_rng(0).normal(0, 0.1, n)
        state = packing.evaluate(u)
        assert state.broken == 0
        change = np.where(free, 1e-6 * np.random.default_rng(1).normal(size=n), 0.0)
        ends = [packing.evaluate(u + sign * change).residual for sign in (-0.5, 0.5)]
        state = packing.evaluate(u)
        state.residual = ends[0] - ends[1]
        step, _ = packing.direction(state, True)
        np.testing.assert_allclose(step, change, atol=1e-11)


class TestConvergence:
    @pytest.mark.parametrize("seed", range(2))
    def test_random_cones_on_a_sphere(self, seed):
        mesh = noisy(shapes.sphere(3), 0.2, seed)
        target = cones_on(mesh, 12, seed)
        metric = ricci_flow(mesh, lengths_of(mesh), solution_of(target))
        assert metric.statistics.euclidean_flips
        assert metric.statistics.residual < 1e-10
        np.testing.assert_allclose(laid_out(metric).curvature, target, atol=1e-9)


class TestRoutes:
    def test_small_circles_are_conformal_factors(self, monkeypatch):
        """The limit of no radii at all is vertex scaling (Luo 2004): another solver of ours."""
        mesh = TriangleMesh(*shapes.sphere(2))
        target = cones_on(mesh, 8)
        exact = exact_metric(mesh, lengths_of(mesh), target).straight().sides
        gaps = []
        for part in (1e-1, 1e-2, 1e-3):
            monkeypatch.setattr(ricci, "packed_radii", lambda *given, part=part: part * packed_radii(*given))
            sides = ricci_flow(mesh, lengths_of(mesh), solution_of(target)).triangles.sides
            gaps.append(np.ptp(np.log(np.abs(sides) / np.abs(exact))))
        assert gaps[2] < 5e-3
        assert gaps[1] < gaps[0] / 2


def test_a_plane_comes_back_as_it_is():
    points = np.random.default_rng(0).random((300, 2))
    vertices = np.column_stack([points, np.zeros(300)])
    for mesh in ((vertices, Delaunay(points).simplices), shapes.grid()):
        result = flatten_by("ricci", *mesh, cones="none")
        assert result.distortion.qc_max < 1 + 1e-7
        assert np.ptp(result.log_scale) < 1e-8


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
    result = flatten_by("ricci", shared(name), cones="greedy")
    assert result.solve.residual < 1e-10
    assert result.distortion.curvature_error_max < 1e-10
    assert result.distortion.flipped == 0
    if qc:
        assert result.distortion.qc_mean == pytest.approx(qc, abs=0.0005)
