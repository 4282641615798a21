"""Newton's method with a line search on convex functions whose minima are known."""

from __future__ import annotations

import numpy as np
import pytest

from coneflat.errors import MetricError
from coneflat.linalg.newton import Limits, Point, minimise

LIMITS = Limits(tolerance=1e-9, steps=50, goal=1e-13, halvings=30)


class LogCosh:
    """The sum of log cosh (x - c): quadratic near c, with a slope of one far off, where full steps run away."""

    def __init__(self, centre):
        self.centre = centre
        self.asked = []

    def evaluate(self, place):
        return Point(place, -np.tanh(place - self.centre))

    def direction(self, point, exactly):
        self.asked.append(exactly)
        return point.residual * np.cosh(point.variables - self.centre) ** 2, True


class Flawed(LogCosh):
    """The same, with directions that lead uphill unless exact ones are asked for."""

    def direction(self, point, exactly):
        step, _ = super().direction(point, exactly)
        return (step, True) if exactly else (-step, False)


def test_a_quadratic_takes_one_step():
    matrix, centre = np.array([[3.0, 1.0], [1.0, 2.0]]), np.array([0.5, -4.0])

    class Quadratic:
        def evaluate(self, place):
            return Point(place, matrix @ (centre - place))

        def direction(self, point, exactly):
            return np.linalg.solve(matrix, point.residual), True

    problem = Quadratic()
    minimum, steps = minimise(problem, problem.evaluate(np.zeros(2)), LIMITS)
    np.testing.assert_allclose(minimum.variables, centre, atol=1e-14)
    assert steps <= 2


@pytest.mark.parametrize("offset", [0.1, 2.0, 8.0])
def test_the_minimum_is_found_although_full_steps_diverge(offset):
    problem = LogCosh(np.array([1.0, 3.0, -2.0]))
    minimum, _ = minimise(problem, problem.evaluate(problem.centre + offset), LIMITS)
    np.testing.assert_allclose(minimum.variables, problem.centre, atol=1e-9)
    assert minimum.largest <= 1e-9


def test_ascent_directions_are_replaced_by_direct_solves():
    problem = Flawed(np.zeros(2))
    minimum, _ = minimise(problem, problem.evaluate(np.array([0.6, -0.4])), LIMITS)
    assert minimum.largest <= 1e-9
    assert problem.asked[:2] == [False, True]


def test_steps_are_not_longer_than_allowed():
    problem = LogCosh(np.zeros(1))
    places = []
    evaluate = problem.evaluate
    problem.evaluate = lambda place: places.append(place[0]) or evaluate(place)
    minimise(problem, problem.evaluate(np.array([5.0])), Limits(1e-9, 60, 1e-13, 30, largest_step=0.5))
    assert np.abs(np.diff(places)).max() <= 0.5 + 1e-12
    assert places[-1] == pytest.approx(0, abs=1e-9)


def test_a_singular_hessian_ends_at_the_best_point():
    class Singular(LogCosh):
        def direction(self, point, exactly):
            raise MetricError("singular")

    problem = Singular(np.zeros(1))
    start = problem.evaluate(np.ones(1))
    assert minimise(problem, start, LIMITS)[0] is start


def test_inadmissible_points_are_not_accepted():
    class Half(LogCosh):
        def evaluate(self, place):
            return Point(place, -np.tanh(place - self.centre), bool(place[0] > 0.1))

    problem = Half(np.zeros(1))
    minimum, _ = minimise(problem, problem.evaluate(np.array([0.8])), LIMITS)
    assert 0.1 < minimum.variables[0] < 0.8
