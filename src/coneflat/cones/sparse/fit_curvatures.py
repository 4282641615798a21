"""Curvatures of given cones by a convex quadratic program in a few variables: exact active set methods.

Plain loops, without slices and array expressions: those would take ten times as long to compile.
"""

from __future__ import annotations

import numpy as np

from ..._arrays import FloatArray, IntArray
from ...compiled import compiled

# Pivots below this share of the largest diagonal count as it: cones on neighbouring vertices are nearly dependent.
SMALLEST_PIVOT = 1e-13
# What a multiplier may be off by, relative to the largest gradient, before its bound is released.
RELEASE = 1e-11
# Steps after which changing bounds all at once is given up: then it goes round in circles.
AT_ONCE = 20


@compiled
def factor_lower(gram: FloatArray, free: IntArray, count: int, lower: FloatArray) -> None:
    """Write the Cholesky factor of gram[free, free] to `lower`."""
    largest = 0.0
    for i in range(count):
        largest = max(largest, gram[free[i], free[i]])
    for i in range(count):
        for j in range(i + 1):
            value = gram[free[i], free[j]]
            for m in range(j):
                value -= lower[i, m] * lower[j, m]
            if i == j:
                lower[i, i] = np.sqrt(max(value, SMALLEST_PIVOT * largest))
            else:
                lower[i, j] = value / lower[j, j]


@compiled
def solve_factored(lower: FloatArray, count: int, right: FloatArray) -> None:
    """Overwrite `right` by the solution of lower lower^T x = right."""
    for i in range(count):
        for j in range(i):
            right[i] -= lower[i, j] * right[j]
        right[i] /= lower[i, i]
    for i in range(count - 1, -1, -1):
        for j in range(i + 1, count):
            right[i] -= lower[j, i] * right[j]
        right[i] /= lower[i, i]


@compiled
def start_feasibly(least: FloatArray, most: FloatArray, total: float, curvatures: FloatArray) -> None:
    """Write curvatures within the bounds that sum to the total, as even as can be; NaN means any sum."""
    size = len(curvatures)
    has_sum = total == total
    for i in range(size):
        curvatures[i] = min(max(total / size if has_sum else 0.0, least[i]), most[i])
    for _ in range(size if has_sum else 0):
        missing, room = total, 0
        for i in range(size):
            missing -= curvatures[i]
        if missing == 0.0:
            break
        for i in range(size):
            room += curvatures[i] < most[i] if missing > 0 else curvatures[i] > least[i]
        if room == 0:
            break
        for i in range(size):
            curvatures[i] = min(max(curvatures[i] + missing / room, least[i]), most[i])


@compiled
def fit_free(
    gram: FloatArray,
    slope: FloatArray,
    total: float,
    state: IntArray,
    curvatures: FloatArray,
    free: IntArray,
    best: FloatArray,
    lower: FloatArray,
) -> tuple[int, float]:
    """Write the free ones, in state 0, and their best values, the others held; return their number and the multiplier.

    lower: (s, s) room for a factor.
    """
    size, count = len(slope), 0
    for i in range(size):
        if state[i] == 0:
            free[count] = i
            count += 1
    factor_lower(gram, free, count, lower)
    left = total
    for i in range(count):
        best[i] = -slope[free[i]]
    for j in range(size):
        if state[j] != 0:
            left -= curvatures[j]
            for i in range(count):
                best[i] -= gram[free[i], j] * curvatures[j]
    solve_factored(lower, count, best)
    if total != total or count == 0:
        return count, 0.0
    ones = np.ones(count)
    solve_factored(lower, count, ones)
    sum_best, sum_ones = 0.0, 0.0
    for i in range(count):
        sum_best += best[i]
        sum_ones += ones[i]
    multiplier = (sum_best - left) / sum_ones
    for i in range(count):
        best[i] -= multiplier * ones[i]
    return count, multiplier


@compiled
def gradient_of(gram: FloatArray, slope: FloatArray, curvatures: FloatArray, gradient: FloatArray) -> float:
    """Write gram k + slope; return the largest magnitude."""
    largest = 1e-300
    for i in range(len(slope)):
        value = slope[i]
        for j in range(len(slope)):
            value += gram[i, j] * curvatures[j]
        gradient[i] = value
        largest = max(largest, abs(value))
    return largest


@compiled
def fit_at_once(
    gram: FloatArray,
    slope: FloatArray,
    least: FloatArray,
    most: FloatArray,
    total: float,
    state: IntArray,
    curvatures: FloatArray,
    lower: FloatArray,
) -> tuple[bool, float]:
    """Find the optimum by changing all bounds that are in the way, or no longer, at once; tell if it ends, and where.

    The primal-dual active set method (M. Hintermueller, K. Ito, K. Kunisch, "The primal-dual active set strategy as a
    semismooth Newton method", 2003): a handful of steps where it works, which on the models tried is nearly always.
    """
    size = len(slope)
    free, best, gradient = np.empty(size, np.int64), np.empty(size), np.empty(size)
    for _ in range(AT_ONCE):
        count, multiplier = fit_free(gram, slope, total, state, curvatures, free, best, lower)
        if count == 0:
            break
        for i in range(count):
            curvatures[free[i]] = best[i]
        release = RELEASE * gradient_of(gram, slope, curvatures, gradient)
        changed = False
        for j in range(size):
            now = state[j]
            if now == 0:
                now = 1 if curvatures[j] > most[j] else (-1 if curvatures[j] < least[j] else 0)
                if now != 0:
                    curvatures[j] = most[j] if now == 1 else least[j]
            elif now * (gradient[j] + multiplier) > release:
                now = 0
            changed = changed or now != state[j]
            state[j] = now
        if not changed:
            return True, multiplier
    return False, 0.0


@compiled
def fit_one_by_one(
    gram: FloatArray,
    slope: FloatArray,
    least: FloatArray,
    most: FloatArray,
    total: float,
    state: IntArray,
    curvatures: FloatArray,
    lower: FloatArray,
) -> float:
    """Find the optimum by a primal active set method, which always ends; return the multiplier of the sum."""
    size = len(slope)
    has_sum = total == total
    multiplier = 0.0
    state[:] = 0
    start_feasibly(least, most, total, curvatures)
    free, best, gradient = np.empty(size, np.int64), np.empty(size), np.empty(size)
    for _ in range(20 * size + 20):
        count, multiplier = fit_free(gram, slope, total, state, curvatures, free, best, lower)
        # As far there as the bounds allow.
        step, blocking, side = 1.0, -1, 0
        for i in range(count):
            j = free[i]
            value, aim = curvatures[j], best[i]
            if aim > most[j] or aim < least[j]:
                bound = most[j] if aim > most[j] else least[j]
                part = max((bound - value) / (aim - value), 0.0)
                if part < step:
                    step, blocking, side = part, j, 1 if aim > most[j] else -1
        for i in range(count):
            curvatures[free[i]] += step * (best[i] - curvatures[free[i]])
        if blocking >= 0:
            state[blocking] = side
            curvatures[blocking] = most[blocking] if side == 1 else least[blocking]
            continue
        # Whether one held at a bound would rather leave it.
        largest = gradient_of(gram, slope, curvatures, gradient)
        high, low = -1, -1
        for i in range(size):
            if state[i] == 1 and (high < 0 or gradient[i] > gradient[high]):
                high = i
            if state[i] == -1 and (low < 0 or gradient[i] < gradient[low]):
                low = i
        if count == 0 and has_sum:
            # One alone cannot move under the sum: the two that pull most, one from each bound.
            if high < 0 or low < 0:
                multiplier = -gradient[max(high, low)]
                break
            multiplier = -(gradient[high] + gradient[low]) / 2
            if gradient[high] - gradient[low] <= RELEASE * largest:
                break
            state[high] = 0
            state[low] = 0
            continue
        pull_high = gradient[high] + multiplier if high >= 0 else 0.0
        pull_low = -gradient[low] - multiplier if low >= 0 else 0.0
        if max(pull_high, pull_low) <= RELEASE * largest:
            break
        if pull_high >= pull_low:
            state[high] = 0
        else:
            state[low] = 0
    return multiplier


@compiled
def fit_curvatures(
    gram: FloatArray, slope: FloatArray, least: FloatArray, most: FloatArray, total: float
) -> tuple[FloatArray, float, bool]:
    """Minimise k gram k / 2 + slope k over least <= k <= most (s,), and sum k = total unless that is NaN.

    It ends at the exact optimum, since the program is strictly convex: if changing many bounds at once does not get
    there, changing them one by one does.

    Returns:
        The curvatures, the multiplier of the sum, and whether the bounds allow the sum. Where they do not, the
        bounds are left out.
    """
    size = len(slope)
    has_sum = total == total
    curvatures = np.zeros(size)
    if size == 0:
        return curvatures, 0.0, not has_sum or abs(total) < 1e-9
    low_sum, high_sum = 0.0, 0.0
    for i in range(size):
        low_sum += least[i]
        high_sum += most[i]
    slack = 1e-12 * (1.0 + abs(total))
    feasible = not has_sum or low_sum - slack <= total <= high_sum + slack
    if not feasible:
        least, most = np.full(size, -np.inf), np.full(size, np.inf)
    state = np.zeros(size, np.int64)  # -1 held at the least, 1 at the most, 0 free
    lower = np.empty((size, size))
    done, multiplier = fit_at_once(gram, slope, least, most, total, state, curvatures, lower)
    if not done:
        multiplier = fit_one_by_one(gram, slope, least, most, total, state, curvatures, lower)
    return curvatures, multiplier, feasible


@compiled
def fit_members(
    gram: FloatArray,
    slope: FloatArray,
    constant: float,
    least: FloatArray,
    most: FloatArray,
    total: float,
    members: IntArray,
) -> tuple[FloatArray, float, bool, float]:
    """Return what `fit_curvatures` finds for some of m candidates, and E^2 = constant + (2 slope + gram k) k.

    E^2 is infinite where the bounds do not allow the sum. gram: (m, m), slope, least, most: (m,).
    """
    size = len(members)
    small, linear = np.empty((size, size)), np.empty(size)
    low, high = np.empty(size), np.empty(size)
    for i in range(size):
        linear[i], low[i], high[i] = slope[members[i]], least[members[i]], most[members[i]]
        for j in range(size):
            small[i, j] = gram[members[i], members[j]]
    curvatures, multiplier, feasible = fit_curvatures(small, linear, low, high, total)
    if not feasible:
        return curvatures, multiplier, feasible, np.inf
    energy = constant
    for i in range(size):
        value = 2 * linear[i]
        for j in range(size):
            value += small[i, j] * curvatures[j]
        energy += value * curvatures[i]
    return curvatures, multiplier, feasible, energy


@compiled
def index_of_least(values: FloatArray, tie: float) -> int:
    """Return the first index whose value is the least, or above it by no more than a share of it."""
    least = np.inf
    for i in range(len(values)):
        least = min(least, values[i])
    limit = least + tie * abs(least) if abs(least) < np.inf else least
    for i in range(len(values)):
        if values[i] <= limit:
            return i
    return 0
