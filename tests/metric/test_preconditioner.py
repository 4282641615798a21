"""Conjugate gradients with an inverse that is known nearly: the same solution on another way."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from spheres import cones_on, lengths_of, random_sphere

from coneflat.geometry import cotangent_laplacian, cotangents
from coneflat.metric.exact import exact_metric
from coneflat.metric.hessian import conjugate_gradients, corrected
from coneflat.stages import LaplacianInverse


def inverse_of(mesh, break_even, is_good):
    """The inverse of the Laplacian of the input, or nothing like it, and the list of its right-hand sides."""
    laplacian = cotangent_laplacian(mesh.faces, cotangents(lengths_of(mesh)), len(mesh.vertices))
    inverse = np.linalg.pinv(laplacian.toarray()) if is_good else np.eye(len(mesh.vertices))
    calls = []

    def solve(right):
        calls.append(right)
        return inverse @ right

    return LaplacianInverse(solve, laplacian, np.zeros(len(mesh.vertices), dtype=bool), break_even), calls


@pytest.mark.parametrize(("break_even", "is_good"), [(60, True), (4, True), (60, False), (1, False)])
def test_a_preconditioner_does_not_change_the_result(break_even, is_good):
    mesh = random_sphere(300, 7)
    target = cones_on(mesh, np.full(4, np.pi))
    expected = exact_metric(mesh, lengths_of(mesh), target)
    inverse, calls = inverse_of(mesh, break_even, is_good)
    metric = exact_metric(mesh, lengths_of(mesh), target, preconditioner=inverse)
    assert metric.converged
    assert metric.residual < 1e-12
    assert calls
    assert metric.log_scale == pytest.approx(expected.log_scale, abs=1e-9)


def test_an_inverse_is_corrected_for_the_rows_that_differ():
    mesh = random_sphere(400, 3)
    lengths = lengths_of(mesh)
    inverse, made = inverse_of(mesh, 60, True)
    phi = np.zeros(400)
    phi[::50] = 0.15  # the triangles around change
    scaled = lengths * np.exp(
        (phi[np.roll(mesh.faces, -1, axis=1)] + phi[np.roll(mesh.faces, -2, axis=1)]) / 2
    )
    matrix = cotangent_laplacian(mesh.faces, cotangents(scaled), 400)
    matrix.sort_indices()
    held = np.zeros(400, dtype=bool)
    right = np.random.default_rng(0).normal(size=400)
    right -= right.mean()

    def calls(preconditioner):
        made.clear()
        solution = conjugate_gradients(matrix, right, preconditioner, 1e-12)
        assert matrix @ solution == pytest.approx(right, abs=1e-9)
        return len(made)

    improved = corrected(inverse, matrix, held)
    around = np.unique(mesh.faces[(mesh.faces % 50 == 0).any(axis=1)])
    before, after = (
        np.abs(matrix @ approximate.solve(right) - right) < 1e-9 for approximate in (inverse, improved)
    )
    gained = np.flatnonzero(after & ~before)
    assert len(gained) == 40
    assert set(gained) <= set(around)
    # It is symmetric, or conjugate gradients would go astray.
    first, second = np.random.default_rng(1).normal(size=(2, 400))
    first, second = first - first.mean(), second - second.mean()
    assert first @ improved.solve(second) == pytest.approx(second @ improved.solve(first), rel=1e-9)
    assert calls(improved) < 0.6 * calls(inverse)
    # Nothing differs, or what differs is held.
    assert corrected(inverse, inverse.laplacian, held) is inverse
    assert corrected(inverse, matrix, ~held) is inverse


def test_conjugate_gradients_report_failure():
    mesh = random_sphere(60, 1)
    inverse, _ = inverse_of(mesh, 60, True)
    laplacian = inverse.laplacian
    right = np.random.default_rng(0).normal(size=60)
    right -= right.mean()
    solution = conjugate_gradients(laplacian, right, inverse, 1e-10)
    assert laplacian @ solution == pytest.approx(right, abs=1e-9)
    assert conjugate_gradients(laplacian, np.full(60, np.nan), inverse, 1e-10) is None
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert conjugate_gradients(1e200 * laplacian, 1e300 * right, inverse, 1e-10) is None
    assert conjugate_gradients(laplacian, right, inverse_of(mesh, 5, False)[0], 1e-10) is None
