"""Newton's method on a convex function that is given by its slope."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..._arrays import FloatArray
from ...errors import MetricError

# Gradient below which nothing is left to gain: the rounding of a sum of some angles.
GOAL = 1e-12
# Part of the gradient by which a step must change it.
NO_CHANGE = 1e-6
# Halvings of a step after which it is taken for rounding.
HALVINGS = 40


class Convex(Protocol):
    """A convex function of (n,) variables."""

    def downhill(self, place: FloatArray) -> FloatArray:
        """Return (n,) minus the gradient at a place."""
        ...

    def newton_step(self, place: FloatArray, residual: FloatArray) -> FloatArray:
        """Return (n,) a direction that goes downhill, where minus the gradient is the residual."""
        ...


@dataclass(frozen=True, eq=False)
class Minimum:
    """Where the gradient was least.

    Attributes:
        place: (n,) the variables.
        residual: (n,) minus the gradient there.
        steps: Newton steps.
    """

    place: FloatArray
    residual: FloatArray
    steps: int

    @property
    def largest(self) -> float:
        """The largest part of the gradient."""
        return float(np.abs(self.residual).max(initial=0.0))


def descend(function: Convex, start: FloatArray, tolerance: float, max_steps: int) -> Minimum:
    """Return the place of least gradient that Newton's method reaches.

    As in `coneflat.flat.exact.newton`, a step is halved while the function rises at its end: what is left falls by half
    of what was to be had. One that goes beyond the minimum is taken if it halves the least gradient so far.
    Once below the tolerance, the method goes on while steps halve the gradient.
    """
    here = best = Minimum(start, function.downhill(start), 0)
    while best.largest > GOAL and here.steps < max_steps:
        try:
            step = function.newton_step(here.place, here.residual)
        except MetricError:  # singular in double precision: the best so far has to do
            break
        found = _search_line(function, here, step, best.largest)
        if found is None:
            break
        changed = np.abs(found.residual - here.residual).max()
        here, before = found, best.largest
        if here.largest < before:
            best = here
        if before <= tolerance and here.largest > before / 2:
            break
        if changed <= NO_CHANGE * here.largest:  # a slope without an end
            break
    return Minimum(best.place, best.residual, here.steps)


def _search_line(function: Convex, here: Minimum, step: FloatArray, least: float) -> Minimum | None:
    if not np.isfinite(step).all():
        return None
    length = 1.0
    for _ in range(HALVINGS):
        place = here.place + length * step
        trial = Minimum(place, function.downhill(place), here.steps + 1)
        if float(trial.residual @ step) >= 0 or trial.largest <= least / 2:
            return trial
        length /= 2
    return None
