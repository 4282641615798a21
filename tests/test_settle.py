from __future__ import annotations

import numpy as np
import pytest
import shapes

from coneflat.flat.exact.metric import exact_metric
from coneflat.flat.exact.newton import ConformalProblem, find_scale
from coneflat.flat.exact.settle import FAR_OFF, GOAL, settled
from coneflat.geometry import edge_lengths
from coneflat.geometry.intrinsic import intrinsic_triangulation
from coneflat.input.validation import check_mesh

CONES = 8


def problem_on(bumps: float):
    """A sphere of 20,480 triangles whose curvature is to be at a few vertices, with the linear scale for a start."""
    vertices, faces = shapes.sphere(5)
    mesh = check_mesh(vertices * (1 + bumps * np.sin(5 * vertices[:, :1])), faces).mesh
    lengths, count = edge_lengths(mesh.vertices, mesh.faces), len(mesh.vertices)
    target = np.zeros(count)
    target[np.arange(CONES) * (count // CONES)] = 4 * np.pi / CONES
    triangulation = intrinsic_triangulation(mesh, lengths)
    pinned = np.arange(count) == 0
    full = np.full(count, 2 * np.pi)
    problem = ConformalProblem(triangulation, full, target, np.zeros(count, dtype=bool), pinned)
    problem.prepare(True)
    return mesh, lengths, target, problem


def linear_start(problem, target):
    """The log scale after one Newton step from none: right to first order."""
    start = problem.evaluate(np.zeros(len(target)))
    step, _ = problem.direction(start, True)
    return problem.evaluate(step)


@pytest.mark.parametrize("bumps", [0.0, 0.2])
def test_around_cones_nothing_is_missed_and_elsewhere_nothing_moves(bumps):
    _, _, target, problem = problem_on(bumps)
    start = linear_start(problem, target)
    far = np.abs(start.residual) > FAR_OFF
    assert 0 < far.sum() < len(far) / 50
    scale = settled(problem, start)
    moved = scale != start.place
    assert moved[far].all()
    assert moved.mean() < 0.12
    after = problem.evaluate(scale)
    assert np.abs(after.residual[moved]).max() <= GOAL
    # What is missed beside them grows by no more than was there before.
    assert after.largest < start.largest / 10


def test_the_metric_is_the_same_and_takes_fewer_steps():
    mesh, lengths, target, problem = problem_on(0.2)
    start = linear_start(problem, target).place
    _, without = find_scale(problem, start, 1e-10, 50)
    metric = exact_metric(mesh, lengths, target, start=start)
    plain = problem.last.place
    assert metric.converged
    assert metric.steps < without
    np.testing.assert_allclose(
        metric.log_scale - metric.log_scale.mean(), plain - plain.mean(), rtol=0, atol=1e-10
    )


def test_where_much_is_missed_or_nothing_it_is_left_to_newton():
    _, _, target, problem = problem_on(0.0)
    start = linear_start(problem, target)
    solved, _ = find_scale(problem, start.place, 1e-10, 50)
    assert settled(problem, solved) is None


def test_flips_of_settling_that_fails_are_taken_into_account(monkeypatch):
    _, _, target, problem = problem_on(0.2)
    start = linear_start(problem, target).place

    def flips_and_fails(problem, state):
        rough = state.place + 0.3 * np.sin(np.arange(len(state.place)))
        flipped = problem.flip(rough, np.arange(len(problem.triangulation.tail)))
        problem.record(flipped)
        assert len(flipped) > 100

    direction = problem.direction

    def checked_direction(here, exactly):
        cots = np.empty_like(here.cots)
        problem.sum_angles(here.place, np.empty(len(target)), cots)
        assert np.array_equal(here.cots, cots)
        return direction(here, exactly)

    monkeypatch.setattr(problem, "direction", checked_direction)
    found, _ = find_scale(problem, start, 1e-10, 50, flips_and_fails)
    assert found.largest < 1e-10
