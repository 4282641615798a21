"""Energies of cones on a dense model, and the best exchange of one cone for another.

The distortion of cones S with curvatures k is E^2 = constant + 2 slope_S k + k gram_SS k. With the other cones
refitted freely, candidate t lowers it by (slope_t + gram_tS k + lambda)^2 / h_t, where h_t is what remains of gram_tt
after projection (orthogonal matching pursuit: Y. Pati, R. Rezaiifar, P. Krishnaprasad 1993). All candidates are
scored at once; the few best are fitted exactly, bounds and all.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray

# An exchange must lower E^2 by this share, so that rounding cannot make the search go round in circles.
GAIN = 1e-6
# How many of the best scored candidates are fitted exactly, and how much worse than the best so far the score of such
# a one may be: scores leave out that bounds of other cones may become active, or cease to be.
FITTED = 5
DOUBT = 0.03
# Sets of more cones than this are improved with less care, for time.
MANY = 40
# Changes that differ by less, relatively, are equal, and the first in the order of candidates is taken: symmetric
# surfaces have many that differ by rounding only.
TIE = 1e-9


def above_rounding(energy: float) -> float:
    """Return E^2, which rounding may have made less than nothing: gains are shares of it, and must not be losses."""
    return max(float(energy), 0.0)


@dataclass(frozen=True)
class Limits:
    """What curvatures may be.

    Attributes:
        least, most: bounds of each cone's curvature, radians.
        total: what they sum to, radians; NaN on a bounded mesh, whose boundary takes the rest.
    """

    least: float
    most: float
    total: float

    @property
    def has_sum(self) -> bool:
        """Whether the curvatures have a sum to keep."""
        return not math.isnan(self.total)

    def text(self) -> str:
        """Return the bounds for a message."""
        if not math.isfinite(self.least):
            return f"up to {self.most / math.pi:.4g} pi"
        return f"{self.least / math.pi:.4g} pi to {self.most / math.pi:.4g} pi"

    @property
    def fewest(self) -> int:
        """The least number of cones that can carry the total."""
        if not self.has_sum or abs(self.total) < 1e-9:
            return 0
        bound = self.most if self.total > 0 else self.least
        return math.ceil(self.total / bound - 1e-9) if math.isfinite(bound) else 1


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
    from .fit_kernel import index_of_least

    return int(index_of_least(values, TIE))


def is_less(value: float, than: float) -> bool:
    """Whether a value is less by more than rounding."""
    return value < than - (TIE * abs(than) if math.isfinite(than) else 0.0)


@dataclass(eq=False)
class DenseModel:
    """Energies of cones on m candidates.

    Attributes:
        gram, slope, constant: (m, m), (m,) and a number.
        usable: (m,) whether a candidate may be chosen; False for required ones, which are in every set.
        fixed: the required candidates, which come first in every set.
        limits: of the curvatures.
        least: (m,) bound of the curvature at each candidate, the limit or above.
    """

    gram: FloatArray
    slope: FloatArray
    constant: float
    usable: BoolArray
    fixed: IntArray
    limits: Limits
    least: FloatArray
    _diagonal: tuple[FloatArray, FloatArray] | None = field(default=None, init=False, repr=False)

    @property
    def diagonal(self) -> FloatArray:
        """(m,) the diagonal of the gram matrix."""
        if self._diagonal is None or self._diagonal[0] is not self.gram:
            self._diagonal = self.gram, np.ascontiguousarray(np.diag(self.gram))
        return self._diagonal[1]

    def are_inside(self, members: IntArray, curvatures: FloatArray) -> BoolArray:
        """Return a mask of the members whose curvature no bound holds."""
        span = 1e-9 * (1.0 + np.abs(curvatures))
        inside: BoolArray = (curvatures < self.limits.most - span) & (curvatures > self.least[members] + span)
        return inside

    def fit(self, members: IntArray) -> Fit:
        """Return the best curvatures of a set."""
        from .fit_kernel import fit_members

        limits = self.limits
        given = self.gram, self.slope, self.constant, self.least, limits.most, limits.total
        fitted = Fit(*fit_members(*given, members))
        return fitted if fitted.energy >= 0 else replace(fitted, energy=above_rounding(fitted.energy))

    def energy(self, members: IntArray) -> float:
        """Return E^2 of a set, infinite where bounds leave no curvatures."""
        return self.fit(members).energy

    def additions(self, members: IntArray, fitted: Fit) -> FloatArray:
        """Return (m,) by how much E^2 changes if a candidate joins the members (0 or less), bounds of others aside."""
        from .project_kernel import addition_scores, gradients

        limits, diagonal = self.limits, self.diagonal
        # Where no curvatures are feasible, none is bounded.
        least, most = (
            (self.least, limits.most) if fitted.feasible else (np.full_like(self.least, -math.inf), math.inf)
        )
        if limits.has_sum and not len(members):
            change: FloatArray = (2 * self.slope + diagonal * limits.total) * limits.total
            return change
        free = members[self.are_inside(members, fitted.curvatures)] if fitted.feasible else members
        if limits.has_sum and not len(free):
            free = members[:1]
        gradient = gradients(self.gram, self.slope, members, fitted.curvatures, fitted.multiplier)
        return addition_scores(self.gram, diagonal, gradient, free, least, most, limits.has_sum)

    def best_addition(
        self, members: IntArray, usable: BoolArray, limit: float = math.inf
    ) -> tuple[int, float]:
        """Return the candidate that lowers E^2 most, and E^2 with it; -1 if none brings it under the limit.

        Args:
            members: the set.
            usable: (m,) the candidates that may join.
            limit: of E^2.
        """
        fitted = self.fit(members)
        change = np.where(usable, self.additions(members, fitted), 0.0)
        change[members] = 0.0
        chosen, best = -1, limit
        for t, found in self._tried(members, change, fitted, limit):
            if is_less(found, best):
                chosen, best = t, found
        return chosen, best

    def _tried(
        self, members: IntArray, change: FloatArray, fitted: Fit, limit: float
    ) -> Iterator[tuple[int, float]]:
        """Yield the candidates that promise the largest change, if any does, and E^2 with each of them."""
        from .project_kernel import energies_with

        tried = []
        for _ in range(FITTED if fitted.feasible else 3 * FITTED):
            t = first_least(change) if len(change) else -1
            if t < 0 or change[t] >= 0:
                break
            if fitted.feasible and fitted.energy + change[t] > limit + DOUBT * abs(limit):
                break
            change[t] = 0.0
            tried.append(t)
        limits, joining = self.limits, np.array(tried, dtype=np.int64)
        given = self.gram, self.slope, self.constant, self.least, limits.most, limits.total
        yield from zip(tried, energies_with(*given, members, joining).tolist(), strict=True)

    def grown(self, members: IntArray) -> IntArray | None:
        """Return the members and the best further one, if there is any."""
        chosen = -1
        if len(members) + 1 >= self.limits.fewest:
            chosen, _ = self.best_addition(members, self.usable)
        if chosen < 0:
            # No further one makes curvatures feasible yet, or lowers E: the best of those that can carry some.
            left = np.setdiff1d(np.flatnonzero(self.usable), members)
            if not len(left):
                return None
            carrying = left[self.least[left] < 0] if self.limits.total < 0 else left
            left = carrying if len(carrying) else left
            chosen = int(left[first_least(self.additions(members, self.fit(members))[left])])
        return np.append(members, chosen)

    def shrunk(self, members: IntArray) -> IntArray | None:
        """Return the members without the one that is missed least."""
        from .project_kernel import project

        places = np.arange(len(self.fixed), len(members))
        if len(places) > MANY:
            # Too many to fit the rest without each: only those that cost least while others are refitted freely.
            fitted = self.fit(members)
            kept = project(self.gram, self.diagonal, members, self.limits.has_sum, True)[2]
            loss = fitted.curvatures[places] ** 2 / np.maximum(kept[places], 1e-300)
            places = places[np.argsort(loss, kind="stable")[:FITTED]]
        chosen, best = None, math.inf
        for place in places:
            rest = np.delete(members, place)
            energy = self.energy(rest)
            if is_less(energy, best):
                chosen, best = rest, energy
        return chosen

    def best_swaps(self, members: IntArray, fitted: Fit) -> tuple[FloatArray, IntArray]:
        """Return for each member the change of E^2 by its best replacement, and which that is; infinite if not known.

        Removing a member is a rank one change of the inverse, so all members against all candidates cost little more
        than scoring the candidates once. Members held at a bound, and the required, are left out.
        """
        from .project_kernel import gradients, project
        from .swap_kernel import swap_table

        limits, diagonal = self.limits, self.diagonal
        change, which = np.full(len(members), np.inf), np.full(len(members), -1)
        places = np.flatnonzero(self.are_inside(members, fitted.curvatures))
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
            limits.most,
            TIE,
        )
        return change, which

    def exchanged(self, members: IntArray) -> tuple[float, IntArray]:
        """Replace members, one at a time, as long as E^2 falls; return it and the members. The required ones stay."""
        members = members.copy()
        fitted = self.fit(members)
        lost = 0  # swaps since when there have been no feasible curvatures: they may go round in circles
        while len(members) > len(self.fixed) and len(members) >= self.limits.fewest and lost <= len(members):
            better = self._swapped(members, fitted) if fitted.feasible else None
            if better is None:
                better = self._swapped_one_by_one(members, fitted)
            if better is None:
                break
            fitted = better
            lost += not fitted.feasible
        return fitted.energy, members

    def _swapped(self, members: IntArray, fitted: Fit) -> Fit | None:
        """Make the best swap that the table shows, in place."""
        change, which = self.best_swaps(members, fitted)
        for _ in range(FITTED):
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

    def _swapped_one_by_one(self, members: IntArray, fitted: Fit) -> Fit | None:
        """Swap, in place, what the table leaves out: members held at a bound, or any where none are feasible.

        In large sets the former stay: each takes as long as the whole table.
        """
        if fitted.feasible and len(members) > MANY:
            return None
        limit = fitted.energy * (1 - GAIN) if fitted.feasible else math.inf
        inside = self.are_inside(members, fitted.curvatures) & fitted.feasible
        for place in range(len(self.fixed), len(members)):
            if not inside[place]:
                chosen, _ = self.best_addition(np.delete(members, place), self.usable, limit)
                if chosen >= 0 and chosen != members[place]:
                    previous, members[place] = members[place], chosen
                    found = self.fit(members)
                    if found.energy < limit or not fitted.feasible:
                        return found
                    members[place] = previous
        return None

    def refilled(self, members: IntArray, out: IntArray) -> tuple[float, IntArray]:
        """Take the members at the places `out` away, put the best others in, exchange; return E^2 and the members."""
        open_to = self.usable.copy()
        open_to[members[out]] = False
        rest = np.delete(members, out)
        while len(rest) < len(members):
            chosen, _ = self.best_addition(rest, open_to)
            if chosen < 0:
                # No feasible curvatures yet: any candidate that is not in will do, the exchange sorts it out.
                left = np.setdiff1d(np.flatnonzero(open_to), rest)
                if not len(left):
                    return math.inf, members
                chosen = int(left[0])
            rest = np.append(rest, chosen)
        return self.exchanged(rest)
