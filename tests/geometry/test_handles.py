"""Rotations along handles, and cones of whole quanta."""

from __future__ import annotations

from itertools import cycle

import numpy as np
import pytest
import shapes

from coneflat import check_mesh, errors, flatten
from coneflat.geometry import corner_angles, edge_lengths
from coneflat.geometry.handles import difference_from_multiple, handle_loops, loop_holonomy
from coneflat.measures.seam_data import measure_rotations
from coneflat.metric import corrected, exact_metric

QUARTER = np.pi / 2


def turning_of(vertices, faces):
    mesh = check_mesh(vertices, faces).mesh
    return loop_holonomy(mesh), edge_lengths(mesh.vertices, mesh.faces)


@pytest.mark.parametrize(
    ("shape", "count"),
    [(shapes.sphere(2), 0), (shapes.torus(), 2), (shapes.genus(2), 4), (shapes.annulus(), 0)],
)
def test_there_are_two_loops_for_each_handle(shape, count):
    mesh = check_mesh(*shape).mesh
    loops = handle_loops(mesh)
    assert len(loops) == count
    pairs = mesh.edge_halfedges
    twin = np.full(3 * len(mesh.faces), -1)
    twin[pairs[:, 0]], twin[pairs[:, 1]] = pairs[:, 1], pairs[:, 0]
    for loop in loops:
        np.testing.assert_array_equal(twin[loop] // 3, np.roll(loop, -1) // 3)


def test_derivative_of_the_turning():
    turning, lengths = turning_of(*shapes.genus(2))
    rng = np.random.default_rng(1)
    change = rng.normal(size=len(turning.mesh.edges))
    step = 1e-6 * change[turning.mesh.halfedge_edges].reshape(-1, 3)
    after, before = (turning.signs @ corner_angles(lengths * np.exp(s * step)).ravel() for s in (1, -1))
    np.testing.assert_allclose((after - before) / 2e-6, turning.by_log_lengths(lengths) @ change, rtol=1e-5)


def test_a_flat_torus_does_not_turn():
    """A torus of a flat metric by lengths alone: all loops turn by full turns."""
    size = 6
    i, j = np.meshgrid(np.arange(size), np.arange(size), indexing="ij")
    at = lambda a, b: (a % size * size + b % size).ravel()  # noqa: E731
    faces = np.concatenate([
        np.stack([at(i, j), at(i + 1, j), at(i + 1, j + 1)], 1),
        np.stack([at(i, j), at(i + 1, j + 1), at(i, j + 1)], 1),
    ])  # fmt: skip
    rng = np.random.default_rng(0)
    mesh = check_mesh(rng.normal(size=(size * size, 3)), faces).mesh
    flat = np.tile([1.0, np.sqrt(2), 1.0], (size * size, 1))
    angles = corner_angles(
        np.concatenate([flat, flat[:, [0, 2, 1]]])[check_mesh(mesh.vertices, faces).face_origin]
    )
    turned = loop_holonomy(mesh).signs @ angles.ravel()
    np.testing.assert_allclose(difference_from_multiple(turned, 2 * np.pi), 0, atol=1e-9)


@pytest.mark.parametrize("name", ["sphere", "hill"])
def test_without_handles_seams_turn_by_quarters(name):
    shape = {"sphere": shapes.sphere(3), "hill": shapes.hill()}[name]
    result = flatten(*shape, quantise=QUARTER, boundary="straight")
    assert result.rotations.worst < 1e-8
    assert result.rotations.handles == ()
    np.testing.assert_allclose(difference_from_multiple(result.curvatures, QUARTER), 0, atol=1e-12)


@pytest.mark.parametrize("shape", [shapes.torus(), shapes.genus(2)])
def test_handles(shape):
    plain = flatten(*shape, quantise=QUARTER)
    assert plain.distortion.flipped == 0
    exact = flatten(*shape, quantise=QUARTER, correct_handles=True)
    assert exact.rotations.worst < 1e-8
    assert exact.distortion.curvature_error_max < 1e-9
    assert exact.distortion.seam_mismatch_max < 1e-9
    assert exact.distortion.qc_mean < plain.distortion.qc_mean + 0.5
    assert len(plain.rotations.handles) == len(exact.rotations.handles)
    assert any("handles were off" in note for note in exact.notes)


def test_corrections_end_at_rounding(monkeypatch):
    """Along many loops, rounding is larger than the tolerance."""
    noise = cycle([5e-11, -5e-11])
    monkeypatch.setattr(
        "coneflat.metric.corrected.difference_from_multiple",
        lambda angles, quantum: difference_from_multiple(angles, quantum) + next(noise),
    )
    exact = flatten(*shapes.genus(2), quantise=QUARTER, correct_handles=True)
    assert exact.rotations.worst < 1e-8


def test_corrections_that_need_more_steps_than_are_left_end_at_once(monkeypatch):
    solved, solve = [], exact_metric
    monkeypatch.setattr(corrected, "MAX_CHANGE", 1e-4)
    monkeypatch.setattr(
        "coneflat.metric.solve.exact_metric",
        lambda *arguments, **options: solved.append(0) or solve(*arguments, **options),
    )
    cones = flatten(*shapes.genus(2), quantise=QUARTER)
    solved.clear()
    curvatures = dict(zip(cones.cones.tolist(), cones.curvatures.tolist(), strict=True))
    with pytest.raises(errors.ConvergenceError, match=r"did not reach multiples of 0\.5 pi: they are off by"):
        flatten(*shapes.genus(2), cones=curvatures, quantise=QUARTER, correct_handles=True)
    assert len(solved) == 1


def test_measured_rotations_of_a_cut_square():
    """Two triangles side by side, one of them turned by 0.3."""
    mesh = check_mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]]).mesh
    points = mesh.vertices[mesh.faces][..., :2].copy()
    turn = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    points[1] = points[1] @ turn.T
    assert measure_rotations(mesh, points, QUARTER).worst == pytest.approx(0.3)
    assert measure_rotations(mesh, points, 0.3).worst == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize(
    ("options", "kind", "message"),
    [
        ({"quantise": 0}, errors.OptionError, "quantise must be from 0.0001 radians"),
        ({"quantise": 1.0}, errors.CurvatureError, "not a multiple"),
        ({"quantise": QUARTER, "cones": "greedy"}, errors.OptionError, "sparse"),
        ({"correct_handles": True}, errors.OptionError, "set quantise"),
        (
            {"quantise": QUARTER, "correct_handles": True, "method": "linear"},
            errors.OptionError,
            "correct_handles needs method 'exact'",
        ),
    ],
)
def test_invalid_combinations_are_refused(options, kind, message):
    with pytest.raises(kind, match=message):
        flatten(*shapes.sphere(2), **options)
