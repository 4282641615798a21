"""Newton's method with a line search for convex functions that are given by their gradients."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, TypeVar

import numpy as np

from ..base.arrays import FloatArray
from ..base.progress import begin_step
from ..errors import MetricError

# Relative size of a step that does not change the variables in floating point.
ROUNDING = float(np.finfo(np.float64).eps)
# Fraction of the linear decrease that a step must attain where function values are compared (Armijo), and largest
# number of halvings of a step. After them the step is below 1e-9 of the first trial and counts as rounding.
ARMIJO, HALVINGS = 1e-4, 30


@dataclass(eq=False)
class Point:
    """A point of a function: the variables and the negative gradient.

    Attributes:
        variables: (n,) the variables.
        residual: (n,) minus the gradient.
        is_admissible: False if the point must not be accepted as a step, as the function is not valid there.
    """

    variables: FloatArray
    residual: FloatArray
    is_admissible: bool = True

    @cached_property
    def largest(self) -> float:
        """The largest absolute component of the gradient; infinite if it overflows."""
        largest = float(np.abs(self.residual).max(initial=0.0))
        return largest if np.isfinite(largest) else np.inf


P = TypeVar("P", bound=Point)


class Convex(Protocol[P]):
    """A convex function of (n,) variables."""

    def evaluate(self, variables: FloatArray) -> P:
        """Return the point with given variables (n,)."""
        ...

    def direction(self, point: P, exactly: bool) -> tuple[FloatArray, bool]:
        """Return (n,) the Newton direction, and whether it was computed by a direct solve.

        exactly: require a direct solve.

        Raises:
            MetricError: the Hessian is singular in double precision.
        """
        ...


@dataclass(frozen=True)
class Limits:
    """Stopping criteria of Newton's method.

    Attributes:
        tolerance: gradient that counts as converged. Below it, the method goes on as long as steps halve the gradient.
        steps: largest number of Newton steps.
        goal: gradient at the level of rounding, at which the method stops.
        halvings: largest number of halvings of a step; below the tolerance, steps are not halved.
        largest_step: largest change of a variable in one step.
    """

    tolerance: float
    steps: int
    goal: float
    halvings: int
    largest_step: float = np.inf


def minimise(function: Convex[P], start: P, limits: Limits) -> tuple[P, int]:
    """Return the point with the smallest gradient that Newton's method reaches, and the number of steps.

    Args:
        function: the convex function.
        start: the first point.
        limits: the stopping criteria.

    Returns:
        The point, and the number of Newton steps.

    Notes:
        The line search uses the slope of the function along the step, not its values: near the minimum, the gain of a
        step is smaller than the rounding of the values. It halves the step while the slope is positive. As the
        function is convex, a step with a negative slope ends before the minimum along the line. The function has then
        decreased, by at least half of the possible decrease if the step of twice the length went beyond the minimum.
        The slope is negative at length 0 and continuous, so some length is accepted. A step beyond the minimum is
        accepted only if it halves the smallest gradient so far, which can happen only finitely often. Therefore the
        search neither stalls nor cycles.
    """
    point = best = start
    steps, exactly = 0, False
    while best.largest > limits.goal and point.is_admissible and steps < limits.steps:
        steps += 1
        is_reached = best.largest <= limits.tolerance
        try:
            step, is_exact = function.direction(point, exactly)
        except MetricError:  # singular in double precision: return the best point so far
            break
        if not is_reached and np.abs(step).max() <= ROUNDING * np.abs(point.variables).max():
            break
        halvings = 0 if is_reached else limits.halvings
        accepted = _search_line(function, point, step, best.largest, halvings, limits.largest_step)
        if accepted is None:
            if is_exact or is_reached:
                break
            exactly = True
            continue
        exactly = False
        is_halved = accepted.largest <= best.largest / 2
        point = accepted
        if point.largest < best.largest:
            best = point
        if best.largest <= limits.tolerance and not is_halved:
            break
    return best, steps


def _search_line(
    function: Convex[P], point: P, step: FloatArray, best_gradient: float, halvings: int, largest_step: float
) -> P | None:
    """Return the first accepted point along a step, or None."""
    reach = float(np.abs(step).max(initial=0.0))
    if not np.isfinite(reach) or reach == 0.0:
        return None
    length = min(1.0, largest_step / reach)
    for _ in range(halvings + 1):
        variables = point.variables + length * step
        if np.array_equal(variables, point.variables):  # shorter than rounding
            return None
        begin_step()
        trial = function.evaluate(variables)
        is_short = float(trial.residual @ step) >= 0
        if (is_short or trial.largest <= best_gradient / 2) and trial.is_admissible:
            return trial
        length /= 2
    return None
