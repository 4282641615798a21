"""Energies of cones on the mesh, at the vertices that were evaluated so far, and proposals of better vertices."""

from __future__ import annotations

import math
from copy import copy

import numpy as np

from ...base.arrays import BoolArray, FloatArray, IntArray, mask_of
from ...base.jit import compiled
from .dense_model import BestSets, DenseModel, argmin_tied
from .limits import Limits
from .linear_model import LinearModel

# Smallest predicted relative decrease of E^2 for which a move is tried.
MIN_PROMISED_GAIN = 1e-3
# Number of vertices near a cone that are considered: at least this number, and one of so many parts of the mesh.
MIN_NEIGHBOURS, PARTS = 40, 300
# Smallest area from which a distance is estimated.
MIN_SHARE = 1e-300
# Largest number of rounds of moves for a set of cones; most sets converge after three or four.
MAX_ROUNDS = 12


class FineModel(DenseModel):
    """The dense model of a growing set of vertices of the mesh, in contrast to the coarse model.

    Its candidates are the vertices whose Green's functions have been computed.

    Attributes:
        linear: the linear model of the mesh.
        operator: its Green operator.
        unknowns: (m,) the vertex of each candidate, in the numbering of the operator.
        lower_bounds: (f,) lower bound of the curvature at each unknown, radians.
    """

    def __init__(
        self, linear: LinearModel, required: IntArray, limits: Limits, lower_bounds: FloatArray
    ) -> None:
        """Return the model whose candidates are the required cones, unknowns (s,); all unknowns are usable."""
        empty, fixed = np.empty(0), np.arange(len(required))
        super().__init__(
            np.empty((0, 0)), empty, linear.distortion**2, empty.astype(bool), fixed, limits, empty
        )
        self.linear, self.operator = linear, linear.operator
        self.unknowns: IntArray = np.empty(0, dtype=np.int64)
        self.lower_bounds = lower_bounds
        self._usable = np.ones(len(lower_bounds), dtype=bool)
        self._indptr = self.operator.laplacian.indptr.astype(np.int64)
        self._indices = self.operator.laplacian.indices.astype(np.int64)
        # Buffers of `fill_ball`.
        self._is_reached = np.zeros(len(lower_bounds), dtype=bool)
        self._reached, self._shares = np.empty(len(lower_bounds), np.int64), np.empty(len(lower_bounds))
        # The Green's functions of the candidates and their means, in blocks in the order in which they were added.
        self._responses: list[FloatArray] = []
        self._means: list[FloatArray] = []
        if len(required):
            self._add(required, self.operator.responses(required))

    def restricted(self, usable: BoolArray) -> FineModel:
        """Return the model with further cones at the usable unknowns (f,) only, and without sets of cones.

        Green's functions and energies are shared.
        """
        model = copy(self)
        model._usable = usable.copy()
        model._usable[self.unknowns[self.fixed]] = False
        model.usable = model._usable[self.unknowns]
        model.best = BestSets()
        model._responses, model._means = [*self._responses], [*self._means]
        return model

    @property
    def fitness(self) -> FloatArray:
        """(f,) preference of unknowns as candidates of the coarse model; 0 for those that must not be further cones.

        There a neighbourhood is represented by a vertex that can have a wide cone angle.
        """
        excess = np.maximum(-self.lower_bounds, 0.0)
        is_bounded = 0 < excess.max(initial=0.0) < math.inf
        fitness: FloatArray = self._usable * (0.5 + 0.5 * excess / excess.max() if is_bounded else 1.0)
        return fitness

    def insert(self, unknowns: IntArray) -> IntArray:
        """Add those vertices that are not candidates yet; return the candidate number of each."""
        is_new = mask_of(len(self._usable), unknowns)
        is_new[self.unknowns] = False
        added = np.flatnonzero(is_new)
        for batch in self.operator.batches(added):
            self._add(batch, self.operator.responses(batch))
        order = np.argsort(self.unknowns, kind="stable")
        return order[np.searchsorted(self.unknowns, unknowns, sorter=order)]

    def in_order(self, members: IntArray) -> IntArray:
        """Return (s,) the output order of members: first the required ones, then the others by unknown.

        The order in which they were found depends on rounding.
        """
        required = len(self.fixed)
        return np.append(np.arange(required), required + np.argsort(self.unknowns[members[required:]]))

    def _add(self, added: IntArray, responses: FloatArray) -> None:
        """Add k vertices with their Green's functions (k, f)."""
        size = len(self.unknowns)
        self.unknowns = np.concatenate([self.unknowns, added])
        areas = self.operator.areas
        weighted, means = responses * areas, responses @ areas
        self._responses.append(responses)
        self._means.append(means)
        blocks = zip(self._responses, self._means, strict=True)
        rows = np.hstack([weighted @ block.T - np.outer(means, block_means) for block, block_means in blocks])
        gram = np.empty((len(self.unknowns), len(self.unknowns)))
        gram[:size, :size] = self.gram
        gram[size:] = rows
        gram[:size, size:] = rows[:, :size].T
        gram[size:, size:] = (rows[:, size:] + rows[:, size:].T) / 2
        self.gram = gram
        self.slope = self.linear.score[self.unknowns]
        self.usable = self._usable[self.unknowns]
        self.usable[self.fixed] = False
        self.lower = self.lower_bounds[self.unknowns]

    def refine(self, members: IntArray, goal: float = 0.0) -> float:
        """Move cones over the mesh until E converges, or E^2 <= goal; return E^2 of the best set of this number."""
        cones = self.exchanged(members)
        self.best.offer(cones)
        for _ in range(MAX_ROUNDS):
            if cones.energy <= goal:
                break
            known_count, before = len(self.unknowns), cones.energy
            self.insert(self.targets(cones.members, self.fit(cones.members).curvatures, before))
            if len(self.unknowns) == known_count:
                break
            cones = self.exchanged(cones.members)
            self.best.offer(cones)
            if not cones.energy < before * (1 - MIN_PROMISED_GAIN):
                break
        return self.best.energy(len(cones))

    def targets(self, members: IntArray, curvatures: FloatArray, energy: float) -> IntArray:
        """Return the unknowns to which cones should move, by the score and estimated distances.

        Moving curvature k from s to t changes E^2 by 2 k (q_t - q_s) + k^2 ||g_s - g_t||^2, where q is the score.
        """
        score = self._score(members, curvatures)
        size = max(MIN_NEIGHBOURS, len(self._usable) // PARTS)
        taken = self.unknowns[members]
        is_free = self._usable.copy()
        is_free[taken] = False
        targets = []
        for place in range(len(self.fixed), len(members)):
            s, k = int(taken[place]), curvatures[place]
            neighbours, distances = self.neighbours(s, size)
            neighbours, distances = neighbours[is_free[neighbours]], distances[is_free[neighbours]]
            if not len(neighbours) or k == 0:
                continue
            change = 2 * k * (score[neighbours] - score[s]) + k * k * distances
            best = argmin_tied(change)
            if change[best] < -MIN_PROMISED_GAIN * energy:
                targets.append(int(neighbours[best]))
        return np.unique(np.array(targets, dtype=np.int64))

    def extended(self, members: IntArray, goal: float, max_size: int) -> IntArray:
        """Return members with up to half as many added where the score is a local maximum, until E^2 <= goal."""
        room, fitted = min(max_size - len(members), len(members) // 2 + 1), self.fit(members)
        score = np.abs(self._score(members, fitted.curvatures) + fitted.multiplier)
        score[~self._usable] = -1.0
        peaks = np.flatnonzero(score >= np.maximum.reduceat(score[self._indices], self._indptr[:-1]))
        self.insert(peaks[np.argsort(-score[peaks], kind="stable")][: 4 * room])
        for _ in range(room):
            if self.energy(members) <= goal or (larger := self.grown(members)) is None:
                break
            members = larger
        return members

    def _score(self, members: IntArray, curvatures: FloatArray) -> FloatArray:
        """Return (f,) half the derivative of E^2 by the curvature of a cone at each vertex."""
        log_scale = self.linear.log_scale.copy()
        first = 0
        for block in self._responses:
            is_member = (members >= first) & (members < first + len(block))
            log_scale += curvatures[is_member] @ block[members[is_member] - first]
            first += len(block)
        return self.operator.solve(self.operator.weighted(log_scale))

    def neighbours(self, unknown: int, size: int) -> tuple[IntArray, FloatArray]:
        """Return the usable unknowns (p,) nearest to one, and estimates of the distances of their Green's functions.

        They are reached in steps along edges, in complete rings until there are `size`. The difference of the Green's
        functions of vertices at a distance r is nearly that of a dipole, whose squared norm is r^2 log(R / r) / (4 pi),
        relative to the area pi R^2 of the surface. pi r^2 is the area within the rings. Most estimates are within a
        factor of 2.
        """
        count = fill_ball(
            self._indptr,
            self._indices,
            self.operator.areas,
            unknown,
            size,
            self._is_reached,
            self._reached,
            self._shares,
        )
        reached, share = self._reached[:count], np.maximum(self._shares[:count], MIN_SHARE)
        distances = share * (0.3 - np.log(share) / 2) / (4 * np.pi**2)
        is_usable = self._usable[reached]
        return reached[is_usable], distances[is_usable]


@compiled
def fill_ball(
    indptr: IntArray,
    indices: IntArray,
    areas: FloatArray,
    centre: int,
    size: int,
    is_reached: BoolArray,
    reached: IntArray,
    shares: FloatArray,
) -> int:
    """Write the vertices nearest to a vertex in steps along edges, in complete rings until `size` are reached.

    The vertex itself comes first. With array operations, a complete search for 20 to 50 cones takes 20% longer.

    Args:
        indptr, indices: the neighbours of the vertices.
        areas: (n,) areas of the vertices.
        centre, size: the vertex, and the number of vertices.
        is_reached: (n,) False, and again on return.
        reached: (n,) buffer for the vertices.
        shares: (n,) buffer for the area within the middle of the ring of each vertex.

    Returns:
        The number of vertices written.
    """
    reached[0], shares[0], is_reached[centre], start, count = centre, 0.0, True, 0, 1
    inner, ring = 0.0, areas[centre]
    while count < size and start < count:
        end = count
        inner, ring = inner + ring, 0.0
        for i in range(start, end):
            for e in range(indptr[reached[i]], indptr[reached[i] + 1]):
                if not is_reached[indices[e]]:
                    is_reached[indices[e]] = True
                    reached[count] = indices[e]
                    ring += areas[indices[e]]
                    count += 1
        shares[end:count] = inner + ring / 2
        start = end
    for i in range(count):
        is_reached[reached[i]] = False
    return count
