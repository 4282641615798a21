"""Moves of cones whose curvatures are integer multiples of a quantum.

All moves transfer d quanta q from cone s to vertex t, which changes E^2 by
2 d q (slope_t - slope_s) + d^2 q^2 (gram_ss + gram_tt - 2 gram_st), with the slopes at the current curvatures.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...base.arrays import BoolArray, FloatArray, IntArray
from ...base.jit import compiled
from ..solution import TIE_TOLERANCE
from ..sparse.dense_model import argmin_tied

# Largest number of quanta that are transferred at once; a cone cannot hold more quarter turns.
MAX_QUANTA = 3
# Kinds of moves: quanta added to a cone, quanta transferred between cones, a cone moved to another candidate.
NO_MOVE, ADD, TRANSFER, MOVE = 0, 1, 2, 3


class Quanta(NamedTuple):
    """The quantum and the bounds of cone indices.

    Attributes:
        quantum: radians.
        least, most: bounds of each index.
        has_sum: whether the sum of the indices is prescribed.
    """

    quantum: float
    lower: int
    upper: int
    has_sum: bool


@compiled
def energy_of(
    gram: FloatArray, slope: FloatArray, constant: float, members: IntArray, indices: IntArray, quantum: float
) -> float:
    """Return E^2 of cones with given indices."""
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
    gradient = slope.copy()
    for i in range(len(members)):
        for t in range(len(gradient)):
            gradient[t] += quantum * indices[i] * gram[members[i], t]
    return gradient


@compiled
def transfer(gram: FloatArray, gradient: FloatArray, s: int, t: int, k: float) -> float:
    """Return the change of E^2 if curvature k is moved from vertex s to vertex t."""
    norm = gram[s, s] + gram[t, t] - 2 * gram[s, t]
    return (2 * (gradient[t] - gradient[s]) + k * norm) * k


@compiled
def is_within(index: int, quanta: Quanta) -> bool:
    """Return whether a cone may have an index."""
    return index != 0 and quanta.lower <= index <= quanta.upper


@compiled
def without_members(usable: BoolArray, members: IntArray) -> BoolArray:
    """Return (m,) a mask of the usable candidates that are not members."""
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
    """Apply the best move repeatedly, in place, until none lowers E^2; return E^2. The number of cones is unchanged.

    The moves are: transfer quanta from one cone to another, move a cone to another candidate, and, without a prescribed
    sum, add quanta to a cone or remove them.

    Args:
        gram, slope, constant: the energy, see `DenseModel`.
        members, indices: (s,) the cones and their quanta; changed in place.
        fixed: number of required cones, which come first and stay at their vertices.
        quanta: the quantum and the bounds of the indices.
        usable: (m,) mask of the candidates.
    """
    quantum = quanta.quantum
    energy = energy_of(gram, slope, constant, members, indices, quantum)
    free = without_members(usable, members)
    for _ in range(100 + 20 * len(members)):  # converges after a few moves per cone
        gradient = slopes(gram, slope, members, quantum, indices)
        threshold = -TIE_TOLERANCE * abs(energy)
        kind, cone, target, amount = best_move(
            gram, gradient, members, indices, fixed, quanta, free, threshold
        )
        if kind == NO_MOVE:
            break
        if kind == ADD:
            indices[cone] += amount
        elif kind == TRANSFER:
            indices[cone] -= amount
            indices[target] += amount
        else:
            free[members[cone]] = usable[members[cone]]
            members[cone] = target
            free[target] = False
        energy = energy_of(gram, slope, constant, members, indices, quantum)
    return energy


@compiled
def best_move(
    gram: FloatArray,
    gradient: FloatArray,
    members: IntArray,
    indices: IntArray,
    fixed: int,
    quanta: Quanta,
    free: BoolArray,
    threshold: float,
) -> tuple[int, int, int, int]:
    """Return the move that changes E^2 least: its kind, the cone, the target, and the quanta.

    The target is a position among the cones for a transfer of quanta, and a candidate for a move of the cone.

    Args:
        gram, gradient: see `transfer`.
        members, indices, fixed, quanta: see `descend`.
        free: (m,) candidates that are usable and not cones.
        threshold: change of E^2 that a move must be below.
    """
    quantum = quanta.quantum
    best, kind, cone, target, amount = threshold, NO_MOVE, -1, -1, 0
    for i in range(len(members)):
        s = members[i]
        if not quanta.has_sum:
            for d in range(-MAX_QUANTA, MAX_QUANTA + 1):
                k = quantum * d
                change = (2 * gradient[s] + k * gram[s, s]) * k
                if change < best - TIE_TOLERANCE * abs(best) and is_within(indices[i] + d, quanta):
                    best, kind, cone, amount = change, ADD, i, d
        for j in range(len(members)):
            for d in range(1, MAX_QUANTA + 1 if i != j else 0):
                change = transfer(gram, gradient, s, members[j], quantum * d)
                if (
                    change < best - TIE_TOLERANCE * abs(best)
                    and is_within(indices[i] - d, quanta)
                    and is_within(indices[j] + d, quanta)
                ):
                    best, kind, cone, target, amount = change, TRANSFER, i, j, d
        for t in range(len(gradient) if i >= fixed else 0):
            if free[t]:
                change = transfer(gram, gradient, s, t, quantum * indices[i])
                if change < best - TIE_TOLERANCE * abs(best):
                    best, kind, cone, target = change, MOVE, i, t
    return kind, cone, target, amount


@compiled
def best_split(
    gram: FloatArray,
    slope: FloatArray,
    members: IntArray,
    indices: IntArray,
    quanta: Quanta,
    usable: BoolArray,
) -> tuple[int, int, int]:
    """Return the best additional cone: the candidate, its index, and the position of the cone that gives the quanta.

    The position is -1 if the sum is not prescribed. The candidate is -1 if no cone can be split.
    """
    free = without_members(usable, members)
    gradient = slopes(gram, slope, members, quanta.quantum, indices)
    best, chosen, amount, giver = np.inf, -1, 0, -1
    for d in range(-MAX_QUANTA, MAX_QUANTA + 1):
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
                    if chosen < 0 or change < best - TIE_TOLERANCE * abs(best):
                        best, chosen, amount, giver = change, t, d, i if quanta.has_sum else -1
    return chosen, amount, giver


def best_pair(
    gram: FloatArray,
    slope: FloatArray,
    members: IntArray,
    indices: IntArray,
    quantum: float,
    usable: BoolArray,
) -> tuple[int, int] | None:
    """Return the two candidates for additional cones of plus and minus one quantum that lower E^2 most, or None."""
    free = np.flatnonzero(without_members(usable, members))
    if len(free) < 2:
        return None
    gradient = slopes(gram, slope, members, quantum, indices)[free]
    gram = gram[np.ix_(free, free)]
    norms = gram.diagonal()[:, None] + gram.diagonal() - 2 * gram
    changes = (2 * (gradient - gradient[:, None]) + quantum * norms) * quantum
    np.fill_diagonal(changes, np.inf)
    giver, taker = divmod(argmin_tied(changes.ravel()), len(free))
    return int(free[taker]), int(free[giver])


@compiled
def best_merge(
    gram: FloatArray, slope: FloatArray, members: IntArray, indices: IntArray, place: int, quanta: Quanta
) -> tuple[bool, int]:
    """Return whether the cone at `place` can be removed, and the position of the cone that best takes its quanta.

    The position is -1 if the sum is not prescribed and it is best that no cone takes them.
    """
    gradient = slopes(gram, slope, members, quanta.quantum, indices)
    s = members[place]
    k = quanta.quantum * indices[place]
    best, chosen, is_found = np.inf, -1, not quanta.has_sum
    if not quanta.has_sum:
        best = (k * gram[s, s] - 2 * gradient[s]) * k
    for j in range(len(members)):
        if j != place and is_within(indices[j] + indices[place], quanta):
            change = transfer(gram, gradient, s, members[j], k)
            if not is_found or change < best - TIE_TOLERANCE * abs(best):
                best, chosen, is_found = change, j, True
    return is_found, chosen
