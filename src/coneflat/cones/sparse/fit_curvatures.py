"""Curvatures of given cones by a convex quadratic program in a few variables, with exact active set methods."""

from __future__ import annotations

import math

import numpy as np

from ...base.arrays import FloatArray, IntArray
from ...base.jit import compiled
from ..solution import TIE_TOLERANCE

# Value added to the diagonal, relative to its largest entry, as cones at neighbouring vertices are nearly dependent.
MIN_PIVOT = 1e-13
# Violation of the sign of a multiplier, relative to the largest gradient, above which its bound is released.
RELEASE_TOLERANCE = 1e-11
# Number of steps after which the method that changes all bounds at once is stopped, as it may cycle. Changing them one
# by one only takes twelve times as long for the 173 cones of 49 handles, most of which are at a bound.
MAX_STEPS_AT_ONCE = 20


def fit_curvatures(
    gram: FloatArray,
    slope: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    total: float,
    guess: FloatArray | None = None,
) -> tuple[FloatArray, float, bool]:
    """Return the curvatures k that minimise k gram k / 2 + slope k with bounds and a given sum.

    The result is the exact optimum, since the program is strictly convex: if changing all bounds at once does not
    converge, changing them one by one does.

    Args:
        gram: (s, s) Gram matrix.
        slope: (s,) linear term.
        lower, upper: (s,) bounds, radians.
        total: sum of the curvatures, radians; NaN for none.
        guess: (s,) curvatures that are expected to be at the same bounds, which saves steps; None if unknown.

    Returns:
        (s,) the curvatures, the multiplier of the sum, and whether the bounds allow the sum. If they do not, the
        bounds are ignored.

    Notes:
        The optimum satisfies gram k + slope + multiplier = 0 at free variables; at the lower bound the left side is
        not negative, at the upper not positive (Karush, Kuhn, Tucker). `change_at_once` is a semismooth Newton method:
        a step solves for the free variables, and the signs decide which are free in the next. There is no function to
        decrease along a step, so that `linalg.newton`, whose line search needs one, does not apply.

    See Also:
        DenseModel.fit: calls this for sets of candidates.
    """
    has_sum = not math.isnan(total)
    if not len(slope):
        return np.zeros(0), 0.0, not has_sum or abs(total) < TIE_TOLERANCE
    slack = 1e-12 * (1.0 + abs(total))
    feasible = not has_sum or bool(lower.sum() - slack <= total <= upper.sum() + slack)
    if not feasible:
        lower, upper = np.full(len(slope), -np.inf), np.full(len(slope), np.inf)
    guess = np.full(len(slope), np.nan) if guess is None else guess
    curvatures, multiplier, is_optimal = change_at_once(gram, slope, lower, upper, total, guess)
    if not is_optimal:
        curvatures, multiplier = change_one_by_one(gram, slope, lower, upper, total, curvatures)
    return curvatures, multiplier, feasible


def inverse_with_sum(gram: FloatArray, has_sum: bool) -> FloatArray:
    """Return the inverse (s, s) of a Gram matrix; with `has_sum`, (s + 1, s + 1) bordered by the sum constraint."""
    size, diagonal = len(gram), gram.diagonal()
    # The border has the size of the entries, so that rounding errors are of the same size.
    unit = float(diagonal.max(initial=0.0)) or 1.0
    system = np.zeros((size + has_sum, size + has_sum))
    system[:size, :size] = gram
    system.flat[: size * len(system) : len(system) + 1] += MIN_PIVOT * unit
    system[size:, :size] = unit
    system[:size, size:] = unit
    inverse = np.asarray(np.linalg.inv(system), dtype=np.float64)
    inverse[size:] *= unit
    inverse[:, size:] *= unit
    return inverse


def change_one_by_one(
    gram: FloatArray, slope: FloatArray, lower: FloatArray, upper: FloatArray, total: float, start: FloatArray
) -> tuple[FloatArray, float]:
    """Return the optimum (s,) and the multiplier by a primal active set method, which always terminates.

    The states (s,) of the variables are -1 at the lower bound, 1 at the upper, and 0 for free ones.
    """
    size, has_sum, multiplier = len(slope), not math.isnan(total), 0.0
    curvatures = _allowed(lower, upper, total, start)
    state = (curvatures >= upper).astype(np.int64) - (curvatures <= lower)
    for _ in range(20 * size + 20):
        free, best, multiplier = best_free(gram, slope, total, state, curvatures)
        # Move towards the best values as far as the bounds allow.
        current = curvatures[free]
        is_above, is_beyond = best > upper[free], (best > upper[free]) | (best < lower[free])
        bound, parts = np.where(is_above, upper[free], lower[free]), np.where(is_beyond, 0.0, 1.0)
        np.divide(bound - current, best - current, out=parts, where=is_beyond & (best != current))
        parts = np.maximum(parts, 0.0)  # rounding can leave curvatures beyond a bound
        step = float(parts.min(initial=1.0))
        curvatures[free] += step * (best - current)
        if step < 1.0:
            first = int(parts.argmin())
            blocking = free[first]
            state[blocking] = 1 if is_above[first] else -1
            curvatures[blocking] = bound[first]
            continue
        # Find a variable at a bound whose release lowers the objective.
        gradient = gram @ curvatures + slope
        nothing = RELEASE_TOLERANCE * float(np.abs(gradient).max())
        high = int(np.where(state == 1, gradient, -np.inf).argmax())
        low = int(np.where(state == -1, gradient, np.inf).argmin())
        has_high, has_low = state[high] == 1, state[low] == -1
        if not len(free) and has_sum:
            # A single variable cannot move with a fixed sum: release the best one at each bound.
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


def _allowed(lower: FloatArray, upper: FloatArray, total: float, start: FloatArray) -> FloatArray:
    """Return (s,) curvatures within the bounds with the given sum, after a uniform change of the given ones."""
    size, has_sum = len(start), not math.isnan(total)
    curvatures = np.clip(start, lower, upper)
    for _ in range(size if has_sum else 0):
        missing = total - float(curvatures.sum())
        movable = np.count_nonzero(curvatures < upper if missing > 0 else curvatures > lower)
        if missing == 0.0 or movable == 0:
            break
        curvatures = np.clip(curvatures + missing / movable, lower, upper)
    return curvatures


@compiled
def best_free(
    gram: FloatArray, slope: FloatArray, total: float, state: IntArray, curvatures: FloatArray
) -> tuple[IntArray, FloatArray, float]:
    """Return the free variables (state 0), their best values with the others fixed, and the multiplier of the sum.

    Hundreds of sets of cones are fitted; with array operations, a flattening takes up to a third longer.
    """
    free, best, remainder = free_right_sides(gram, slope, total, state, curvatures)
    ones = np.ones(len(free))
    solve_both(gram, free, best, ones)
    if math.isnan(total) or len(free) == 0:
        return free, best, 0.0
    sum_best, sum_ones = 0.0, 0.0
    for i in range(len(free) - 1, -1, -1):
        sum_best += best[i]
        sum_ones += ones[i]
    multiplier = (sum_best - remainder) / sum_ones
    for i in range(len(free)):
        best[i] -= multiplier * ones[i]
    return free, best, multiplier


@compiled
def free_right_sides(
    gram: FloatArray, slope: FloatArray, total: float, state: IntArray, curvatures: FloatArray
) -> tuple[IntArray, FloatArray, float]:
    """Return the free variables, the right-hand sides of their equations, and what is left to them of the sum."""
    # Compiling array expressions takes as long as all the rest.
    variables, count = np.empty(len(state), np.int64), 0
    for j in range(len(state)):
        if state[j] == 0:
            variables[count] = j
            count += 1
    free, best, remainder = variables[:count], np.empty(count), total
    for i in range(count):
        best[i] = -slope[free[i]]
    for j in range(len(state)):
        if state[j] != 0:
            remainder -= curvatures[j]
            for i in range(count):
                best[i] -= gram[free[i], j] * curvatures[j]
    return free, best, remainder


@compiled
def solve_both(gram: FloatArray, free: IntArray, best: FloatArray, ones: FloatArray) -> None:
    """Solve the equations of free variables for two right-hand sides (f,), in place, by a Cholesky factorization."""
    count, largest = len(free), 0.0
    cholesky = np.empty((count, count))
    for i in range(count):
        largest = max(largest, gram[free[i], free[i]])
    for i in range(count):
        for j in range(i + 1):
            value = gram[free[i], free[j]]
            for m in range(j):
                value -= cholesky[i, m] * cholesky[j, m]
            cholesky[i, j] = math.sqrt(max(value, MIN_PIVOT * largest)) if i == j else value / cholesky[j, j]
        for j in range(i):
            best[i] -= cholesky[i, j] * best[j]
            ones[i] -= cholesky[i, j] * ones[j]
        best[i] /= cholesky[i, i]
        ones[i] /= cholesky[i, i]
    for i in range(count - 1, -1, -1):
        for j in range(i + 1, count):
            best[i] -= cholesky[j, i] * best[j]
            ones[i] -= cholesky[j, i] * ones[j]
        best[i] /= cholesky[i, i]
        ones[i] /= cholesky[i, i]


@compiled
def change_at_once(
    gram: FloatArray, slope: FloatArray, lower: FloatArray, upper: FloatArray, total: float, guess: FloatArray
) -> tuple[FloatArray, float, bool]:
    """Return the optimum (s,) and the multiplier, by updating all active bounds at once, and whether this converged.

    This is the primal-dual active set method (M. Hintermueller, K. Ito, K. Kunisch, "The primal-dual active set
    strategy as a semismooth Newton method", 2003). If it converges, it takes a few steps.
    """
    size = len(slope)
    state, curvatures, gradient = np.zeros(size, np.int64), np.zeros(size), np.empty(size)
    for i in range(size):
        state[i] = int(guess[i] >= upper[i]) - int(guess[i] <= lower[i])
        curvatures[i] = upper[i] if state[i] > 0 else lower[i]
    for _ in range(MAX_STEPS_AT_ONCE):
        free, best, multiplier = best_free(gram, slope, total, state, curvatures)
        if not len(free):
            break
        for i in range(len(free)):
            curvatures[free[i]] = best[i]
        nothing, is_same = 0.0, True
        for i in range(size):
            gradient[i] = slope[i]
            for j in range(size):
                gradient[i] += gram[i, j] * curvatures[j]
            nothing = max(nothing, RELEASE_TOLERANCE * abs(gradient[i]))
        for i in range(size):
            next_state = state[i]
            if next_state == 0:
                next_state = int(curvatures[i] > upper[i]) - int(curvatures[i] < lower[i])
            elif next_state * (gradient[i] + multiplier) > nothing:
                next_state = 0
            is_same = is_same and next_state == state[i]
            state[i] = next_state
        if is_same:
            return curvatures, multiplier, True
        for i in range(size):
            curvatures[i] = min(max(curvatures[i], lower[i]), upper[i])
    return curvatures, 0.0, False
