"""Energies of cones on a dense model, moves that improve a set of cones, and the best sets found.

The distortion of cones S with curvatures k is E^2 = constant + 2 slope_S k + k gram_SS k. If the other cones are
refitted without bounds, candidate t lowers it by (slope_t + gram_tS k + lambda)^2 / h_t, where h_t is the remainder of
gram_tt after projection (orthogonal matching pursuit: Y. Pati, R. Rezaiifar, P. Krishnaprasad 1993). All candidates
are scored at once. The best of them are fitted exactly, with their bounds.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np

from ...base.arrays import BoolArray, FloatArray, IntArray
from ..solution import TIE_TOLERANCE
from .fit_curvatures import fit_curvatures, inverse_with_sum
from .limits import MAX_SEARCHED, Limits

# Relative decrease of E^2 that a set needs to replace another of the same size, so that rounding does not decide.
MIN_RELATIVE_GAIN = 1e-6
# Fraction of the diagonal entry of a cone that must remain after projection off the others; else it depends on them.
MIN_INDEPENDENT_SHARE = 1e-10
# Number of cones whose removal is tried to find a set with one cone fewer: one cone less in 140 than with a single one.
REMOVALS = 3
# The search stops if this number of additional cones does not lower E^2 below this factor, as bounds prevent it.
STALL_CONES, STALL_FACTOR = 10, 0.99


@dataclass(frozen=True, eq=False)
class ConeSet:
    """A set of cones on a dense model.

    Attributes:
        energy: E^2, infinite if no curvatures satisfy the bounds.
        members: (s,) candidates, the required ones first.
    """

    energy: float
    members: IntArray

    def __len__(self) -> int:
        return len(self.members)


SetT = TypeVar("SetT", bound=ConeSet)


class BestSets(Generic[SetT]):
    """The best set found of each size."""

    def __init__(self) -> None:
        self._sets: dict[int, SetT] = {}

    def __iter__(self) -> Iterator[SetT]:
        return iter(self._sets.values())

    def __contains__(self, size: int) -> bool:
        return size in self._sets

    def __getitem__(self, size: int) -> SetT:
        return self._sets[size]

    @property
    def sizes(self) -> list[int]:
        """The sizes for which there is a set, ascending."""
        return sorted(self._sets)

    def energy(self, size: int) -> float:
        """Return E^2 of the best set of a size, infinite if there is none."""
        return self._sets[size].energy if size in self._sets else math.inf

    def offer(self, candidate: SetT) -> bool:
        """Store a set if it is the best of its size; return whether it is."""
        is_better = candidate.energy < self.energy(len(candidate)) * (1 - MIN_RELATIVE_GAIN)
        if is_better:
            self._sets[len(candidate)] = candidate
        return is_better

    def fewest(self, goal: float, max_size: float = math.inf) -> SetT:
        """Return the smallest set with E^2 <= goal, or that of smallest E^2, of at most `max_size` cones."""
        small_enough = [cones for cones in self if len(cones) <= max_size]
        good = [cones for cones in small_enough if cones.energy <= goal]
        return min(good, key=len) if good else min(small_enough, key=lambda cones: (cones.energy, len(cones)))


def nonnegative(energy: float) -> float:
    """Return E^2, or 0 if rounding has made it negative, as relative gains need a nonnegative value."""
    return max(float(energy), 0.0)


@dataclass(frozen=True, eq=False)
class Fit:
    """The best curvatures of a set of cones.

    Attributes:
        curvatures: (s,) radians.
        multiplier: multiplier of the sum constraint; 0 without one.
        feasible: whether the bounds allow the sum.
        energy: E^2; infinite if not feasible.
    """

    curvatures: FloatArray
    multiplier: float
    feasible: bool
    energy: float


def argmin_tied(values: FloatArray) -> int:
    """Return the first index whose value equals the minimum up to rounding."""
    return int(row_argmins(values[None])[0])


def row_argmins(values: FloatArray) -> IntArray:
    """Return (r,) for each row of values (r, c) the first column whose value equals the minimum up to rounding."""
    minima = values.min(axis=1)
    finite = np.where(np.isfinite(minima), minima, 0.0)
    return (values <= (minima + TIE_TOLERANCE * np.abs(finite))[:, None]).argmax(axis=1)


@dataclass(eq=False)
class DenseModel:
    """Energies of cones on m candidates, and the best sets that were found.

    Attributes:
        gram, slope, constant: (m, m), (m,) and a number; see the module.
        usable: (m,) whether a candidate may be chosen; False for required ones, which are in every set.
        fixed: the required candidates, which come first in every set.
        limits: bounds and sum of the curvatures.
        lower: (m,) lower bound of the curvature at each candidate, not below that of `limits`.
        best: the best set found of each number of cones.
    """

    gram: FloatArray
    slope: FloatArray
    constant: float
    usable: BoolArray
    fixed: IntArray
    limits: Limits
    lower: FloatArray
    best: BestSets[ConeSet] = field(default_factory=BestSets)

    def fit(self, members: IntArray, guess: FloatArray | None = None) -> Fit:
        """Return the best curvatures of a set of candidates (s,), for which those of a similar set may be given."""
        gram, slope = self.gram[members[:, None], members], self.slope[members]
        upper = np.full(len(members), self.limits.upper)
        fitted = fit_curvatures(gram, slope, self.lower[members], upper, self.limits.total, guess)
        curvatures, _, feasible = fitted
        energy = float(self.constant + (2 * slope + gram @ curvatures) @ curvatures) if feasible else math.inf
        return Fit(*fitted, nonnegative(energy))

    def energy(self, members: IntArray) -> float:
        """Return E^2 of a set, infinite if no curvatures satisfy the bounds."""
        return self.fit(members).energy

    def additions(self, members: IntArray) -> FloatArray:
        """Return (m,) the change of E^2 (0 or less) if a candidate is added, ignoring the bounds of the members."""
        limits, diagonal = self.limits, self.gram.diagonal()
        if limits.has_sum and not len(members):
            return (2 * self.slope + diagonal * limits.total) * limits.total
        fitted = self.fit(members)
        # If the bounds do not allow the sum, they are ignored, and all members are free.
        free = members[self._between_bounds(members, fitted)] if fitted.feasible else members
        if limits.has_sum and not len(free):
            free = members[:1]
        remain, _, _ = self._project(free)
        is_independent = remain > TIE_TOLERANCE * diagonal
        gradient = self._gradient(members, fitted)
        x = -gradient / np.where(is_independent, remain, 1.0)
        if fitted.feasible:
            x = np.clip(x, self.lower, limits.upper)
        return np.where(is_independent, (2 * gradient + remain * x) * x, 0.0)

    def swaps(self, members: IntArray, fitted: Fit) -> tuple[FloatArray, IntArray]:
        """Return (s,) the change of E^2 by the best replacement of each member, and (s,) this replacement.

        Removing a member is a rank-one change of the inverse, so scoring all candidates for all members costs little
        more than scoring the candidates once. Members at a bound and required members are not replaced: their change is
        infinite and their replacement -1.
        """
        change, which = np.full(len(members), np.inf), np.full(len(members), -1)
        diagonal, places = self.gram.diagonal(), np.flatnonzero(self._between_bounds(members, fitted))
        remain, rows, pivots = self._project(members[places])
        is_moved = (places >= len(self.fixed)) & (pivots * diagonal[members[places]] > MIN_INDEPENDENT_SHARE)
        is_open = self.usable.copy()
        is_open[members] = False
        candidates = np.flatnonzero(is_open)
        places = places[is_moved]
        if not len(places) or not len(candidates):
            return change, which
        share, w = 1.0 / pivots[is_moved, None], rows[is_moved][:, candidates]
        k = fitted.curvatures[places, None]
        h = remain[candidates] + w * w * share
        g = self._gradient(members, fitted)[candidates] - w * k * share
        is_independent = h > TIE_TOLERANCE * diagonal[candidates]
        x = np.clip(-g / np.where(is_independent, h, 1.0), self.lower[candidates], self.limits.upper)
        values = np.where(is_independent, k * k * share + (2 * g + h * x) * x, np.inf)
        best = row_argmins(values)
        change[places], which[places] = values[np.arange(len(places)), best], candidates[best]
        return change, which

    def _between_bounds(self, members: IntArray, fitted: Fit) -> BoolArray:
        """Return (s,) whether the curvature of a member is strictly between its bounds."""
        k = fitted.curvatures
        span = TIE_TOLERANCE * (1.0 + np.abs(k))
        return (self.lower[members] + span < k) & (k < self.limits.upper - span)

    def _gradient(self, members: IntArray, fitted: Fit) -> FloatArray:
        """Return (m,) half the derivative of the Lagrangian of E^2 and the sum by the curvature of each candidate."""
        return self.slope + fitted.multiplier + fitted.curvatures @ self.gram[members]

    def _project(self, free: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Project the candidates off the free members (f,), and off the sum constraint if there is one.

        Returns:
            (m,) the remainder of the diagonal of the Gram matrix, (f, m) the coefficients of the projection, and (f,)
            the diagonal of the inverse of the Gram matrix of the members.
        """
        has_sum = self.limits.has_sum and len(free) > 0
        right = self.gram[free]
        inverse = inverse_with_sum(right[:, free], has_sum)
        if has_sum:
            right = np.append(right, np.ones((1, len(self.slope))), axis=0)
        rows = inverse @ right
        remain = self.gram.diagonal() - np.einsum("ij,ij->j", right, rows)
        return remain, rows[: len(free)], inverse.diagonal()[: len(free)]

    def grown(self, members: IntArray) -> IntArray | None:
        """Return the members with the usable candidate of the best score added; None if there is none left."""
        is_open = self.usable.copy()
        is_open[members] = False
        if not is_open.any():
            return None
        missing = self.limits.total - self.lower[members].sum()
        if missing < 0:  # too few to absorb the total: prefer candidates that can absorb the remainder
            for bound in (missing, 0.0):
                can_absorb = is_open & (self.lower <= bound) & (self.lower < 0)
                if can_absorb.any():
                    is_open = can_absorb
                    break
        candidates = np.flatnonzero(is_open)
        return np.append(members, candidates[argmin_tied(self.additions(members)[candidates])])

    def shrunk(self, members: IntArray, number: int = 1) -> list[IntArray]:
        """Return the sets without one of the least important members, at most `number` sets.

        These are the members whose removal increases E^2 least if the others are refitted without bounds.
        """
        fixed = len(self.fixed)
        _, _, pivots = self._project(members)
        loss = (self.fit(members).curvatures ** 2 / np.maximum(pivots, 1e-300))[fixed:]
        sets = []
        for _ in range(min(number, len(loss))):
            place = argmin_tied(loss)
            loss[place] = np.inf
            sets.append(np.delete(members, fixed + place))
        return [remaining for remaining in sets if self.energy(remaining) < math.inf]

    def exchanged(self, members: IntArray) -> ConeSet:
        """Return the set after replacing members one at a time while E^2 decreases; required members stay."""
        fitted = self.fit(members)
        improved = fitted.feasible
        while improved:
            improved = False
            change, which = self.swaps(members, fitted)
            for _ in range(len(members)):
                place = argmin_tied(change)
                if not change[place] <= -MIN_RELATIVE_GAIN * fitted.energy:
                    break
                change[place] = np.inf
                trial = members.copy()
                trial[place] = which[place]
                refitted = self.fit(trial, fitted.curvatures)
                if refitted.energy < fitted.energy * (1 - MIN_RELATIVE_GAIN):
                    members, fitted, improved = trial, refitted, True
                    # With many cones, scoring takes long: others are replaced before all are scored again.
                    change[(which == which[place]) | (len(members) < MAX_SEARCHED // 4)] = np.inf
        return ConeSet(fitted.energy, members)

    def climb(self, bound: float, max_size: int, start: int | None = None) -> None:
        """Add cones one at a time until E^2 <= bound or there are `max_size`.

        It starts from the required cones, or from the best set of the size `start`.
        """
        members: IntArray | None = self.best[start].members if start is not None else self.fixed
        while members is not None:
            improved = self.exchanged(members)
            self.best.offer(improved)
            size, energy = len(improved), self.best.energy(len(improved))
            is_stalled = energy >= STALL_FACTOR * self.best.energy(size - STALL_CONES) < math.inf
            if size >= max_size or energy <= bound or is_stalled:
                break
            members = self.grown(self.best[size].members if size in self.best else improved.members)

    def descend(self, min_size: int, max_size: int) -> None:
        """Remove cones one at a time, from the best set of `max_size` cones to one of `min_size`."""
        for size in range(max_size, max(min_size, len(self.fixed)), -1):
            for shrunk in self.shrunk(self.best[size].members, REMOVALS) if size in self.best else []:
                self.best.offer(self.exchanged(shrunk))
