"""Energies of cones on a dense model, and the best sets found by the moves of `exchange`."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from ..._arrays import BoolArray, FloatArray, IntArray
from .best_sets import BestSets, ConeSet
from .exchange import TIE, Choice, Energies, best_addition, exchange, fit_set, least_missed, shake
from .fit_curvatures import index_of_least
from .limits import Limits

# How many of the best scored moves are fitted exactly: scores leave out that bounds of other cones may become active,
# or cease to be.
FITTED = 5
# So many cones more that bring E^2 down by less than this factor are no use: bounds are in the way.
STALL, STALLED = 10, 0.99


def above_rounding(energy: float) -> float:
    """Return E^2, which rounding may have made less than nothing: gains are shares of it, and must not be losses."""
    return max(float(energy), 0.0)


@dataclass(frozen=True)
class Fit:
    """The best curvatures of cones.

    Attributes:
        curvatures: (s,) radians.
        multiplier: of their sum; 0 without one.
        feasible: whether the bounds allow the sum.
        energy: E^2; infinite if not feasible.
    """

    curvatures: FloatArray
    multiplier: float
    feasible: bool
    energy: float


def first_least(values: FloatArray) -> int:
    """Return the first index whose value is the least but for rounding."""
    return int(index_of_least(values, TIE))


@dataclass(eq=False)
class DenseModel:
    """Energies of cones on m candidates, and the best sets that were found.

    Attributes:
        gram, slope, constant: (m, m), (m,) and a number.
        usable: (m,) whether a candidate may be chosen; False for required ones, which are in every set.
        fixed: the required candidates, which come first in every set.
        limits: of the curvatures.
        least: (m,) bound of the curvature at each candidate, the limit or above.
        best: by number of cones.
        most: (m,) the upper bounds; None for the limit.
    """

    gram: FloatArray
    slope: FloatArray
    constant: float
    usable: BoolArray
    fixed: IntArray
    limits: Limits
    least: FloatArray
    best: BestSets[ConeSet] = field(default_factory=BestSets)
    most: FloatArray | None = None

    @property
    def _energies(self) -> Energies:
        most = np.full(len(self.slope), self.limits.most) if self.most is None else self.most
        return Energies(self.gram, self.slope, float(self.constant), self.least, most, self.limits.total)

    @property
    def _choice(self) -> Choice:
        return Choice(len(self.fixed), self.usable, self._kind(), FITTED)

    def _kind(self) -> BoolArray:
        """Return (m,) the kind of each candidate: swaps keep what is what."""
        return np.zeros(len(self.slope), dtype=bool)

    def fit(self, members: IntArray) -> Fit:
        """Return the best curvatures of a set."""
        return Fit(*fit_set(self._energies, members))

    def energy(self, members: IntArray) -> float:
        """Return E^2 of a set, infinite where bounds leave no curvatures."""
        return self.fit(members).energy

    def grown(self, members: IntArray, usable: BoolArray | None = None) -> IntArray | None:
        """Return the members and the usable candidate that scores best; None if there is none left."""
        chosen = best_addition(self._energies, members, self.usable if usable is None else usable)
        return None if chosen < 0 else np.append(members, chosen)

    def shrunk(self, members: IntArray) -> IntArray | None:
        """Return the members without the one that is missed least; None if none can go."""
        place = least_missed(self._energies, members, self._choice)
        return None if place < 0 else np.delete(members, place)

    def exchanged(self, members: IntArray) -> ConeSet:
        """Return the set after members, one at a time, were replaced as long as E^2 falls. The required ones stay."""
        members = members.copy()
        return ConeSet(exchange(self._energies, members, self._choice), members)

    def climb(self, bound: float, most: int, start: int | None = None) -> None:
        """Add cones, to the best set of the size `start` if it is given, until E^2 <= bound, or there are `most`."""
        members: IntArray | None = self.best[start].members if start is not None else self.fixed
        while members is not None:
            found = self.exchanged(members)
            self.best.offer(found)
            size, energy = len(found), self.best.energy(len(found))
            if (
                size >= most
                or energy <= bound
                or energy >= STALLED * self.best.energy(size - STALL) < math.inf
            ):
                break
            members = self.grown(self.best[size].members if size in self.best else found.members)

    def descend(self, least: int, most: int) -> None:
        """Take cones away one at a time, from the best set of `most` down to one of `least`."""
        for size in range(most, max(least, len(self.fixed)), -1):
            shrunk = self.shrunk(self.best[size].members) if size in self.best else None
            if shrunk is not None:
                self.best.offer(self.exchanged(shrunk))

    def shake(self, size: int, tries: int, seed: int = 0) -> bool:
        """Take two or three cones of the best set of a size away and refill, over and over; tell if it got better."""
        if size - len(self.fixed) < 2:
            return False
        start = self.best[size]
        members = start.members.copy()
        out = taken_out(size - len(self.fixed), tries, seed)
        energy, found = shake(self._energies, members, start.energy, self._choice, out)
        return found and self.best.offer(ConeSet(energy, members))


@lru_cache
def taken_out(count: int, tries: int, seed: int) -> IntArray:
    """Return (t, 3) which two or three of so many cones are taken away at each try, sorted; -1 fills up two."""
    random = np.random.default_rng(seed)
    out = np.full((tries, 3), -1)
    for i in range(tries):
        size = min(2 + i % 2, count)
        out[i, :size] = random.choice(count, size, replace=False)
    out.sort(axis=1)
    return out
