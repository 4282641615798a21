"""Newton's method on the distortion of triangles, without flipping any of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..base import ComplexArray, FloatArray, check_cancelled
from ..errors import MetricError
from ..linalg import Factor, factorize
from ..linalg.newton import ARMIJO, HALVINGS
from .elements import MAX_STEP_SHARE, Elements
from .energies import Energy
from .motions import Motions

# Relative rounding error of sums, for the energy and for the remaining distance to the constraints.
RELATIVE_ROUNDING = 1e-12
# Added to the diagonal of the Hessian, relative to it, one after the other until steps lead downwards: where triangles
# are a million times as long as high, rounding makes the Hessian indefinite.
RIDGES = (0.0, 1e-9, 1e-7)
# The constraints cannot be reached if a step covers less than this fraction of the distance to them.
MIN_PROGRESS = 1e-3
# If less than this fraction of the unknowns is in parts that have not converged, only these parts are continued. And
# factor by which more unknowns than there are count for the choice of the solver, since matrices of one pattern are
# factorized repeatedly: with 2,000 unknowns PARDISO takes 1 ms and SuperLU 6.
MIN_ACTIVE_SHARE, REPEATED = 0.6, 24


@dataclass(frozen=True, eq=False)
class Descent:
    """The result of Newton's method.

    Attributes:
        points: (u,) the positions as complex numbers.
        before, after: the energy at the start and at the end.
        steps: number of Newton steps.
        remaining: remaining fraction of the distance to the constraints: 0 if they hold.
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
    progress: Callable[[int, float], bool | None] | None = None,
    stride: float = 1.0,
) -> Descent:
    """Return points of lower energy, found by Newton's method.

    Parts that no triangle connects have separate step lengths, longer than 1 while their energy falls. While
    constraints do not hold, all parts have a common step length, as long towards the constraints as the triangles
    permit (an infeasible start: Boyd and Vandenberghe 2004, Section 10.3).

    Args:
        points: (u,) start positions as complex numbers, where no moving triangle is flipped.
        motions: the motions of the points as functions of the unknowns.
        elements: the triangles that move.
        energy: the energy that is minimised.
        tolerance: the last step of a part is the first one whose predicted decrease is at most this fraction of its
            energy minus the lower bound.
        steps: maximum number of steps.
        progress: called with the number of steps and the energy; a return value of True ends the iteration.
        stride: maximum fraction of the distance to the constraints per step.

    Raises:
        MetricError: the Hessian is singular in double precision.
    """
    remaining = 1.0 if motions.has_offset else 0.0
    together = motions.has_offset
    places, taken = points, 0
    maps = elements.maps(places)
    part = np.zeros_like(elements.part) if together else elements.part
    parts = 1 if together else elements.parts
    unknown_part = np.zeros_like(elements.unknown_part) if together else elements.unknown_part

    def sums(values: FloatArray) -> FloatArray:
        return np.bincount(part, values, parts).astype(np.float64)

    energies = sums(elements.energies(energy, maps))
    before, done, minima = float(energies.sum()), 0.0, energy.minimum * sums(elements.weight)
    total, unknowns = np.zeros(elements.count + 1), np.arange(elements.count)
    active = np.ones(parts, dtype=bool)
    factor: Factor | None = None
    while taken < steps and ((elements.count and active.any()) or remaining > RELATIVE_ROUNDING):
        if not together and elements.count and active[unknown_part].mean() < MIN_ACTIVE_SHARE:
            done += float(energies[~active].sum())
            elements, of_chosen = elements.of_parts(active)
            unknowns, energies, minima = unknowns[of_chosen], energies[active], minima[active]
            part, parts, unknown_part = elements.part, elements.parts, elements.unknown_part
            maps, active, factor = elements.maps(places), np.ones(parts, dtype=bool), None
        check_cancelled()
        gradient, pull, matrix = elements.newton_system(energy, maps, remaining)
        for ridge in RIDGES:
            if ridge:
                matrix.setdiag(matrix.diagonal() * (1 + ridge))
            factor = factorize(matrix, factor, REPEATED * len(points))
            step = np.append(factor.solve(-gradient - pull), remaining)
            if not np.isfinite(step).all():
                raise MetricError(f"relaxation found no finite step of its {elements.count:,} unknowns")
            slope = np.bincount(unknown_part, gradient * step[:-1], parts)
            if remaining or not (slope[active] > RELATIVE_ROUNDING * energies[active]).any():
                break
        is_last = (-slope <= tolerance * (energies - minima)) & (not remaining)
        if not remaining:
            active &= -slope > RELATIVE_ROUNDING * energies
            step[:-1][~active[unknown_part]] = 0.0
            if not active.any():
                break
        change = elements.change(step)
        farthest = np.full(parts, np.inf)
        np.minimum.at(farthest, part, MAX_STEP_SHARE * maps.largest_steps(change))
        length = np.minimum(min(1.0, stride / remaining) if remaining else 1.0, farthest)
        taken += 1
        for _ in range(HALVINGS):
            trial = maps.plus(length[part], change)
            trial_energies = sums(elements.energies(energy, trial))
            # The energy may have to rise on the way to the constraints, so it need only be finite.
            enough = (
                np.isfinite(trial_energies)
                if remaining
                else trial_energies <= energies + ARMIJO * length * slope
            )
            good = ~active | enough
            if good.all():
                break
            length[~good] /= 2
        length[~good] = 0.0
        active &= (length > 0) & ~is_last
        # Without the negative eigenvalues of the Hessians, steps are too short.
        for times in () if remaining else (1.5, 1.5):
            longer = np.minimum(times * length, farthest)
            longer_energies = sums(elements.energies(energy, maps.plus(longer[part], change)))
            is_lower = (length > 0) & (longer_energies < trial_energies)
            if not is_lower.any():
                break
            length[is_lower], trial_energies[is_lower] = longer[is_lower], longer_energies[is_lower]
        total[unknowns] += length[unknown_part] * step[:-1]
        total[-1] += length[0] * step[-1] if remaining else 0.0
        places = points + motions.shifts(total)
        maps = elements.maps(places)
        energies = sums(elements.energies(energy, maps))
        if remaining:
            remaining = 1.0 - float(total[-1])
            remaining = remaining if remaining > RELATIVE_ROUNDING else 0.0
            if length[0] < MIN_PROGRESS:
                break
        if progress is not None and progress(taken, done + float(energies.sum())):
            break
    return Descent(places, before, done + float(energies.sum()), taken, remaining)
