"""Newton's method with a line search, for convex functions that are given by their gradients."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, TypeVar

import numpy as np

from ..base.arrays import FloatArray
from ..base.progress import check_cancelled
from ..errors import MetricError

# A step of this share of the variables is lost in the sum.
ROUNDING = 2.0**-52
# Part of the slope that a step must gain at least where values are compared (Armijo), and halvings of a step after
# which it is taken for rounding: the change is then below 1e-9 of the first trial.
ARMIJO, HALVINGS = 1e-4, 30


@dataclass(eq=False)
class Point:
    """The variables of a function, and how it falls there.

    Attributes:
        place: (n,) the variables.
        residual: (n,) minus the gradient.
        is_admissible: False where the function does not stand for what is sought.
    """

    place: FloatArray
    residual: FloatArray
    is_admissible: bool = True

    @cached_property
    def largest(self) -> float:
        """The largest part of the gradient; infinite where it is beyond double precision."""
        largest = float(np.abs(self.residual).max(initial=0.0))
        return largest if np.isfinite(largest) else np.inf


P = TypeVar("P", bound=Point)


class Convex(Protocol[P]):
    """A convex function of (n,) variables."""

    def evaluate(self, place: FloatArray) -> P:
        """Return the point at a place."""
        ...

    def direction(self, here: P, exactly: bool) -> tuple[FloatArray, bool]:
        """Return (n,) the Newton direction, and whether it is as exact as can be; if `exactly`, it must be.

        Raises:
            MetricError: the Hessian is singular in double precision.
        """
        ...


@dataclass(frozen=True)
class Limits:
    """When to stop.

    Attributes:
        tolerance: gradient that counts as none. The method goes on below it as long as steps halve the gradient.
        steps: Newton steps at most.
        goal: gradient below which nothing is left to gain but rounding.
        halvings: of a step, at most.
        halvings_below: the same once the gradient is below the tolerance.
        largest_step: largest change of a variable in one step.
        least_change: part of the gradient that a step must change; less is a slope without an end.
    """

    tolerance: float
    steps: int
    goal: float
    halvings: int
    halvings_below: int = 0
    largest_step: float = np.inf
    least_change: float = 0.0


def minimise(function: Convex[P], start: P, limits: Limits) -> tuple[P, int]:
    """Return the point of least gradient that Newton's method reaches, and the number of steps.

    The line search looks at the slope of the function along the step, not at its values, whose rounding hides what a
    step gains near the end. It halves the step while the slope is positive. The function being convex, a step with a
    slope below zero stops short of the minimum along the line, so the function has fallen, and by at least half of
    what was to be had when the step before it, twice as long, went beyond. The slope is negative at length 0 and
    continuous: some length is accepted. A step beyond the minimum is taken only if it halves the least gradient so
    far, which can happen but finitely often. So the search can neither stall nor cycle.
    """
    here = best = start
    steps, exactly = 0, False
    while best.largest > limits.goal and here.is_admissible and steps < limits.steps:
        steps += 1
        is_reached = best.largest <= limits.tolerance
        try:
            step, is_exact = function.direction(here, exactly)
        except MetricError:  # singular in double precision: the best so far has to do
            break
        if not is_reached and np.abs(step).max() <= ROUNDING * np.abs(here.place).max():
            break
        halvings = limits.halvings_below if is_reached else limits.halvings
        found = _search_line(function, here, step, best.largest, halvings, limits.largest_step)
        if found is None:
            if is_exact or is_reached:
                break
            exactly = True
            continue
        exactly = False
        is_halved = found.largest <= best.largest / 2
        changed = np.abs(found.residual - here.residual).max()
        here = found
        if here.largest < best.largest:
            best = here
        if best.largest <= limits.tolerance and not is_halved:
            break
        if limits.least_change and changed <= limits.least_change * here.largest:
            break
    return best, steps


def _search_line(
    function: Convex[P], here: P, step: FloatArray, least: float, halvings: int, largest_step: float
) -> P | None:
    """Return the first point accepted; None if there is none."""
    reach = float(np.abs(step).max(initial=0.0))
    if not np.isfinite(reach) or reach == 0.0:
        return None
    length = min(1.0, largest_step / reach)
    for _ in range(halvings + 1):
        place = here.place + length * step
        if np.array_equal(place, here.place):  # shorter than rounding
            return None
        check_cancelled()
        found = function.evaluate(place)
        is_short = float(found.residual @ step) >= 0
        if (is_short or found.largest <= least / 2) and found.is_admissible:
            return found
        length /= 2
    return None
