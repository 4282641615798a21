"""Options that make no sense, or are extreme, end in a result or in an OptionError, never in anything else."""

from __future__ import annotations

import inspect
import math

import numpy as np
import pytest
import shapes
from stored_meshes import at_hand

import coneflat
from coneflat import errors
from coneflat.base.defaults import MIN_QUANTUM
from coneflat.io import as_input
from coneflat.seams import find_seams

# What no option is.
ODD = (
    np.zeros((2, 3)),
    np.array([1.0, 2.0, 3.0, 4.5]),
    np.array(["a"]),
    "no such thing",
    "",
    b"bytes",
    1j,
    10**400,
    object(),
    [[0, 1], [2]],
    ["a"],
    {"a": 1},
    {0: "a"},
)
# What is right for some options, and extreme or wrong for others.
FITTING = (math.nan, math.inf, -math.inf, -1, 0, True, None, 1e308, [], (), {}, [0], {0: 1.0}, [[0, 1]])
NAMES = [
    name
    for name, parameter in inspect.signature(coneflat.flatten).parameters.items()
    if parameter.kind is parameter.KEYWORD_ONLY
]


@pytest.mark.parametrize("name", NAMES)
def test_an_option_of_the_wrong_kind_is_refused_by_name(name):
    vertices, faces = shapes.hill(5, 4)
    for value in ODD:
        with pytest.raises(errors.ConeflatError) as caught:
            coneflat.flatten(vertices, faces, **{name: value})
        assert "\n" not in str(caught.value)
        assert len(str(caught.value)) < 400


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_extreme_values_lead_to_a_result_or_to_one_of_our_errors(name):
    vertices, faces = shapes.hill(5, 4)
    for value in FITTING:
        try:
            result = coneflat.flatten(vertices, faces, **{name: value})
        except errors.ConeflatError:
            continue
        assert np.isfinite(result.uv).all()


@pytest.mark.parametrize("shape", [shapes.grid, shapes.cylinder, lambda: shapes.grid(1, 1)])
@pytest.mark.parametrize("count", [0, 1, 2, 5])
def test_a_number_of_cones_on_a_flat_surface(shape, count):
    vertices, faces = shape()
    result = coneflat.flatten(vertices, faces, cone_count=count)
    assert len(result.cones) <= count
    assert result.report()["qc_max"] < 1 + 1e-6
    assert coneflat.find_cones(vertices, faces, cone_count=count).distortion < 1e-6


def test_the_curve_of_a_flat_surface_is_one_point():
    curve = coneflat.cone_curve(*shapes.grid(8, 6))
    assert curve.counts.tolist() == [0]
    assert curve.distortions[0] < 1e-6


@pytest.mark.parametrize("scale", [1e308, 1e-300, 2.0**-1074])
def test_weights_count_by_their_ratios_whatever_their_size(scale):
    vertices, faces = shapes.sphere(1)
    weights = np.ones(len(vertices))
    plain = coneflat.flatten(vertices, faces, charts="atlas")
    for name in ("weights", "seam_weights"):
        weighted = coneflat.flatten(vertices, faces, charts="atlas", **{name: scale * weights})
        assert np.allclose(weighted.uv, plain.uv, atol=1e-9)


def test_weights_over_six_hundred_orders_of_magnitude_do_no_harm():
    vertices, faces = shapes.sphere(1)
    for seed in range(3):
        spread = 10.0 ** np.random.default_rng(seed).uniform(-300, 300, len(vertices))
        result = coneflat.flatten(
            vertices, faces, weights=spread, seam_weights=spread, hide_seams=10, sharp_angle=3.0
        )
        assert np.isfinite(result.uv).all()
    alone = np.zeros(len(vertices))
    alone[3] = 1.0
    assert np.isfinite(coneflat.flatten(vertices, faces, weights=alone).report()["area_distortion_linear"])


def test_costs_of_seams_that_overflow_when_summed():
    mesh = coneflat.check_mesh(*shapes.sphere(1)).mesh
    costs = np.linalg.norm(np.diff(mesh.vertices[mesh.edges], axis=1)[:, 0], axis=1)
    cones = np.array([0, 5, 11])
    plain = find_seams(mesh, cones, costs)
    huge = np.ldexp(costs, 1020)
    assert np.array_equal(find_seams(mesh, cones, huge), plain)
    for bad in (-costs, 0 * costs, np.full(len(costs), np.nan), costs[1:]):
        with pytest.raises(errors.OptionError, match="positive numbers"):
            find_seams(mesh, cones, bad)


@pytest.mark.parametrize("quantum", [1e-20, 1e-300, MIN_QUANTUM / 2, math.inf, -1.0, 7.0])
def test_a_quantum_outside_its_bounds_is_refused(quantum):
    with pytest.raises(errors.OptionError, match="quantise must be from 0.0001 radians"):
        coneflat.flatten(*shapes.sphere(1), quantise=quantum)


def test_a_quantum_that_is_not_a_number_is_refused():
    with pytest.raises(errors.OptionError, match="quantise must be a number, got nan"):
        coneflat.flatten(*shapes.sphere(1), quantise=math.nan)


def test_the_least_quantum_gives_its_multiples():
    quantum = 2 * math.pi / 60_000
    result = coneflat.flatten(*shapes.sphere(2), quantise=quantum, max_cone_angle=None)
    units = result.curvatures / quantum
    assert np.allclose(units, np.round(units), atol=1e-5)


def test_infinite_angles_are_no_bound():
    vertices, faces = shapes.torus(10, 8)
    plain = coneflat.flatten(vertices, faces, max_cone_angle=None)
    for bound in (1e300, math.inf, "none"):
        assert np.array_equal(coneflat.flatten(vertices, faces, max_cone_angle=bound).uv, plain.uv)
    with pytest.raises(errors.OptionError, match="smallest cone angle must be positive and at most 1000 pi"):
        coneflat.flatten(vertices, faces, min_cone_angle=1e300, max_cone_angle=None)


def test_the_length_of_up_means_nothing():
    vertices, faces = shapes.sphere(1)
    plain = coneflat.flatten(vertices, faces, charts="atlas", up=(0, 0, 1), hide_seams=1)
    for length in (1e-300, 1e300):
        again = coneflat.flatten(vertices, faces, charts="atlas", up=(0, 0, length), hide_seams=1)
        assert np.array_equal(again.uv, plain.uv)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rocker-arm.obj", *at_hand("face.obj", "stanford-bunny.obj")])
@pytest.mark.parametrize("size", [51, 301])
def test_a_number_of_cones_on_a_piece_of_a_scan(shared, name, size):
    model = as_input(shared(name))
    vertices, faces = model.vertices, np.asarray(model.faces)[:size]
    for count in (0, 1, 4):
        result = coneflat.flatten(vertices, faces, cone_count=count, repair=True)
        assert np.isfinite(result.uv).all()
    curve = coneflat.cone_curve(vertices, faces, most=5, repair=True)
    assert (np.diff(curve.distortions) < 0).all()
