"""Fields of spikes: heights and radii with noise of many edge lengths."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

import coneflat
from coneflat import errors
from coneflat.base.text import error_text
from coneflat.geometry import edge_lengths
from coneflat.metric.exact import exact_metric


def spiky_sphere(rounds: int, amplitude: float, seed: int = 0):
    """A sphere whose radii are random over orders of magnitude."""
    vertices, faces = shapes.sphere(rounds, bumps=0)
    noise = np.random.default_rng(seed).normal(size=len(vertices))
    return vertices * np.exp(amplitude * noise)[:, None], faces


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_greedy_cones_on_spikes_have_an_exact_metric(seed):
    vertices, faces = spiky_sphere(2, 2.0, seed)
    result = coneflat.flatten(vertices, faces, cones="greedy")
    assert result.report()["residual"] < 1e-10


def test_a_first_guess_that_is_far_off_does_not_matter():
    mesh = coneflat.check_mesh(*shapes.sphere(2)).mesh
    lengths = edge_lengths(mesh.vertices, mesh.faces)
    target = np.full(len(mesh.vertices), 4 * np.pi / len(mesh.vertices))
    plain = exact_metric(mesh, lengths, target)
    for size in (300.0, 1e4):
        start = size * np.random.default_rng(1).normal(size=len(target))
        again = exact_metric(mesh, lengths, target, start=start)
        assert again.converged
        assert np.allclose(again.log_scale, plain.log_scale, atol=1e-8)


def test_a_refusal_never_speaks_of_nan():
    assert error_text(np.nan) == error_text(np.inf) == "off by more than double precision can represent"
    assert error_text(0.25) == "off by 0.25 rad"
    messages = []
    for seed in range(3):
        vertices, faces = spiky_sphere(1, 40.0, seed)
        try:
            coneflat.flatten(vertices, faces, cones="greedy")
        except errors.ConeflatError as error:
            messages.append(str(error))
    assert not [message for message in messages if "nan" in message or "inf" in message]


@pytest.mark.parametrize("seed", range(2))
def test_a_field_of_spikes_with_a_round_boundary_is_flattened(seed):
    """Where the linear scale makes one side nearly all of the boundary, no metric has the curvature it asks for."""
    vertices, faces = shapes.grid(10, 10)
    vertices[:, 2] = np.random.default_rng(seed).normal(size=len(vertices))  # ten edges
    result = coneflat.flatten(vertices, faces, boundary="disk")
    assert result.report()["residual"] < 1e-10
