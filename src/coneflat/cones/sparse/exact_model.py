"""Exact energies of cones at the vertices tried so far, and where on the mesh cones should go from there."""

from __future__ import annotations

import numpy as np

from ...base.arrays import BoolArray, FloatArray, IntArray
from ...base.compiled import compiled
from .dense_model import BestSets, DenseModel, argmin_tied
from .limits import Limits
from .linear_model import LinearModel

# A move is tried if it promises to lower E^2 by this share.
MIN_PROMISED_GAIN = 1e-3
# Rounds of moves for a set of cones; most come to rest after three or four.
MAX_ROUNDS = 12


class ExactModel(DenseModel):
    """A dense model on a growing set of vertices, with exact entries.

    Attributes:
        unknowns: (m,) the vertex of each candidate, in the numbering of the operator.
    """

    def __init__(
        self,
        linear: LinearModel,
        required: IntArray,
        limits: Limits,
        least: FloatArray,
    ) -> None:
        none, coarse, operator, log_scale = np.empty(0), linear.coarse, linear.operator, linear.log_scale
        fixed = np.arange(len(required))
        super().__init__(np.empty((0, 0)), none, coarse.constant, none.astype(bool), fixed, limits, none)
        self._operator, self._coarse, self._log_scale = operator, coarse, log_scale
        self._usable = np.ones(len(log_scale), dtype=bool)
        self._indptr = operator.laplacian.indptr.astype(np.int64)
        self._indices = operator.laplacian.indices.astype(np.int64)
        self._linear, self._least = linear, least
        # The Green's functions of the unknowns, in blocks as they came, and their means.
        self._responses: list[FloatArray] = []
        self._means: list[FloatArray] = []
        self.unknowns: IntArray = np.empty(0, dtype=np.int64)
        if len(required):
            self._add(required, operator.responses(required))

    def restrict(self, usable: BoolArray) -> None:
        """Let cones move to the (f,) usable unknowns alone, and forget the sets found; energies stay known."""
        self._usable = usable
        self.usable = usable[self.unknowns]
        self.best = BestSets()

    def insert(self, unknowns: IntArray) -> IntArray:
        """Add vertices, if they are not in, and return the places of all."""
        is_new = np.zeros(len(self._log_scale), dtype=bool)
        is_new[unknowns] = True
        is_new[self.unknowns] = False
        new = np.flatnonzero(is_new)
        for some in self._operator.batches(new):
            self._add(some, self._operator.responses(some))
        order = np.argsort(self.unknowns, kind="stable")
        return order[np.searchsorted(self.unknowns, unknowns, sorter=order)]

    def in_order(self, members: IntArray) -> IntArray:
        """Return the order (s,) of members in which cones are given out: the required ones, and then by unknown.

        In which order they were found depends on rounding.
        """
        required = len(self.fixed)
        return np.append(np.arange(required), required + np.argsort(self.unknowns[members[required:]]))

    def _add(self, new: IntArray, responses: FloatArray) -> None:
        """Add k vertices with their Green's functions (k, f)."""
        old = len(self.unknowns)
        self.unknowns = np.concatenate([self.unknowns, new])
        rows = self._covariances(responses)
        gram = np.empty((len(self.unknowns), len(self.unknowns)))
        gram[:old, :old] = self.gram
        gram[old:] = rows
        gram[:old, old:] = rows[:, :old].T
        gram[old:, old:] = (rows[:, old:] + rows[:, old:].T) / 2
        self.gram = gram
        self.slope = self._linear.score[self.unknowns]
        self.usable = self._usable[self.unknowns]
        self.usable[self.fixed] = False
        self.least = self._least[self.unknowns]

    def _covariances(self, responses: FloatArray) -> FloatArray:
        """Add the Green's functions (k, f) of k unknowns more; return (k, m + k) their covariances with all."""
        areas = self._operator.areas
        means = responses @ areas
        weighted = responses * areas
        self._responses.append(responses)
        self._means.append(means)
        return np.hstack(
            [
                weighted @ block.T - np.outer(means, others)
                for block, others in zip(self._responses, self._means, strict=True)
            ]
        )

    def refine(self, members: IntArray) -> float:
        """Move cones over the mesh until E comes to rest; return E^2 of the best set of their number."""
        found = self.exchanged(members)
        self.best.offer(found)
        for _ in range(MAX_ROUNDS):
            known, before = len(self.unknowns), found.energy
            self.insert(self.targets(found.members, self.fit(found.members).curvatures, before))
            if len(self.unknowns) == known:
                break
            found = self.exchanged(found.members)
            self.best.offer(found)
            if not found.energy < before * (1 - MIN_PROMISED_GAIN):
                break
        return self.best.energy(len(found))

    def targets(self, members: IntArray, curvatures: FloatArray, energy: float) -> IntArray:
        """Return where cones should move by the score and the coarse model's distances.

        Moving curvature k from s to t changes E^2 by 2 k (q_t - q_s) + k^2 ||g_s - g_t||^2, q the score.
        """
        score = self._score(members, curvatures)
        # Some of the coarse model's functions wide: from there on its distances tell nothing.
        size = max(40, 4 * len(self._usable) // self._coarse.size)
        taken = self.unknowns[members]
        is_free = self._usable.copy()
        is_free[taken] = False
        targets = []
        for place in range(len(self.fixed), len(members)):
            s, k = int(taken[place]), curvatures[place]
            near = ball(self._indptr, self._indices, s, size)
            near = near[is_free[near]]
            if not len(near) or k == 0:
                continue
            change = 2 * k * (score[near] - score[s]) + k * k * self.squared_distances(s, near)
            best = argmin_tied(change)
            if change[best] < -MIN_PROMISED_GAIN * energy:
                targets.append(int(near[best]))
        return np.unique(np.array(targets, dtype=np.int64))

    def _score(self, members: IntArray, curvatures: FloatArray) -> FloatArray:
        """Return (f,) half the derivative of E^2 by the curvature of a cone at each vertex."""
        log_scale = self._log_scale.copy()
        first = 0
        for block in self._responses:
            own = (members >= first) & (members < first + len(block))
            log_scale += curvatures[own] @ block[members[own] - first]
            first += len(block)
        return self._operator.solve(self._operator.weighted(log_scale))

    def near(self, unknown: int, size: int) -> IntArray:
        """Return the usable vertices among the `size` nearest to one."""
        found = ball(self._indptr, self._indices, unknown, size)
        return found[self._usable[found]]

    def squared_distances(self, one: int, others: IntArray) -> FloatArray:
        """Return (p,) about the squared norm of the difference of two Green's functions, for each of the others."""
        return self._coarse.squared_distances(one, others)


@compiled
def ball(indptr: IntArray, indices: IntArray, centre: int, size: int) -> IntArray:
    """Return the `size` vertices nearest to a vertex in steps along edges, whole rings of them, itself first.

    By array operations a whole search for 20 to 50 cones takes 20% longer.
    """
    seen = {centre}
    found = [centre]
    start = 0
    while len(found) < size and start < len(found):
        end = len(found)
        for i in range(start, end):
            vertex = found[i]
            for e in range(indptr[vertex], indptr[vertex + 1]):
                other = indices[e]
                if other not in seen:
                    seen.add(other)
                    found.append(other)
        start = end
    return np.array(found)
