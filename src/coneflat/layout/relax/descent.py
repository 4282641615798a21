"""Newton's method on the distortion of triangles, none of which is ever flipped."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...base.arrays import ComplexArray, FloatArray
from ...errors import MetricError
from ...linalg import Factor, factorize
from ...linalg.newton import ARMIJO, HALVINGS
from .elements import SHORT_OF_FLAT, Elements
from .energies import Energy
from .motions import Motions

# Part of the energy, and of the way to where the constraints hold, that is lost in a sum.
RELATIVE_ROUNDING = 1e-12
# Where the constraints hold is out of reach after a step that goes less than this part of the way.
MIN_PROGRESS = 1e-3
# Part of the way that a step goes at most where seams and sides have to turn: on a longer one, sides fold over.
TURNING_STRIDE = 0.1
# Once less than this part of the unknowns is in parts that are not at their least, these go on alone.
MIN_ACTIVE_SHARE = 0.6


@dataclass(frozen=True, eq=False)
class Descent:
    """Where Newton's method has come to.

    Attributes:
        points: (u,) the places.
        before, after: the energy.
        steps: Newton steps.
        remaining: part of the way to where the constraints hold that is left: 0 when they do.
    """

    points: ComplexArray
    before: float
    after: float
    steps: int
    remaining: float


def descend(
    points: ComplexArray,
    motions: Motions,
    elements: Elements,
    energy: Energy,
    tolerance: float,
    steps: int,
    tell: Callable[[int, float], bool | None] | None = None,
    stride: float = 1.0,
) -> Descent:
    """Return points of less energy, as far as Newton's method comes.

    Parts that no triangle connects take steps of their own lengths. Where constraints do not hold, all take one, which
    goes as far towards them as triangles allow (an infeasible start: Boyd and Vandenberghe 2004, Section 10.3).

    Args:
        points: (u,) where no triangle that moves is flipped.
        motions: how they move.
        elements: the triangles that do.
        energy: what is minimised.
        tolerance: part of its energy above the least that a step must promise to gain for a part to go on.
        steps: at most.
        tell: called with the number of steps and the energy; True ends it.
        stride: part of the way to where constraints hold that a step goes at most.

    Raises:
        MetricError: the Hessian is singular in double precision.
    """
    remaining = 1.0 if motions.has_offset else 0.0
    together = motions.has_offset
    places = points
    maps = elements.maps(places)
    part = np.zeros_like(elements.part) if together else elements.part
    parts = 1 if together else elements.parts
    unknown_part = np.zeros_like(elements.unknown_part) if together else elements.unknown_part

    def sums(values: FloatArray) -> FloatArray:
        return np.bincount(part, values, parts).astype(np.float64)

    here = sums(elements.energies(energy, maps))
    before, done, least = float(here.sum()), 0.0, energy.least * sums(elements.weight)
    total, unknowns = np.zeros(elements.count + 1), np.arange(elements.count)
    active = np.ones(parts, dtype=bool)
    factor: Factor | None = None
    taken = 0
    while taken < steps and ((elements.count and active.any()) or remaining > RELATIVE_ROUNDING):
        if not together and elements.count and active[unknown_part].mean() < MIN_ACTIVE_SHARE:
            done += float(here[~active].sum())
            elements, of_chosen = elements.of_parts(active)
            unknowns, here, least = unknowns[of_chosen], here[active], least[active]
            part, parts, unknown_part = elements.part, elements.parts, elements.unknown_part
            maps, active, factor = elements.maps(places), np.ones(parts, dtype=bool), None
        gradient, pull, matrix = elements.newton_system(energy, maps, remaining)
        factor = factorize(matrix, used_up=factor, whole=len(points))
        step = np.append(factor.solve(-gradient - pull), remaining)
        if not np.isfinite(step).all():
            raise MetricError(f"relaxation found no finite step of {elements.count:,} unknowns")
        slope = np.bincount(unknown_part, gradient * step[:-1], parts)
        if not remaining:
            active &= -slope > np.maximum(tolerance * (here - least), RELATIVE_ROUNDING * here)
            step[:-1][~active[unknown_part]] = 0.0
            if not active.any():
                break
        change = elements.change(step)
        length = np.full(parts, np.inf)
        np.minimum.at(length, part, maps.largest_steps(change))
        longest = min(1.0, stride / remaining) if remaining else 1.0
        length = np.minimum(longest, SHORT_OF_FLAT * length)
        taken += 1
        for _ in range(HALVINGS):
            trial = maps.plus(length[part], change)
            there = sums(elements.energies(energy, trial))
            # On the way to the constraints the energy may have to rise: all that counts is that it is finite.
            enough = np.isfinite(there) if remaining else there <= here + ARMIJO * length * slope
            good = ~active | enough
            if good.all():
                break
            length[~good] /= 2
        length[~good] = 0.0
        active &= length > 0
        total[unknowns] += length[unknown_part] * step[:-1]
        total[-1] += length[0] * step[-1] if remaining else 0.0
        places = points + motions.shifts(total)
        maps = elements.maps(places)
        here = sums(elements.energies(energy, maps))
        if remaining:
            remaining = 1.0 - float(total[-1])
            remaining = remaining if remaining > RELATIVE_ROUNDING else 0.0
            if length[0] < MIN_PROGRESS:
                break
        if tell is not None and tell(taken, done + float(here.sum())):
            break
    return Descent(places, before, done + float(here.sum()), taken, remaining)
