"""Cones whose curvatures are whole multiples of a quantum: exchanges of units and positions on a dense model.

All moves transfer d quanta from cone s to vertex t, which changes E^2 by
2 d q (slope_t - slope_s) + d^2 q^2 (gram_ss + gram_tt - 2 gram_st), slopes taken at the current curvatures.
"""

from __future__ import annotations

from .._arrays import BoolArray, FloatArray, IntArray
from ..compiled import compiled

# A move must lower E^2 by this share.
GAIN = 1e-9
# Changes that differ by less, relatively, are equal, and the first met is taken.
TIE = 1e-9
LARGE = 1e300
# Transfers of up to so many quanta at once, either way.
REACH = 3


@compiled
def slopes(
    gram: FloatArray, slope: FloatArray, members: IntArray, units: IntArray, quantum: float
) -> FloatArray:
    """Return half the derivative of E^2 by the curvature of each candidate."""
    result = slope.copy()
    for j in range(len(members)):
        result += (quantum * units[j]) * gram[members[j]]
    return result


@compiled
def lattice_energy(
    gram: FloatArray,
    slope: FloatArray,
    constant: float,
    members: IntArray,
    units: IntArray,
    quantum: float,
) -> float:
    """Return E^2."""
    energy = constant
    for i in range(len(members)):
        k = quantum * units[i]
        energy += 2 * k * slope[members[i]]
        for j in range(len(members)):
            energy += k * gram[members[i], members[j]] * quantum * units[j]
    return energy


@compiled
def is_within(units: int, least: int, most: int) -> bool:
    """Whether a cone may have so many quanta."""
    return units != 0 and least <= units <= most


@compiled
def descend_lattice(
    gram: FloatArray,
    slope: FloatArray,
    constant: float,
    members: IntArray,
    units: IntArray,
    fixed: int,
    least: int,
    most: int,
    quantum: float,
    has_sum: bool,
    usable: BoolArray,
) -> float:
    """Make the best move over and over, in place, until none lowers E^2; return it. The number of cones stays.

    Moves: quanta go from one cone to another; a cone goes to another candidate; without a sum to keep, a cone gains
    or loses quanta.
    """
    size, count = len(members), len(slope)
    energy = lattice_energy(gram, slope, constant, members, units, quantum)
    free = usable.copy()
    for member in members:
        free[member] = False
    for _ in range(100 + 20 * size):
        gradient = slopes(gram, slope, members, units, quantum)
        best, kind, one, other, amount = -GAIN * abs(energy), 0, -1, -1, 0
        for i in range(size):
            s = members[i]
            if not has_sum:
                for d in range(-REACH, REACH + 1):
                    k = quantum * d
                    change = (2 * gradient[s] + k * gram[s, s]) * k
                    if change < best - TIE * abs(best) and is_within(units[i] + d, least, most):
                        best, kind, one, amount = change, 1, i, d
            for j in range(size):
                if i == j:
                    continue
                t = members[j]
                norm = gram[s, s] + gram[t, t] - 2 * gram[s, t]
                for d in range(1, REACH + 1):
                    k = quantum * d
                    change = (2 * (gradient[t] - gradient[s]) + k * norm) * k
                    if (
                        change < best - TIE * abs(best)
                        and is_within(units[i] - d, least, most)
                        and is_within(units[j] + d, least, most)
                    ):
                        best, kind, one, other, amount = change, 2, i, j, d
            if i >= fixed:
                k = quantum * units[i]
                for t in range(count):
                    if free[t]:
                        norm = gram[s, s] + gram[t, t] - 2 * gram[s, t]
                        change = (2 * (gradient[t] - gradient[s]) + k * norm) * k
                        if change < best - TIE * abs(best):
                            best, kind, one, other = change, 3, i, t
        if kind == 0:
            break
        if kind == 1:
            units[one] += amount
        elif kind == 2:
            units[one] -= amount
            units[other] += amount
        else:
            free[members[one]] = usable[members[one]]
            members[one] = other
            free[other] = False
        energy = lattice_energy(gram, slope, constant, members, units, quantum)
    return energy


@compiled
def best_split(
    gram: FloatArray,
    slope: FloatArray,
    members: IntArray,
    units: IntArray,
    least: int,
    most: int,
    quantum: float,
    has_sum: bool,
    usable: BoolArray,
) -> tuple[int, int, int]:
    """Return the best further cone: the candidate, its quanta, and the place of the cone it takes them from.

    The place is -1 where there is no sum to keep. The candidate is -1 if nothing can be split.
    """
    size, count = len(members), len(slope)
    free = usable.copy()
    for member in members:
        free[member] = False
    gradient = slopes(gram, slope, members, units, quantum)
    best, chosen, amount, place = LARGE, -1, 0, -1
    for d in range(-REACH, REACH + 1):
        if not is_within(d, least, most):
            continue
        k = quantum * d
        if not has_sum:
            for t in range(count):
                if free[t]:
                    change = (2 * gradient[t] + k * gram[t, t]) * k
                    if change < best - TIE * abs(best):
                        best, chosen, amount, place = change, t, d, -1
            continue
        for i in range(size):
            if not is_within(units[i] - d, least, most):
                continue
            s = members[i]
            for t in range(count):
                if free[t]:
                    norm = gram[s, s] + gram[t, t] - 2 * gram[s, t]
                    change = (2 * (gradient[t] - gradient[s]) + k * norm) * k
                    if change < best - TIE * abs(best):
                        best, chosen, amount, place = change, t, d, i
    return chosen, amount, place


@compiled
def best_merge(
    gram: FloatArray,
    slope: FloatArray,
    members: IntArray,
    units: IntArray,
    place: int,
    least: int,
    most: int,
    quantum: float,
    has_sum: bool,
) -> tuple[int, float]:
    """Return the place of the cone that best takes all quanta of the one at `place`, and the change of E^2.

    -2 if none can; -1 where there is no sum to keep and the quanta just go.
    """
    gradient = slopes(gram, slope, members, units, quantum)
    s = members[place]
    k = quantum * units[place]
    best, chosen = LARGE, -2
    if not has_sum:
        best, chosen = (k * gram[s, s] - 2 * gradient[s]) * k, -1
    for j in range(len(members)):
        if j != place and is_within(units[j] + units[place], least, most):
            t = members[j]
            norm = gram[s, s] + gram[t, t] - 2 * gram[s, t]
            change = (2 * (gradient[t] - gradient[s]) + k * norm) * k
            if change < best - TIE * abs(best):
                best, chosen = change, j
    return chosen, best
