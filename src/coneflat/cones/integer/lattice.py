"""Sets of cones whose curvatures are whole multiples of a quantum, on a dense model, and the moves that improve them.

All moves transfer d quanta from cone s to vertex t, which changes E^2 by
2 d q (slope_t - slope_s) + d^2 q^2 (gram_ss + gram_tt - 2 gram_st), slopes taken at the current curvatures.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ..._arrays import BoolArray, FloatArray, IntArray
from ...compiled import compiled
from ..sparse.best_sets import BestSets
from ..sparse.dense_model import DenseModel, above_rounding
from ..sparse.fit_curvatures import fit_curvatures
from ..sparse.scores import gradients

# A move must lower E^2 by this share, and an exchange of cones by that, or rounding could make them go in circles.
GAIN, EXCHANGE_GAIN = 1e-9, 1e-6
# Changes that differ by less, relatively, are equal, and the first met is taken.
TIE = 1e-9
# Transfers of up to so many quanta at once, either way: of the quarter turns there is room for no more in a cone.
REACH = 3


class Quanta(NamedTuple):
    """What the cone indices may be.

    Attributes:
        quantum: radians.
        least, most: bounds of each index.
        has_sum: whether the indices have a sum to keep.
    """

    quantum: float
    least: int
    most: int
    has_sum: bool


@dataclass(frozen=True, eq=False)
class IndexedCones:
    """Cones with their indices.

    Attributes:
        energy: E^2.
        members: (s,) candidates, the required ones first.
        indices: (s,) quanta of each, none of them 0.
    """

    energy: float
    members: IntArray
    indices: IntArray

    def __len__(self) -> int:
        return len(self.members)


@dataclass(eq=False)
class Lattice:
    """Indexed cones on the candidates of a dense model, and the best that were found.

    Attributes:
        model: the energies.
        quanta: bounds of the indices.
        total: what the indices sum to, None on a bounded mesh.
        best: by number of cones.
    """

    model: DenseModel
    quanta: Quanta
    total: int | None
    best: BestSets[IndexedCones] = field(default_factory=BestSets)

    @property
    def fewest(self) -> int:
        """The least number of cones that can carry the total."""
        if not self.total:
            return 0
        return -(-self.total // (self.quanta.most if self.total > 0 else self.quanta.least))

    def curvatures(self, cones: IndexedCones) -> FloatArray:
        """Return (s,) the curvatures of cones, radians."""
        return (self.quanta.quantum * cones.indices).astype(np.float64)

    def descended(self, members: IntArray, indices: IntArray) -> IndexedCones:
        """Return cones after moves have come to rest; their number stays."""
        model, members, indices = self.model, members.copy(), indices.copy()
        fixed = len(model.fixed)
        energy = descend(
            model.gram, model.slope, model.constant, members, indices, fixed, self.quanta, model.usable
        )
        return IndexedCones(above_rounding(energy), members, indices)

    def grown(self, cones: IndexedCones) -> IndexedCones | None:
        """Return cones with one more (two more, of opposite sign, if there were none and the sum is 0)."""
        if not len(cones) and self.total is not None:
            return self._dipole()
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

    def _dipole(self) -> IndexedCones | None:
        gram, slope, quantum = self.model.gram, self.model.slope, self.quanta.quantum
        allowed = np.flatnonzero(self.model.usable)
        if self.total != 0 or self.quanta.least > -1 or self.quanta.most < 1 or len(allowed) < 2:
            return None
        norm = np.diag(gram)[allowed]
        change = 2 * quantum * (slope[allowed][:, None] - slope[allowed]) + quantum**2 * (
            norm[:, None] + norm - 2 * gram[np.ix_(allowed, allowed)]
        )
        np.fill_diagonal(change, np.inf)
        pair = np.array(np.unravel_index(np.argmin(change), change.shape))
        return self.descended(allowed[pair], np.array([1, -1]))

    def without(self, cones: IndexedCones, place: int) -> IndexedCones | None:
        """Return cones with the one at a place merged into the one that takes its quanta best."""
        model = self.model
        heir = best_merge(model.gram, model.slope, cones.members, cones.indices, place, self.quanta)
        if heir == NOBODY:
            return None
        indices = cones.indices.copy()
        if heir >= 0:
            indices[heir] += indices[place]
        members, indices = np.delete(cones.members, place), np.delete(indices, place)
        energy = energy_of(model.gram, model.slope, model.constant, members, indices, self.quanta.quantum)
        return IndexedCones(above_rounding(energy), members, indices)

    def shrunk(self, cones: IndexedCones) -> IndexedCones | None:
        """Return cones with one less, the best after moves."""
        found = None
        for place in range(len(self.model.fixed), len(cones)):
            rest = self.without(cones, place)
            if rest is not None:
                rest = self.descended(rest.members, rest.indices)
                if found is None or rest.energy < found.energy:
                    found = rest
        return found

    def exchanged(self, cones: IndexedCones) -> IndexedCones:
        """Return cones after merging and splitting, one pair at a time, has come to rest."""
        fixed = len(self.model.fixed)
        place, unchanged = fixed, 0
        while unchanged < len(cones) - fixed:
            rest = self.without(cones, place)
            again = None if rest is None or not len(rest) else self.grown(rest)
            if again is not None and again.energy < cones.energy * (1 - EXCHANGE_GAIN):
                cones, unchanged = again, 0
            else:
                unchanged += 1
            place = place + 1 if place + 1 < len(cones) else fixed
        return cones

    def rounded(self, members: IntArray) -> IndexedCones | None:
        """Return cones with indices by rounding their best curvatures, the surest first, the others refitted.

        This is Babai's nearest plane in an order of its own. Members that round to nothing are left out, unless
        required. None if the sum is missed.
        """
        model, (quantum, least, most, _) = self.model, self.quanta
        indices = np.zeros(len(members), dtype=np.int64)
        is_open = np.ones(len(members), dtype=bool)
        gram, slope = model.gram[np.ix_(members, members)], model.slope[members]
        while is_open.any():
            places, done = np.flatnonzero(is_open), np.flatnonzero(~is_open)
            part = slope[places] + gram[np.ix_(places, done)] @ (quantum * indices[done])
            left = np.nan if self.total is None else quantum * (self.total - indices[done].sum())
            low, high = (np.full(len(part), float(bound * quantum)) for bound in (least, most))
            curvatures, _, feasible = fit_curvatures(
                gram[np.ix_(places, places)], part, low, high, float(left)
            )
            if not feasible:
                return None
            nearest = np.round(curvatures / quantum)
            surest = int(np.argmin(np.abs(curvatures / quantum - nearest)))
            place, value = places[surest], int(np.clip(nearest[surest], least, most))
            is_open[place] = False
            indices[place] = value if value or place >= len(model.fixed) else 1
        if self.total is not None and indices.sum() != self.total:
            return None
        keep = indices != 0
        return self.descended(members[keep], indices[keep]) if keep.any() or self.total in (0, None) else None

    def any_of(self, count: int) -> IndexedCones | None:
        """Return so many cones that keep sum and bounds, to start from."""
        model, (_, least, most, _) = self.model, self.quanta
        steepest = np.flatnonzero(model.usable)[np.argsort(model.slope[model.usable], kind="stable")]
        members = np.concatenate([model.fixed, steepest])[:count]
        if self.total is None or not len(members):
            signs = np.where(model.slope[members] < 0, 1, -1)
            indices = np.clip(signs, least, most)
            return self.descended(members[indices != 0], indices[indices != 0])
        share = np.full(len(members), self.total // len(members))
        share[: self.total - share.sum()] += 1
        if (share == 0).any() or share.max() > most or share.min() < least:
            return None
        return self.descended(members, share)


@compiled
def energy_of(
    gram: FloatArray, slope: FloatArray, constant: float, members: IntArray, indices: IntArray, quantum: float
) -> float:
    """Return E^2."""
    energy = constant
    for i in range(len(members)):
        k = quantum * indices[i]
        energy += 2 * k * slope[members[i]]
        for j in range(len(members)):
            energy += k * gram[members[i], members[j]] * quantum * indices[j]
    return energy


@compiled
def slopes(
    gram: FloatArray, slope: FloatArray, members: IntArray, quantum: float, indices: IntArray
) -> FloatArray:
    """Return (m,) half the derivative of E^2 by the curvature of each candidate."""
    return gradients(gram, slope, members, quantum * indices.astype(np.float64), 0.0)


@compiled
def transfer(gram: FloatArray, gradient: FloatArray, s: int, t: int, k: float) -> float:
    """Return the change of E^2 if curvature k goes from vertex s to vertex t."""
    norm = gram[s, s] + gram[t, t] - 2 * gram[s, t]
    return (2 * (gradient[t] - gradient[s]) + k * norm) * k


@compiled
def is_within(index: int, quanta: Quanta) -> bool:
    """Whether a cone may have this index."""
    return index != 0 and quanta.least <= index <= quanta.most


@compiled
def without_members(usable: BoolArray, members: IntArray) -> BoolArray:
    """Return a mask of the usable candidates that are no members."""
    free = usable.copy()
    for member in members:
        free[member] = False
    return free


@compiled
def descend(
    gram: FloatArray,
    slope: FloatArray,
    constant: float,
    members: IntArray,
    indices: IntArray,
    fixed: int,
    quanta: Quanta,
    usable: BoolArray,
) -> float:
    """Make the best move over and over, in place, until none lowers E^2; return it. The number of cones stays.

    Moves: quanta go from one cone to another; a cone goes to another candidate; without a sum to keep, a cone gains
    or loses quanta.
    """
    size, count, quantum = len(members), len(slope), quanta.quantum
    energy = energy_of(gram, slope, constant, members, indices, quantum)
    free = without_members(usable, members)
    for _ in range(100 + 20 * size):  # comes to rest in a few per cone
        gradient = slopes(gram, slope, members, quantum, indices)
        best, kind, one, other, amount = -GAIN * abs(energy), 0, -1, -1, 0
        for i in range(size):
            s = members[i]
            if not quanta.has_sum:
                for d in range(-REACH, REACH + 1):
                    k = quantum * d
                    change = (2 * gradient[s] + k * gram[s, s]) * k
                    if change < best - TIE * abs(best) and is_within(indices[i] + d, quanta):
                        best, kind, one, amount = change, 1, i, d
            for j in range(size):
                for d in range(1, REACH + 1 if i != j else 0):
                    change = transfer(gram, gradient, s, members[j], quantum * d)
                    if (
                        change < best - TIE * abs(best)
                        and is_within(indices[i] - d, quanta)
                        and is_within(indices[j] + d, quanta)
                    ):
                        best, kind, one, other, amount = change, 2, i, j, d
            for t in range(count if i >= fixed else 0):
                if free[t]:
                    change = transfer(gram, gradient, s, t, quantum * indices[i])
                    if change < best - TIE * abs(best):
                        best, kind, one, other = change, 3, i, t
        if kind == 0:
            break
        if kind == 1:
            indices[one] += amount
        elif kind == 2:
            indices[one] -= amount
            indices[other] += amount
        else:
            free[members[one]] = usable[members[one]]
            members[one] = other
            free[other] = False
        energy = energy_of(gram, slope, constant, members, indices, quantum)
    return energy


@compiled
def best_split(
    gram: FloatArray,
    slope: FloatArray,
    members: IntArray,
    indices: IntArray,
    quanta: Quanta,
    usable: BoolArray,
) -> tuple[int, int, int]:
    """Return the best further cone: the candidate, its index, and the place of the cone it takes that from.

    The place is -1 where there is no sum to keep. The candidate is -1 if nothing can be split.
    """
    free = without_members(usable, members)
    gradient = slopes(gram, slope, members, quanta.quantum, indices)
    best, chosen, amount, giver = np.inf, -1, 0, -1
    for d in range(-REACH, REACH + 1):
        if not is_within(d, quanta):
            continue
        k = quanta.quantum * d
        for i in range(len(members) if quanta.has_sum else 1):
            if quanta.has_sum and not is_within(indices[i] - d, quanta):
                continue
            for t in range(len(slope)):
                if free[t]:
                    if quanta.has_sum:
                        change = transfer(gram, gradient, members[i], t, k)
                    else:
                        change = (2 * gradient[t] + k * gram[t, t]) * k
                    if chosen < 0 or change < best - TIE * abs(best):
                        best, chosen, amount, giver = change, t, d, i if quanta.has_sum else -1
    return chosen, amount, giver


# What `best_merge` returns where no cone can take the quanta, and where they just go.
NOBODY, NOWHERE = -2, -1


@compiled
def best_merge(
    gram: FloatArray, slope: FloatArray, members: IntArray, indices: IntArray, place: int, quanta: Quanta
) -> int:
    """Return the place of the cone that best takes all quanta of the one at `place`.

    NOBODY if none can; NOWHERE if it is best that they just go, without a sum to keep.
    """
    gradient = slopes(gram, slope, members, quanta.quantum, indices)
    s = members[place]
    k = quanta.quantum * indices[place]
    best, chosen = np.inf, NOBODY
    if not quanta.has_sum:
        best, chosen = (k * gram[s, s] - 2 * gradient[s]) * k, NOWHERE
    for j in range(len(members)):
        if j != place and is_within(indices[j] + indices[place], quanta):
            change = transfer(gram, gradient, s, members[j], k)
            if chosen == NOBODY or change < best - TIE * abs(best):
                best, chosen = change, j
    return chosen
