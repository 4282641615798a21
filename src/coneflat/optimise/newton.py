"""Newton's method, with one line search, on energies of triangles; relaxing and untangling call it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..base import BoolArray, ComplexArray, FloatArray, begin_step
from ..errors import MetricError
from ..linalg import Factor, factorize
from ..linalg.newton import ARMIJO, HALVINGS
from .elements import Elements, Maps
from .energies import Energy
from .motions import Motions

# Relative rounding error of sums, for the energy and for the remaining distance to the constraints.
RELATIVE_ROUNDING = 1e-12
# Added to the diagonal of the Hessian, relative to it, one after the other until steps lead downwards: where triangles
# are a million times as long as high, rounding makes the Hessian indefinite.
RIDGES = (0.0, 1e-9, 1e-7)
# Maximum step, as a fraction of the step at which a triangle would have no area (Smith and Schaefer 2015).
MAX_STEP_SHARE = 0.9
# Factor by which a step is lengthened while the energy falls, and how often at most: without the negative eigenvalues
# of the Hessians, steps are too short.
LENGTHENING, MAX_LENGTHENINGS = 1.5, 2
# The constraints cannot be reached if a step covers less than this fraction of the distance to them.
MIN_PROGRESS = 1e-3
# If less than this fraction of the unknowns is in parts that have not converged, only these parts are continued.
MIN_ACTIVE_SHARE = 0.6
# Number of further factorizations of a pattern up to which the solver is chosen as for that many times the points: with
# 2,000 unknowns, PARDISO then takes 1 ms for each, and SuperLU 6.
MAX_REPETITIONS = 24

Report = Callable[[int, float], bool | None]


@dataclass(frozen=True, eq=False)
class Problem:
    """The energy of moving triangles as a function of unknowns.

    Attributes:
        motions: the motions of the points as functions of the unknowns.
        elements: the triangles that move, or those of some parts.
        energy: the energy that is minimised.
        damping: added to the diagonal of the Hessian, relative to its largest entry.
    """

    motions: Motions
    elements: Elements
    energy: Energy
    damping: float = 0.0

    def energies_along(self, maps: Maps, change: Maps, lengths: FloatArray) -> FloatArray:
        """Return (f,) the energies of the triangles after steps of lengths (f,) or (1,)."""
        return self.elements.energies(self.energy, maps.plus(lengths, change))


@dataclass(frozen=True, eq=False)
class Descent:
    """The result of Newton's method.

    Attributes:
        points: (u,) the positions as complex numbers.
        step: (k + 1,) the change of the unknowns and the offset.
        before, after: the energy at the start and at the end.
        steps: number of Newton steps.
        remaining: remaining fraction of the distance to the constraints: 0 if they hold.
    """

    points: ComplexArray
    step: FloatArray
    before: float
    after: float
    steps: int
    remaining: float = 0.0


def descend(
    points: ComplexArray,
    problem: Problem,
    tolerance: float,
    steps: int,
    progress: Report | None = None,
    stride: float = 1.0,
) -> Descent:
    """Return points that satisfy the constraints and have a lower energy, found by Newton's method.

    Args:
        points: (u,) start positions as complex numbers. No moving triangle is flipped there, unless the energy is
            regularised.
        problem: the motions, the triangles and the energy.
        tolerance: the last step of a part is the first one whose predicted decrease is at most this fraction of its
            energy minus the lower bound.
        steps: maximum number of steps.
        progress: called with the number of steps and the energy; a return value of True ends the iteration.
        stride: maximum fraction of the distance to the constraints per step.

    Raises:
        MetricError: the Hessian is singular in double precision.

    See Also:
        coneflat.linalg.newton.minimise: for convex functions that are given by their gradients alone.
    """
    report = progress or (lambda step, energy: None)
    if not problem.motions.has_offset:
        return minimise_energy(points, problem, tolerance, steps, report)
    start = reach_constraints(points, problem, steps, report, stride)
    if start.remaining or not problem.elements.count:
        return start
    end = minimise_energy(
        start.points,
        problem,
        tolerance,
        steps - start.steps,
        lambda step, energy: report(start.steps + step, energy),
    )
    return replace(end, step=start.step + end.step, before=start.before, steps=start.steps + end.steps)


def reach_constraints(
    points: ComplexArray, problem: Problem, steps: int, report: Report, stride: float
) -> Descent:
    """Return points that satisfy the constraints, if Newton's method reaches them without flipping a triangle.

    See `descend` for the arguments.

    Notes:
        Each step goes towards the constraints and a lower energy, as far as the triangles permit. The energy may rise
        (an infeasible start: Boyd and Vandenberghe, "Convex Optimization", 2004, Section 10.3).
    """
    elements, energy = problem.elements, problem.energy
    total, places, taken, remaining = np.zeros(problem.motions.count + 1), points, 0, 1.0
    maps = elements.maps(places)
    before = after = float(elements.energies(energy, maps).sum())
    factor: Factor | None = None
    while taken < steps and remaining:
        begin_step()
        _, step, factor = newton_step(problem, maps, factor, _size(points, steps), remaining)
        taken += 1
        change = elements.change(step)
        length = feasible_length(problem, maps, change, min(1.0, stride / remaining))
        total += length * step
        places = points + problem.motions.shifts(total)
        maps = elements.maps(places)
        after = float(elements.energies(energy, maps).sum())
        remaining = 1.0 - float(total[-1])
        remaining = remaining if remaining > RELATIVE_ROUNDING else 0.0
        if length < MIN_PROGRESS or report(taken, after):
            break
    return Descent(places, total, before, after, taken, remaining)


def feasible_length(problem: Problem, maps: Maps, change: Maps, first: float) -> float:
    """Return a step length of at most `first` at which no triangle is flipped, though the energy may rise."""
    longest = MAX_STEP_SHARE * maps.largest_steps(change).min(initial=np.inf)

    def energy_at(lengths: FloatArray) -> FloatArray:
        return problem.energies_along(maps, change, lengths).sum(keepdims=True)

    lengths, _ = search_line(
        energy_at, np.array([min(first, longest)]), lambda _, energies: np.isfinite(energies)
    )
    return float(lengths[0])


def minimise_energy(
    points: ComplexArray, problem: Problem, tolerance: float, steps: int, report: Report
) -> Descent:
    """Return points of lower energy; see `descend` for the arguments.

    Notes:
        Parts that no triangle connects have separate step lengths, and end separately.
    """
    elements, energy = problem.elements, problem.energy
    total, places, taken = np.zeros(problem.motions.count + 1), points, 0
    maps = elements.maps(places)
    energies = elements.part_energies(energy, maps)
    before, converged = float(energies.sum()), 0.0
    active = np.ones(elements.parts, dtype=bool)
    factor: Factor | None = None
    while taken < steps and active.any():
        if active[elements.unknown_part].mean() < MIN_ACTIVE_SHARE:
            converged += float(energies[~active].sum())
            elements, energies = elements.of_parts(active), energies[active]
            problem = replace(problem, elements=elements)
            maps, active, factor = elements.maps(places), np.ones(elements.parts, dtype=bool), None
        begin_step()
        ceiling = np.where(active, RELATIVE_ROUNDING * energies, np.inf)
        step, slope, factor = falling_step(problem, maps, factor, _size(points, steps), ceiling)
        is_last = -slope <= tolerance * (energies - energy.minimum * elements.sums(elements.weight))
        active &= -slope > RELATIVE_ROUNDING * energies
        if not active.any():
            break
        step[:-1][~active[elements.unknown_part]] = 0.0
        taken += 1
        lengths = step_lengths(problem, maps, elements.change(step), energies, slope, active)
        active &= (lengths > 0) & ~is_last
        total[elements.unknowns] += lengths[elements.unknown_part] * step[:-1]
        places = points + problem.motions.shifts(total)
        maps = elements.maps(places)
        energies = elements.part_energies(energy, maps)
        if report(taken, converged + float(energies.sum())):
            break
    return Descent(places, total, before, converged + float(energies.sum()), taken)


def _size(points: ComplexArray, steps: int) -> int:
    """Return the size by which the solver is chosen: matrices of one pattern are factorized in all steps."""
    return min(steps - 1, MAX_REPETITIONS) * len(points)


def newton_step(
    problem: Problem,
    maps: Maps,
    previous: Factor | None,
    size: int,
    remaining: float = 0.0,
    ridge: float = 0.0,
) -> tuple[FloatArray, FloatArray, Factor]:
    """Return the gradient (k,), Newton's step (k + 1,) with the offset as the last entry, and the factorized Hessian.

    Args:
        problem, maps: the triangles, their energy and their current maps.
        previous: the factor of the step before, or None.
        size: see `total_size` of `factorize`.
        remaining: the step of the offset.
        ridge: added to the diagonal of the Hessian, relative to it.

    Raises:
        MetricError: the Hessian is singular in double precision.
    """
    gradient, pull, matrix = problem.elements.newton_system(problem.energy, maps, remaining)
    if problem.damping:
        matrix.setdiag(matrix.diagonal() + problem.damping * matrix.diagonal().max())
    if ridge:
        matrix.setdiag(matrix.diagonal() * (1 + ridge))
    factor = factorize(matrix, previous, size)
    step = np.append(factor.solve(-gradient - pull), remaining)
    if not np.isfinite(step).all():
        raise MetricError(f"relaxation found no finite step of its {len(gradient):,} unknowns")
    return gradient, step, factor


def falling_step(
    problem: Problem, maps: Maps, previous: Factor | None, size: int, ceiling: FloatArray
) -> tuple[FloatArray, FloatArray, Factor]:
    """Return Newton's step (k + 1,), the slope of the energy of each part along it, and the factorized Hessian.

    Args:
        problem, maps, previous, size: see `newton_step`.
        ceiling: (parts,) the largest slope that is accepted.
    """
    elements, factor = problem.elements, previous
    for ridge in RIDGES:
        gradient, step, factor = newton_step(problem, maps, factor, size, ridge=ridge)
        slope = np.bincount(elements.unknown_part, gradient * step[:-1], elements.parts).astype(np.float64)
        if (slope <= ceiling).all():
            break
    assert factor is not None
    return step, slope, factor


def step_lengths(
    problem: Problem,
    maps: Maps,
    change: Maps,
    energies: FloatArray,
    slope: FloatArray,
    active: BoolArray,
) -> FloatArray:
    """Return the step length of each part along a step, 0 where no length lowers the energy of an active part.

    Args:
        problem, maps: the triangles, their energy and their current maps.
        change: the change of the maps along the step.
        energies, slope: (parts,) the energies of the parts and their derivatives along the step.
        active: (parts,) the parts whose energy must fall.
    """
    elements = problem.elements

    def energies_at(lengths: FloatArray) -> FloatArray:
        return elements.sums(problem.energies_along(maps, change, lengths[elements.part]))

    longest = np.full(elements.parts, np.inf)
    if not problem.energy.is_regularised:
        np.minimum.at(longest, elements.part, MAX_STEP_SHARE * maps.largest_steps(change))
    lengths, reached = search_line(
        energies_at,
        np.minimum(1.0, longest),
        lambda lengths, reached: ~active | (reached <= energies + ARMIJO * lengths * slope),
    )
    for _ in range(0 if problem.energy.is_regularised else MAX_LENGTHENINGS):
        longer = np.minimum(LENGTHENING * lengths, longest)
        energies_longer = energies_at(longer)
        is_lower = (lengths > 0) & (energies_longer < reached)
        if not is_lower.any():
            break
        lengths[is_lower], reached[is_lower] = longer[is_lower], energies_longer[is_lower]
    return lengths


def search_line(
    energies_at: Callable[[FloatArray], FloatArray],
    first: FloatArray,
    is_allowed: Callable[[FloatArray, FloatArray], BoolArray],
) -> tuple[FloatArray, FloatArray]:
    """Return step lengths (p,), the first ones halved until they are allowed, and the energies there.

    Args:
        energies_at: returns the energies (p,) at step lengths (p,).
        first: (p,) the first lengths.
        is_allowed: returns which lengths (p,) are allowed, from them and the energies. Lengths that are not allowed
            after `HALVINGS` trials become 0.

    See Also:
        coneflat.linalg.newton.minimise: its line search has one length, and compares slopes instead of energies, which
            is possible only for convex functions.
    """
    lengths = first.copy()
    for _ in range(HALVINGS):
        energies = energies_at(lengths)
        allowed = is_allowed(lengths, energies)
        if allowed.all():
            break
        lengths[~allowed] /= 2
    lengths[~allowed] = 0.0
    return lengths, energies
