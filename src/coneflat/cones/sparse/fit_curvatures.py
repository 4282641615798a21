"""Curvatures of given cones by a convex quadratic program in a few variables: exact active set methods."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...base.arrays import FloatArray, IntArray
from ...base.compiled import compiled
from ..solution import TIE_TOLERANCE

# What is added to the diagonal, as a share of its largest entry: cones on neighbouring vertices are nearly dependent.
SMALLEST_PIVOT = 1e-13
# What a multiplier may be off by, relative to the largest gradient, before its bound is released.
RELEASE_TOLERANCE = 1e-11
# Steps after which changing bounds all at once is given up, as it may cycle. One by one alone takes twelve times as
# long for the 173 cones of 49 handles, most of which are at a bound.
MAX_STEPS_AT_ONCE = 20


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
    has_sum = not math.isnan(total)
    if not len(slope):
        return np.zeros(0), 0.0, not has_sum or abs(total) < TIE_TOLERANCE
    slack = 1e-12 * (1.0 + abs(total))
    feasible = not has_sum or bool(least.sum() - slack <= total <= most.sum() + slack)
    if not feasible:
        least, most = np.full(len(slope), -np.inf), np.full(len(slope), np.inf)
    found = change_at_once(gram, slope, least, most, total)
    if found is None:
        found = _Program(gram, slope, least, most, total).change_one_by_one()
    return *found, feasible


def inverse_with_sum(gram: FloatArray, has_sum: bool) -> FloatArray:
    """Return the inverse (s, s) of a Gram matrix, or (s + 1, s + 1) of it bordered by the sum of the unknowns."""
    size, diagonal = len(gram), gram.diagonal()
    # The border is as large as the entries, so that rounding is of one size.
    unit = float(diagonal.max(initial=0.0)) or 1.0
    system = np.zeros((size + has_sum, size + has_sum))
    system[:size, :size] = gram
    system.flat[: size * len(system) : len(system) + 1] += SMALLEST_PIVOT * unit
    if not has_sum:
        return np.asarray(np.linalg.inv(system), dtype=np.float64)
    system[size, :size] = system[:size, size] = unit
    inverse = np.asarray(np.linalg.inv(system), dtype=np.float64)
    inverse[size] *= unit
    inverse[:, size] *= unit
    return inverse


@dataclass(frozen=True, eq=False)
class _Program:
    """The program; states (s,) of its variables are -1 held at the least, 1 at the most, 0 free."""

    gram: FloatArray
    slope: FloatArray
    least: FloatArray
    most: FloatArray
    total: float

    def change_one_by_one(self) -> tuple[FloatArray, float]:
        """Return the optimum and the multiplier by a primal active set method, which always ends."""
        size, has_sum, multiplier = len(self.slope), not math.isnan(self.total), 0.0
        state, curvatures = np.zeros(size, dtype=np.int64), self._start()
        for _ in range(20 * size + 20):
            free, best, multiplier = best_free(self.gram, self.slope, self.total, state, curvatures)
            # As far there as the bounds allow.
            here = curvatures[free]
            bound = np.where(best > here, self.most[free], self.least[free])
            is_beyond = (best > self.most[free]) | (best < self.least[free])
            parts = np.ones(len(free))
            parts[is_beyond] = np.maximum((bound - here)[is_beyond] / (best - here)[is_beyond], 0.0)
            step = float(parts.min(initial=1.0))
            curvatures[free] += step * (best - here)
            if step < 1.0:
                first = int(parts.argmin())
                blocking = free[first]
                state[blocking] = 1 if best[first] > here[first] else -1
                curvatures[blocking] = bound[first]
                continue
            # Whether one held at a bound would rather leave it.
            gradient = self.gram @ curvatures + self.slope
            nothing = RELEASE_TOLERANCE * float(np.abs(gradient).max())
            high = int(np.where(state == 1, gradient, -np.inf).argmax())
            low = int(np.where(state == -1, gradient, np.inf).argmin())
            has_high, has_low = state[high] == 1, state[low] == -1
            if not len(free) and has_sum:
                # One alone cannot move under the sum: the two that pull most, one from each bound.
                if not (has_high and has_low):
                    return curvatures, -float(gradient[high if has_high else low])
                multiplier = -float(gradient[high] + gradient[low]) / 2
                if gradient[high] - gradient[low] <= nothing:
                    break
                state[[high, low]] = 0
                continue
            pull_high = gradient[high] + multiplier if has_high else 0.0
            pull_low = -gradient[low] - multiplier if has_low else 0.0
            if max(pull_high, pull_low) <= nothing:
                break
            state[high if pull_high >= pull_low else low] = 0
        return curvatures, multiplier

    def _start(self) -> FloatArray:
        """Return curvatures within the bounds that sum to the total, as even as can be."""
        size, has_sum = len(self.slope), not math.isnan(self.total)
        curvatures = np.clip(np.full(size, self.total / size if has_sum else 0.0), self.least, self.most)
        for _ in range(size if has_sum else 0):
            missing = self.total - float(curvatures.sum())
            movable = np.count_nonzero(curvatures < self.most if missing > 0 else curvatures > self.least)
            if missing == 0.0 or movable == 0:
                break
            curvatures = np.clip(curvatures + missing / movable, self.least, self.most)
        return curvatures


@compiled
def best_free(
    gram: FloatArray, slope: FloatArray, total: float, state: IntArray, curvatures: FloatArray
) -> tuple[IntArray, FloatArray, float]:
    """Return the free variables, in state 0, their best values with the others held, and the multiplier of the sum.

    Sets of cones are fitted by the hundred: by array operations, a flattening takes up to a third longer.
    """
    free = np.flatnonzero(state == 0)
    count, largest, left = len(free), 0.0, total
    best, ones, lower = -slope[free], np.ones(count), np.empty((count, count))
    for j in range(len(state)):
        if state[j] != 0:
            left -= curvatures[j]
            for i in range(count):
                best[i] -= gram[free[i], j] * curvatures[j]
    for i in range(count):
        largest = max(largest, gram[free[i], free[i]])
    # The Cholesky factor, and what it makes of both right sides.
    for i in range(count):
        for j in range(i + 1):
            value = gram[free[i], free[j]]
            for m in range(j):
                value -= lower[i, m] * lower[j, m]
            lower[i, j] = math.sqrt(max(value, SMALLEST_PIVOT * largest)) if i == j else value / lower[j, j]
        for j in range(i):
            best[i] -= lower[i, j] * best[j]
            ones[i] -= lower[i, j] * ones[j]
        best[i] /= lower[i, i]
        ones[i] /= lower[i, i]
    sum_best, sum_ones = 0.0, 0.0
    for i in range(count - 1, -1, -1):
        for j in range(i + 1, count):
            best[i] -= lower[j, i] * best[j]
            ones[i] -= lower[j, i] * ones[j]
        best[i] /= lower[i, i]
        ones[i] /= lower[i, i]
        sum_best += best[i]
        sum_ones += ones[i]
    if math.isnan(total) or count == 0:
        return free, best, 0.0
    multiplier = (sum_best - left) / sum_ones
    return free, best - multiplier * ones, multiplier


@compiled
def change_at_once(
    gram: FloatArray, slope: FloatArray, least: FloatArray, most: FloatArray, total: float
) -> tuple[FloatArray, float] | None:
    """Return the optimum and the multiplier, by changing all bounds that are in the way, or no longer, at once.

    The primal-dual active set method (M. Hintermueller, K. Ito, K. Kunisch, "The primal-dual active set strategy
    as a semismooth Newton method", 2003): a handful of steps where it ends; None where it does not.
    """
    size = len(slope)
    state, curvatures, gradient = np.zeros(size, np.int64), np.zeros(size), np.empty(size)
    for _ in range(MAX_STEPS_AT_ONCE):
        free, best, multiplier = best_free(gram, slope, total, state, curvatures)
        if not len(free):
            return None
        curvatures[free] = best
        nothing, is_same = 0.0, True
        for i in range(size):
            gradient[i] = slope[i]
            for j in range(size):
                gradient[i] += gram[i, j] * curvatures[j]
            nothing = max(nothing, RELEASE_TOLERANCE * abs(gradient[i]))
        for i in range(size):
            new = state[i]
            if new == 0:
                new = int(curvatures[i] > most[i]) - int(curvatures[i] < least[i])
            elif new * (gradient[i] + multiplier) > nothing:
                new = 0
            is_same = is_same and new == state[i]
            state[i] = new
        if is_same:
            return curvatures, multiplier
        for i in range(size):
            curvatures[i] = min(max(curvatures[i], least[i]), most[i])
    return None
