"""Exact energies of cones at the vertices tried so far, and moves that improve them."""

from __future__ import annotations

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray
from .aggregate_kernel import ball
from .coarse_model import CoarseModel
from .dense_model import Limits, first_least
from .dense_search import DenseSearch
from .green import GreenOperator

# A move is tried if it promises to lower E^2 by this share.
WORTHWHILE = 1e-3
# Rounds of moves for a set of cones; most come to rest after three or four.
ROUNDS = 12
# A cone is tried at the end of a longer and of a more cautious step, as the distances are those of a coarse model; of
# one in between where the mesh is large and back-substitutions are what takes long.
CAUTIONS, CAUTION, LARGE = (1.0, 4.0), (2.0,), 30_000


class Pool:
    """A dense model on a growing set of vertices, with exact entries."""

    def __init__(
        self,
        operator: GreenOperator,
        coarse: CoarseModel,
        log_scale: FloatArray,
        required: IntArray,
        limits: Limits,
        least: FloatArray,
    ) -> None:
        self._operator = operator
        self._coarse = coarse
        self._usable = np.ones(len(log_scale), dtype=bool)
        self._indptr = operator.laplacian.indptr.astype(np.int64)
        self._indices = operator.laplacian.indices.astype(np.int64)
        self._log_scale = log_scale
        self._slope = operator.solve(operator.weighted(log_scale))
        # The Green's functions of the unknowns, in blocks as they came.
        self._responses: list[FloatArray] = []
        self.unknowns: IntArray = np.empty(0, dtype=np.int64)
        none = np.empty(0)
        self.model = DenseSearch(
            np.empty((0, 0)), none, coarse.constant, none.astype(bool), np.arange(len(required)), limits, none
        )
        self._least = least
        self.insert(required)

    def restrict(self, usable: BoolArray) -> None:
        """Let cones move to the (f,) usable unknowns alone, and forget the sets found; energies stay known."""
        self._usable = usable
        model = self.model
        self.model = DenseSearch(
            model.gram,
            model.slope,
            model.constant,
            usable[self.unknowns],
            model.fixed,
            model.limits,
            model.least,
        )

    def insert(self, unknowns: IntArray) -> IntArray:
        """Add vertices, if they are not in, and return the places of all."""
        new = np.setdiff1d(unknowns, self.unknowns)
        if len(new):
            # Required ones come first and stay in the order given.
            new = unknowns if not len(self.unknowns) else new
            model = self.model
            self.unknowns = np.concatenate([self.unknowns, new])
            self._responses.append(self._operator.responses(new))
            rows = np.hstack(
                [self._operator.products(self._responses[-1], block) for block in self._responses]
            )
            old = len(self.unknowns) - len(new)
            gram = np.empty((len(self.unknowns), len(self.unknowns)))
            gram[:old, :old] = model.gram
            gram[old:] = rows
            gram[:old, old:] = rows[:, :old].T
            gram[old:, old:] = (rows[:, old:] + rows[:, old:].T) / 2
            model.gram = gram
            model.slope = self._slope[self.unknowns]
            model.usable = self._usable[self.unknowns]
            model.usable[model.fixed] = False
            model.least = self._least[self.unknowns]
        order = np.argsort(self.unknowns, kind="stable")
        return order[np.searchsorted(self.unknowns, unknowns, sorter=order)]

    def curvatures(self, members: IntArray) -> FloatArray:
        """Return the best curvatures of members."""
        return self.model.fit(members).curvatures

    def score(self, members: IntArray, curvatures: FloatArray) -> FloatArray:
        """Return (f,) half the derivative of E^2 by the curvature of a cone at each vertex."""
        log_scale = self._log_scale.copy()
        first = 0
        for block in self._responses:
            inside = (members >= first) & (members < first + len(block))
            log_scale += curvatures[inside] @ block[members[inside] - first]
            first += len(block)
        return self._operator.solve(self._operator.weighted(log_scale))

    def polish(self, members: IntArray) -> tuple[float, IntArray]:
        """Move cones over the mesh until E comes to rest; return E^2 and the members."""
        energy, members = self.model.exchanged(members)
        self.model.offer(energy, members)
        for _ in range(ROUNDS):
            targets = self.targets(members, self.curvatures(members), energy)
            if not len(targets):
                break
            known = len(self.unknowns)
            self.insert(targets)
            moved, members = self.model.exchanged(members)
            self.model.offer(moved, members)
            if len(self.unknowns) == known or not moved < energy * (1 - WORTHWHILE):
                break
            energy = moved
        best = self.model.best[len(members)]
        return best[0], best[1]

    def near(self, unknown: int, size: int) -> IntArray:
        """Return the usable vertices among the `size` nearest to one."""
        found = ball(self._indptr, self._indices, unknown, size)
        return found[self._usable[found]]

    def squared_distances(self, one: int, others: IntArray) -> FloatArray:
        """Return (p,) about the squared norm of the difference of two Green's functions, for each of the others."""
        return self._coarse.squared_distances(one, others)

    def targets(self, members: IntArray, curvatures: FloatArray, energy: float) -> IntArray:
        """Return where cones should move by the score and the coarse model's distances.

        Moving curvature k from s to t changes E^2 by 2 k (q_t - q_s) + k^2 ||g_s - g_t||^2, q the score.
        """
        score = self.score(members, curvatures)
        size = max(40, 4 * len(self._usable) // self._coarse.basis.shape[1])
        taken = self.unknowns[members]
        is_free = self._usable.copy()
        is_free[taken] = False
        targets = []
        for place in range(len(self.model.fixed), len(members)):
            s, k = int(taken[place]), curvatures[place]
            near = ball(self._indptr, self._indices, s, size)
            near = near[is_free[near]]
            if not len(near) or k == 0:
                continue
            linear = 2 * k * (score[near] - score[s])
            bending = k * k * self.squared_distances(s, near)
            for caution in CAUTION if len(score) > LARGE else CAUTIONS:
                change = linear + caution * bending
                best = first_least(change)
                if change[best] < -WORTHWHILE * energy:
                    targets.append(int(near[best]))
        return np.unique(np.array(targets, dtype=np.int64))
