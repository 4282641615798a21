"""Sets of cones with whole numbers of quanta, on a dense model: for each number of cones, the best found."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .._arrays import FloatArray, IntArray
from .dense_model import DenseModel, above_rounding
from .fit_kernel import fit_curvatures
from .lattice_kernel import best_merge, best_split, descend_lattice, lattice_energy


@dataclass(frozen=True, eq=False)
class Charges:
    """Cones with quanta.

    Attributes:
        energy: E^2.
        members: (s,) candidates, the required ones first.
        units: (s,) quanta of each, none of them 0.
    """

    energy: float
    members: IntArray
    units: IntArray

    def __len__(self) -> int:
        return len(self.members)


@dataclass(eq=False)
class Lattice:
    """Charges on the candidates of a dense model.

    Attributes:
        model: the energies.
        quantum: radians.
        least, most: of the quanta of a cone.
        total: what the quanta sum to, None on a bounded mesh.
        best: number of cones -> the best charges found.
    """

    model: DenseModel
    quantum: float
    least: int
    most: int
    total: int | None
    best: dict[int, Charges] = field(default_factory=dict)

    @property
    def _arrays(self) -> tuple[FloatArray, FloatArray]:
        return self.model.gram, self.model.slope

    def offer(self, charges: Charges | None) -> bool:
        """Keep charges if they are the best of their number."""
        if charges is None:
            return False
        known = self.best.get(len(charges))
        if known is None or charges.energy < known.energy * (1 - 1e-7):
            self.best[len(charges)] = charges
            return True
        return False

    def descended(self, members: IntArray, units: IntArray) -> Charges:
        """Return charges after moves have come to rest."""
        members, units = members.copy(), units.copy()
        fixed = len(self.model.fixed)
        energy = descend_lattice(
            *self._arrays,
            self.model.constant,
            members,
            units,
            fixed,
            self.least,
            self.most,
            self.quantum,
            self.total is not None,
            self.model.usable,
        )
        return Charges(above_rounding(energy), members, units)

    def with_energy(self, members: IntArray, units: IntArray) -> Charges:
        """Return charges as they are."""
        energy = lattice_energy(*self._arrays, self.model.constant, members, units, self.quantum)
        return Charges(above_rounding(energy), members, units)

    def grown(self, charges: Charges) -> Charges | None:
        """Return charges with one more cone (two more, of opposite sign, if there were none and the sum is 0)."""
        if not len(charges) and self.total is not None:
            return self._dipole()
        chosen, amount, place = best_split(
            *self._arrays,
            charges.members,
            charges.units,
            self.least,
            self.most,
            self.quantum,
            self.total is not None,
            self.model.usable,
        )
        if chosen < 0:
            return None
        units = np.append(charges.units, amount)
        if place >= 0:
            units[place] -= amount
        return self.descended(np.append(charges.members, chosen), units)

    def _dipole(self) -> Charges | None:
        gram, slope = self._arrays
        allowed = np.flatnonzero(self.model.usable)
        if self.total != 0 or self.least > -1 or self.most < 1 or len(allowed) < 2:
            return None
        norm = np.diag(gram)[allowed]
        change = 2 * self.quantum * (slope[allowed][:, None] - slope[allowed]) + self.quantum**2 * (
            norm[:, None] + norm - 2 * gram[np.ix_(allowed, allowed)]
        )
        np.fill_diagonal(change, np.inf)
        pair = np.array(np.unravel_index(np.argmin(change), change.shape))
        return self.descended(allowed[pair], np.array([1, -1]))

    def without(self, charges: Charges, place: int) -> Charges | None:
        """Return charges with the cone at a place merged into the one that takes its quanta best."""
        heir, _ = best_merge(
            *self._arrays,
            charges.members,
            charges.units,
            place,
            self.least,
            self.most,
            self.quantum,
            self.total is not None,
        )
        if heir == -2:
            return None
        units = charges.units.copy()
        if heir >= 0:
            units[heir] += units[place]
        return self.with_energy(np.delete(charges.members, place), np.delete(units, place))

    def shrunk(self, charges: Charges) -> Charges | None:
        """Return charges with one cone less, the best after moves."""
        found = None
        for place in range(len(self.model.fixed), len(charges)):
            rest = self.without(charges, place)
            if rest is not None:
                rest = self.descended(rest.members, rest.units)
                if found is None or rest.energy < found.energy:
                    found = rest
        return found

    def exchanged(self, charges: Charges) -> Charges:
        """Return charges after merging and splitting cones, one pair at a time, has come to rest."""
        place, unchanged, fixed = len(self.model.fixed), 0, len(self.model.fixed)
        while unchanged < len(charges) - fixed:
            rest = self.without(charges, place)
            again = None if rest is None or not len(rest) else self.grown(rest)
            if again is not None and again.energy < charges.energy * (1 - 1e-6):
                charges, unchanged = again, 0
            else:
                unchanged += 1
            place = place + 1 if place + 1 < len(charges) else fixed
        return charges

    def rounded(self, members: IntArray) -> Charges | None:
        """Return members with quanta by rounding their best curvatures, the surest first, the others refitted.

        This is Babai's nearest plane in an order of its own. Members that round to nothing are left out, unless
        required. None if the sum is missed.
        """
        model, quantum = self.model, self.quantum
        units = np.zeros(len(members), dtype=np.int64)
        open_places = list(range(len(members)))
        gram = model.gram[np.ix_(members, members)]
        slope = model.slope[members]
        while open_places:
            done = [i for i in range(len(members)) if i not in open_places]
            part = slope[open_places] + gram[np.ix_(open_places, done)] @ (quantum * units[done])
            left = np.nan if self.total is None else quantum * (self.total - units[done].sum())
            small = gram[np.ix_(open_places, open_places)]
            curvatures, _, feasible = fit_curvatures(
                small,
                part,
                np.full(len(part), float(self.least * quantum)),
                np.full(len(part), float(self.most * quantum)),
                float(left),
            )
            if not feasible:
                return None
            off = np.abs(curvatures / quantum - np.round(curvatures / quantum))
            surest = int(np.argmin(off))
            place = open_places.pop(surest)
            value = int(np.clip(np.round(curvatures[surest] / quantum), self.least, self.most))
            units[place] = value if value or place >= len(model.fixed) else 1
        if self.total is not None and units.sum() != self.total:
            return None
        keep = units != 0
        return self.descended(members[keep], units[keep]) if keep.any() or self.total in (0, None) else None
