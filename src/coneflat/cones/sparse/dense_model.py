"""Energies of cones on a dense model, and the moves that improve them.

The distortion of cones S with curvatures k is E^2 = constant + 2 slope_S k + k gram_SS k. With the other cones
refitted freely, candidate t lowers it by (slope_t + gram_tS k + lambda)^2 / h_t, where h_t is what remains of gram_tt
after projection (orthogonal matching pursuit: Y. Pati, R. Rezaiifar, P. Krishnaprasad 1993). All candidates are
scored at once; the few best are fitted exactly, bounds and all.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from ..._arrays import BoolArray, FloatArray, IntArray
from .best_sets import GAIN, BestSets, ConeSet
from .fit_curvatures import fit_members, index_of_least
from .limits import Limits
from .scores import addition_scores, gradients, project, swap_table

# How many of the best scored moves are fitted exactly: scores leave out that bounds of other cones may become active,
# or cease to be.
FITTED = 5
# Changes that differ by less, relatively, are equal, and the first in the order of candidates is taken: symmetric
# surfaces have many that differ by rounding only.
TIE = 1e-9
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
    def _upper(self) -> FloatArray:
        """(m,) the upper bound of the curvature at each candidate."""
        return np.full(len(self.slope), self.limits.most) if self.most is None else self.most

    @property
    def diagonal(self) -> FloatArray:
        """(m,) of the gram matrix."""
        return np.ascontiguousarray(self.gram.diagonal())

    def fit(self, members: IntArray) -> Fit:
        """Return the best curvatures of a set."""
        given = self.gram, self.slope, self.constant, self.least, self._upper, self.limits.total
        fitted = Fit(*fit_members(*given, members))
        return fitted if fitted.energy >= 0 else replace(fitted, energy=above_rounding(fitted.energy))

    def energy(self, members: IntArray) -> float:
        """Return E^2 of a set, infinite where bounds leave no curvatures."""
        return self.fit(members).energy

    def additions(self, members: IntArray) -> FloatArray:
        """Return (m,) by how much E^2 changes if a candidate joins the members (0 or less), bounds of others aside."""
        limits, diagonal, fitted = self.limits, self.diagonal, self.fit(members)
        if limits.has_sum and not len(members):
            change: FloatArray = (2 * self.slope + diagonal * limits.total) * limits.total
            return change
        least, most, free = self.least, self._upper, members[self._are_inside(members, fitted)]
        if not fitted.feasible:  # then none is bounded
            least, most, free = (
                np.full_like(self.least, -math.inf),
                np.full_like(self.least, math.inf),
                members,
            )
        if limits.has_sum and not len(free):
            free = members[:1]
        gradient = gradients(self.gram, self.slope, members, fitted.curvatures, fitted.multiplier)
        return addition_scores(self.gram, diagonal, gradient, free, least, most, limits.has_sum)

    def _are_inside(self, members: IntArray, fitted: Fit) -> BoolArray:
        """Return a mask of the members whose curvature no bound holds."""
        k = fitted.curvatures
        span = 1e-9 * (1.0 + np.abs(k))
        inside: BoolArray = (k < self._upper[members] - span) & (k > self.least[members] + span)
        return inside

    def grown(self, members: IntArray, usable: BoolArray | None = None) -> IntArray | None:
        """Return the members and the usable candidate that scores best; None if there is none left."""
        is_open = (self.usable if usable is None else usable).copy()
        is_open[members] = False
        left = np.flatnonzero(is_open)
        missing = self.limits.total - self.least[members].sum()
        if self.limits.has_sum and missing < 0:
            # Too few to carry the total: those that can carry what is missing, or else some of it.
            carrying = (left[self.least[left] <= missing], left[self.least[left] < 0])
            left = next((each for each in carrying if len(each)), left)
        if not len(left):
            return None
        return np.append(members, left[first_least(self.additions(members)[left])])

    def shrunk(self, members: IntArray) -> IntArray | None:
        """Return the members without the one that is missed least; None if none can go.

        Those are fitted without that cost least while the others are refitted freely.
        """
        places = np.arange(len(self.fixed), len(members))
        if not len(places):
            return None
        kept = project(self.gram, self.diagonal, members, self.limits.has_sum, True)[2]
        loss = self.fit(members).curvatures[places] ** 2 / np.maximum(kept[places], 1e-300)
        places = places[np.argsort(loss, kind="stable")[:FITTED]]
        energies = np.array([self.energy(np.delete(members, place)) for place in places])
        chosen = first_least(energies)
        return np.delete(members, places[chosen]) if np.isfinite(energies[chosen]) else None

    def best_swaps(self, members: IntArray, fitted: Fit) -> tuple[FloatArray, IntArray]:
        """Return for each member the change of E^2 by its best replacement, and which that is; infinite if not known.

        Removing a member is a rank one change of the inverse, so all members against all candidates cost little more
        than scoring the candidates once. Members held at a bound, and the required, are left out.
        """
        limits, diagonal = self.limits, self.diagonal
        change, which = np.full(len(members), np.inf), np.full(len(members), -1)
        places = np.flatnonzero(self._are_inside(members, fitted))
        if not len(places):
            return change, which
        gradient = gradients(self.gram, self.slope, members, fitted.curvatures, fitted.multiplier)
        remain, rows, kept, bare = project(self.gram, diagonal, members[places], limits.has_sum, True)
        movable = np.flatnonzero((places >= len(self.fixed)) & (kept > 1e-10 * bare))
        places = places[movable]
        is_open = self.usable.copy()
        is_open[members] = False
        change[places], which[places] = swap_table(
            np.ascontiguousarray(rows[movable]),
            kept[movable],
            fitted.curvatures[places],
            gradient,
            remain,
            1e-9 * diagonal,
            is_open,
            self.least,
            self._upper,
            TIE,
        )
        return change, which

    def exchanged(self, members: IntArray) -> ConeSet:
        """Return the set after members, one at a time, were replaced as long as E^2 falls. The required ones stay."""
        fitted: Fit | None = self.fit(members)
        found = ConeSet(math.inf, members)
        while fitted is not None:
            found = ConeSet(fitted.energy, members)
            members = members.copy()
            fitted = self._swapped(members, fitted) if fitted.feasible else None
        return found

    def _swapped(self, members: IntArray, fitted: Fit) -> Fit | None:
        """Make the best swap that the table shows, in place."""
        change, which = self.best_swaps(members, fitted)
        for _ in range(min(FITTED, len(members))):
            place = first_least(change)
            if not change[place] <= -GAIN * fitted.energy:
                break
            change[place] = np.inf
            previous, members[place] = members[place], which[place]
            found = self.fit(members)
            if found.energy < fitted.energy * (1 - GAIN):
                return found
            members[place] = previous
        return None

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
        random = np.random.default_rng(seed)
        fixed, found = len(self.fixed), False
        for i in range(tries if size - fixed >= 2 else 0):
            members = self.best[size].members
            out = fixed + random.choice(size - fixed, min(2 + i % 2, size - fixed), replace=False)
            usable = self.usable.copy()
            usable[members[out]] = False
            rest: IntArray | None = np.delete(members, out)
            while rest is not None and len(rest) < size:
                rest = self.grown(rest, usable)
            if rest is not None:
                found |= self.best.offer(self.exchanged(rest))
        return found
