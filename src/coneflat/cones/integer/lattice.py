"""Sets of cones with integer multiples of a quantum as curvatures, on a dense model, and moves that improve them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...base.arrays import FloatArray, IntArray
from ..sparse.dense_model import MIN_RELATIVE_GAIN, BestSets, ConeSet, DenseModel, nonnegative
from ..sparse.fit_curvatures import fit_curvatures
from .moves import Quanta, best_merge, best_pair, best_split, descend, energy_of

# Largest number of exchanges that are tried in a call, times the number of cones. With 100 instead of 10 exchanges of
# 100 cones, the search takes twice as long and finds no fewer cones.
MAX_EXCHANGES = 1000


@dataclass(frozen=True, eq=False)
class IndexedCones(ConeSet):
    """A set of cones with integer indices.

    Attributes:
        indices: (s,) curvature of each cone in quanta, not 0.
    """

    indices: IntArray


@dataclass(eq=False)
class Lattice:
    """Sets of indexed cones on the candidates of a dense model, and the best ones found.

    Attributes:
        model: the dense model with the energies.
        quanta: the quantum and the bounds of the indices.
        total: sum of the indices; None on a mesh with boundary.
        best: the best set found of each number of cones.
    """

    model: DenseModel
    quanta: Quanta
    total: int | None
    best: BestSets[IndexedCones] = field(default_factory=BestSets)

    @property
    def fewest(self) -> int:
        """The smallest number of cones that can absorb the total curvature."""
        if not self.total:
            return 0
        return -(-self.total // (self.quanta.upper if self.total > 0 else self.quanta.lower))

    def curvatures(self, cones: IndexedCones) -> FloatArray:
        """Return (s,) the curvatures of cones, radians."""
        return (self.quanta.quantum * cones.indices).astype(np.float64)

    def descended(self, members: IntArray, indices: IntArray) -> IndexedCones:
        """Return cones (s,) improved by moves until none lowers E^2; their number stays the same."""
        model, members, indices = self.model, members.copy(), indices.copy()
        fixed = len(model.fixed)
        energy = descend(
            model.gram, model.slope, model.constant, members, indices, fixed, self.quanta, model.usable
        )
        return IndexedCones(nonnegative(energy), members, indices)

    def grown(self, cones: IndexedCones) -> IndexedCones | None:
        """Return cones with one cone more (two more, of opposite sign, if there was none and the sum is 0), or None."""
        if not len(cones) and self.total is not None:
            return self.grown_by_pair(cones)
        model, indices = self.model, cones.indices
        chosen, amount, giver = best_split(
            model.gram, model.slope, cones.members, indices, self.quanta, model.usable
        )
        if chosen < 0:
            return None
        indices = np.append(indices, amount)
        if giver >= 0:
            indices[giver] -= amount
        return self.descended(np.append(cones.members, chosen), indices)

    def grown_by_pair(self, cones: IndexedCones) -> IndexedCones | None:
        """Return cones with two cones more, of one quantum each and opposite sign, or None."""
        model, (quantum, lower, upper, _) = self.model, self.quanta
        if lower > -1 or upper < 1:
            return None
        pair = best_pair(model.gram, model.slope, cones.members, cones.indices, quantum, model.usable)
        if pair is None:
            return None
        return self.descended(np.append(cones.members, pair), np.append(cones.indices, [1, -1]))

    def merged(self, cones: IndexedCones, place: int) -> IndexedCones | None:
        """Return cones without the one at an index; the best other cone takes its quanta. None if there is none."""
        model = self.model
        can_go, taker = best_merge(model.gram, model.slope, cones.members, cones.indices, place, self.quanta)
        if not can_go:
            return None
        indices = cones.indices.copy()
        if taker >= 0:
            indices[taker] += indices[place]
        members, indices = np.delete(cones.members, place), np.delete(indices, place)
        energy = energy_of(model.gram, model.slope, model.constant, members, indices, self.quanta.quantum)
        return IndexedCones(nonnegative(energy), members, indices)

    def shrunk(self, cones: IndexedCones) -> IndexedCones | None:
        """Return the best set with one cone less, after moves, or None."""
        best = None
        for place in range(len(self.model.fixed), len(cones)):
            remaining = self.merged(cones, place)
            if remaining is not None:
                remaining = self.descended(remaining.members, remaining.indices)
                if best is None or remaining.energy < best.energy:
                    best = remaining
        return best

    def exchanged(self, cones: IndexedCones) -> IndexedCones:
        """Return cones improved by removing one cone and adding another, until there is no gain or the limit."""
        fixed = len(self.model.fixed)
        place, unchanged = fixed, 0
        for _ in range(MAX_EXCHANGES // max(len(cones), 1)):
            if unchanged >= len(cones) - fixed:
                break
            remaining = self.merged(cones, place)
            exchanged = None if remaining is None or not len(remaining) else self.grown(remaining)
            if exchanged is not None and exchanged.energy < cones.energy * (1 - MIN_RELATIVE_GAIN):
                cones, unchanged = exchanged, 0
            else:
                unchanged += 1
            place = place + 1 if place + 1 < len(cones) else fixed
        return cones

    def rounded(self, members: IntArray) -> IndexedCones | None:
        """Return cones with indices from rounding the best curvatures of members (s,); None if the sum is wrong.

        The curvature nearest to a multiple is rounded first, and the others are refitted: this is Babai's nearest plane
        algorithm in a special order. Members that are rounded to 0 are removed unless they are required.
        """
        model, (quantum, lower, upper, _) = self.model, self.quanta
        indices, is_open = np.zeros(len(members), dtype=np.int64), np.ones(len(members), dtype=bool)
        gram, slope = model.gram[np.ix_(members, members)], model.slope[members]
        best = np.full(len(members), np.nan)
        while is_open.any():
            places, done = np.flatnonzero(is_open), np.flatnonzero(~is_open)
            open_slope = slope[places] + gram[np.ix_(places, done)] @ (quantum * indices[done])
            open_total = np.nan if self.total is None else quantum * (self.total - indices[done].sum())
            low, high = (np.full(len(open_slope), float(bound * quantum)) for bound in (lower, upper))
            open_gram = gram[np.ix_(places, places)]
            best[places], _, feasible = fit_curvatures(
                open_gram, open_slope, low, high, float(open_total), best[places]
            )
            if not feasible:
                return None
            nearest = np.round(best[places] / quantum)
            closest = int(np.argmin(np.abs(best[places] / quantum - nearest)))
            place, value = places[closest], int(np.clip(nearest[closest], lower, upper))
            is_open[place] = False
            indices[place] = value if value or place >= len(model.fixed) else 1
        if self.total is not None and indices.sum() != self.total:
            return None
        keep = indices != 0
        return self.descended(members[keep], indices[keep]) if keep.any() or self.total in (0, None) else None

    def initial_cones(self, count: int) -> IndexedCones | None:
        """Return initial cones, at most `count`, that satisfy sum and bounds; None if there are none."""
        model, (_, lower, upper, _) = self.model, self.quanta
        steepest = np.flatnonzero(model.usable)[np.argsort(model.slope[model.usable], kind="stable")]
        members = np.concatenate([model.fixed, steepest])[:count]
        if self.total is None or not len(members):
            signs = np.where(model.slope[members] < 0, 1, -1)
            indices = np.clip(signs, lower, upper)
            return self.descended(members[indices != 0], indices[indices != 0])
        share = np.full(len(members), self.total // len(members))
        share[: self.total - share.sum()] += 1
        if (share == 0).any() or share.max() > upper or share.min() < lower:
            return None
        return self.descended(members, share)
