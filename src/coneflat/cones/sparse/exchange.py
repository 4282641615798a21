"""Moves that improve a set of cones on a dense model, as compiled loops: sets are small, and tried by the thousand.

The distortion of cones S with curvatures k is E^2 = constant + 2 slope_S k + k gram_SS k. With the other cones
refitted freely, candidate t lowers it by (slope_t + gram_tS k + lambda)^2 / h_t, where h_t is what remains of gram_tt
after projection (orthogonal matching pursuit: Y. Pati, R. Rezaiifar, P. Krishnaprasad 1993). All candidates are
scored at once; the few best are fitted exactly, bounds and all.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..._arrays import BoolArray, FloatArray, IntArray
from ...compiled import compiled
from .best_sets import GAIN
from .fit_curvatures import fit_members, index_of_least
from .scores import addition_scores, best_swap, gradients, project

# Changes that differ by less, relatively, are equal, and the first in the order of candidates is taken: symmetric
# surfaces have many that differ by rounding only.
TIE = 1e-9


class Energies(NamedTuple):
    """What E^2 of any set of m candidates follows from.

    Attributes:
        gram, slope, constant: (m, m), (m,) and a number.
        least, most: (m,) bounds of the curvature at each candidate.
        total: what curvatures sum to, NaN for anything.
    """

    gram: FloatArray
    slope: FloatArray
    constant: float
    least: FloatArray
    most: FloatArray
    total: float


class Choice(NamedTuple):
    """What may be in a set.

    Attributes:
        fixed: the number of required candidates, which come first in every set.
        usable: (m,) whether a candidate may come in.
        kind: (m,) a member is replaced by one of its own kind.
        fitted: how many of the best scored moves are fitted exactly.
    """

    fixed: int
    usable: BoolArray
    kind: BoolArray
    fitted: int


@compiled
def fit_set(energies: Energies, members: IntArray) -> tuple[FloatArray, float, bool, float]:
    """Return the best curvatures, the multiplier of their sum, whether bounds allow it, and E^2, infinite if not."""
    curvatures, multiplier, feasible, energy = fit_members(
        energies.gram, energies.slope, energies.constant, energies.least, energies.most, energies.total, members
    )  # fmt: skip
    # Rounding may have made it less than nothing: gains are shares of it, and must not be losses.
    return curvatures, multiplier, feasible, 0.0 if energy < 0 else energy


@compiled
def diagonal_of(gram: FloatArray) -> FloatArray:
    """Return (m,) the diagonal."""
    diagonal = np.empty(len(gram))
    for t in range(len(gram)):
        diagonal[t] = gram[t, t]
    return diagonal


@compiled
def without_place(members: IntArray, place: int) -> IntArray:
    """Return the members but the one at a place."""
    rest = np.empty(len(members) - 1, np.int64)
    for i in range(len(rest)):
        rest[i] = members[i] if i < place else members[i + 1]
    return rest


@compiled
def places_inside(energies: Energies, members: IntArray, curvatures: FloatArray) -> IntArray:
    """Return the places of the members whose curvature no bound holds."""
    places, count = np.empty(len(members), np.int64), 0
    for i in range(len(members)):
        k, t = curvatures[i], members[i]
        span = 1e-9 * (1.0 + abs(k))
        if energies.least[t] + span < k < energies.most[t] - span:
            places[count] = i
            count += 1
    return places[:count].copy()


@compiled
def additions(energies: Energies, members: IntArray) -> FloatArray:
    """Return (m,) by how much E^2 changes if a candidate joins the members (0 or less), bounds of others aside."""
    gram, slope, total = energies.gram, energies.slope, energies.total
    has_sum = total == total
    diagonal = diagonal_of(gram)
    if has_sum and len(members) == 0:
        change = np.empty(len(slope))
        for t in range(len(slope)):
            change[t] = (2 * slope[t] + diagonal[t] * total) * total
        return change
    curvatures, multiplier, feasible, _ = fit_set(energies, members)
    gradient = gradients(gram, slope, members, curvatures, multiplier)
    if not feasible:  # then none is bounded
        low, high = np.full(len(slope), -np.inf), np.full(len(slope), np.inf)
        return addition_scores(gram, diagonal, gradient, members, low, high, has_sum)
    free = members[places_inside(energies, members, curvatures)]
    if has_sum and len(free) == 0:
        free = members[:1].copy()
    return addition_scores(gram, diagonal, gradient, free, energies.least, energies.most, has_sum)


@compiled
def carrying(least: FloatArray, is_open: BoolArray, missing: float) -> BoolArray:
    """Return a mask of the open candidates that can carry what is missing, less than 0, or some of it; else all."""
    for bound in (missing, 0.0):
        found, count = is_open.copy(), 0
        for t in range(len(least)):
            found[t] = is_open[t] and least[t] <= bound and least[t] < 0
            count += found[t]
        if count > 0:
            return found
    return is_open


@compiled
def best_addition(energies: Energies, members: IntArray, usable: BoolArray) -> int:
    """Return the usable candidate that scores best beside the members; -1 if there is none left."""
    is_open, bound = usable.copy(), 0.0
    for t in members:
        is_open[t] = False
        bound += energies.least[t]
    if energies.total - bound < 0:  # too few to carry the total
        is_open = carrying(energies.least, is_open, energies.total - bound)
    change = additions(energies, members)
    left, count = np.empty(len(change), np.int64), 0
    scores = np.empty(len(change))
    for t in range(len(change)):
        if is_open[t]:
            left[count], scores[count] = t, change[t]
            count += 1
    return left[index_of_least(scores[:count], TIE)] if count > 0 else -1


@compiled
def least_missed(energies: Energies, members: IntArray, choice: Choice) -> int:
    """Return the place of the member that is missed least; -1 if none can go.

    Those are fitted without that cost least while the others are refitted freely.
    """
    size, fixed, has_sum = len(members), choice.fixed, energies.total == energies.total
    if size <= fixed:
        return -1
    kept = project(energies.gram, diagonal_of(energies.gram), members, has_sum, True)[2]
    curvatures = fit_set(energies, members)[0]
    loss = np.full(size, np.inf)
    for i in range(fixed, size):
        loss[i] = curvatures[i] ** 2 / max(kept[i], 1e-300)
    tried, found = np.empty(size - fixed, np.int64), np.empty(size - fixed)
    count = min(choice.fitted, size - fixed)
    for i in range(count):
        tried[i] = index_of_least(loss, 0.0)
        loss[tried[i]] = np.inf
        found[i] = fit_set(energies, without_place(members, tried[i]))[3]
    best = index_of_least(found[:count], TIE)
    return tried[best] if found[best] < np.inf else -1


@compiled
def best_swaps(
    energies: Energies, members: IntArray, curvatures: FloatArray, multiplier: float, choice: Choice
) -> tuple[FloatArray, IntArray]:
    """Return for each member the change of E^2 by its best replacement, and which that is; infinite if not known.

    Removing a member is a rank one change of the inverse, so all members against all candidates cost little more
    than scoring the candidates once. Members held at a bound, and the required, are left out.
    """
    change, which = np.full(len(members), np.inf), np.full(len(members), -1)
    places = places_inside(energies, members, curvatures)
    if len(places) == 0:
        return change, which
    diagonal, has_sum = diagonal_of(energies.gram), energies.total == energies.total
    gradient = gradients(energies.gram, energies.slope, members, curvatures, multiplier)
    remain, rows, kept, bare = project(energies.gram, diagonal, members[places], has_sum, True)
    is_open = np.empty(len(diagonal), np.bool_)
    for i in range(len(places)):
        place = places[i]
        if place < choice.fixed or not kept[i] > 1e-10 * bare[i]:
            continue
        for t in range(len(diagonal)):
            is_open[t] = choice.usable[t] and choice.kind[t] == choice.kind[members[place]]
        for t in members:
            is_open[t] = False
        change[place], which[place] = best_swap(
            rows[i], kept[i], curvatures[place], gradient, remain, diagonal, is_open,
            energies.least, energies.most, TIE,
        )  # fmt: skip
    return change, which


@compiled
def exchange(energies: Energies, members: IntArray, choice: Choice) -> float:
    """Replace members, one at a time, in place, as long as E^2 falls; return it. The required ones stay."""
    curvatures, multiplier, feasible, energy = fit_set(energies, members)
    improved = feasible
    while improved:
        improved = False
        change, which = best_swaps(energies, members, curvatures, multiplier, choice)
        for _ in range(min(choice.fitted, len(members))):
            place = index_of_least(change, TIE)
            if not change[place] <= -GAIN * energy:
                break
            change[place] = np.inf
            previous, members[place] = members[place], which[place]
            found = fit_set(energies, members)
            if found[3] < energy * (1 - GAIN):
                curvatures, multiplier, improved, energy = found
                break
            members[place] = previous
    return energy


@compiled
def shake(
    energies: Energies, members: IntArray, energy: float, choice: Choice, out: IntArray
) -> tuple[float, bool]:
    """Take members away and refill, over and over; keep what is better, in place; return E^2, and whether it fell.

    out: (t, p) which of those that are not required go at each try, -1 for fewer. What was tried since a set was
    found is not tried again.
    """
    size, found, since = len(members), False, 0
    for i in range(len(out)):
        if is_among(out[i], out[since:i]):
            continue
        usable, gone = choice.usable.copy(), np.zeros(size, np.bool_)
        for place in out[i]:
            if place >= 0:
                gone[choice.fixed + place], usable[members[choice.fixed + place]] = True, False
        tried, count = np.empty(size, np.int64), 0
        for place in range(size):
            if not gone[place]:
                tried[count] = members[place]
                count += 1
        while 0 <= count < size:
            tried[count] = best_addition(energies, tried[:count], usable)
            count = count + 1 if tried[count] >= 0 else -1
        if count < 0:
            continue
        reached = exchange(energies, tried, choice)
        if reached < energy * (1 - GAIN):
            energy, found, since = reached, True, i + 1
            members[:] = tried
    return energy, found


@compiled
def is_among(row: IntArray, rows: IntArray) -> bool:
    """Return whether a row is one of some."""
    for i in range(len(rows)):
        same = True
        for j in range(len(row)):
            same = same and rows[i, j] == row[j]
        if same:
            return True
    return False
