"""What each candidate would gain, by projecting all of them off a set of cones: plain loops, the innermost over them.

Small matrix products by BLAS take longer here: it starts threads for them.
"""

from __future__ import annotations

import numpy as np

from ..._arrays import BoolArray, FloatArray, IntArray
from ...compiled import compiled
from .fit_curvatures import factor_lower

# What must remain of a candidate's diagonal for it to be independent of the members.
INDEPENDENT = 1e-9


@compiled
def project(
    gram: FloatArray, diagonal: FloatArray, free: IntArray, has_sum: bool, with_rows: bool
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Project candidates off the free members, and off the sum.

    Args:
        gram: (m, m), diagonal: (m,).
        free: (f,) members.
        has_sum: whether the sum is kept.
        with_rows: whether more than the first result is wanted.

    Returns:
        (m,) what remains of the diagonal of the gram matrix, (f, m) the coefficients of the projection, and
        (f,) the diagonal of the inverse of the members' gram matrix, with the sum kept and without.
    """
    size, count = len(free), len(diagonal)
    remain = diagonal.copy()
    lower = np.zeros((size, size))
    factor_lower(gram, free, size, lower)
    # By forward substitution, lower rows = gram[free], and lower ones = 1.
    rows = np.empty((size, count))
    ones = np.ones(size)
    missing = np.ones(count)
    whole = 0.0
    for i in range(size):
        for t in range(count):
            rows[i, t] = gram[free[i], t]
        for j in range(i):
            factor = lower[i, j]
            ones[i] -= factor * ones[j]
            for t in range(count):
                rows[i, t] -= factor * rows[j, t]
        ones[i] /= lower[i, i]
        whole += ones[i] * ones[i]
        for t in range(count):
            rows[i, t] /= lower[i, i]
            remain[t] -= rows[i, t] * rows[i, t]
            missing[t] -= ones[i] * rows[i, t]
    if has_sum and size > 0:
        for t in range(count):
            remain[t] += missing[t] * missing[t] / whole
    kept, bare = np.zeros(size), np.zeros(size)
    if not with_rows:
        return remain, rows, kept, bare
    # By backward substitution, lower^T rows = rows; the diagonal of the inverse from that of lower.
    for i in range(size - 1, -1, -1):
        for j in range(i + 1, size):
            factor = lower[j, i]
            ones[i] -= factor * ones[j]
            for t in range(count):
                rows[i, t] -= factor * rows[j, t]
        ones[i] /= lower[i, i]
        for t in range(count):
            rows[i, t] /= lower[i, i]
    column = np.empty(size)
    for i in range(size):
        for k in range(i, size):
            value = 1.0 if k == i else 0.0
            for j in range(i, k):
                value -= lower[k, j] * column[j]
            column[k] = value / lower[k, k]
            bare[i] += column[k] * column[k]
        kept[i] = bare[i]
        if has_sum:
            kept[i] -= ones[i] * ones[i] / whole
            for t in range(count):
                rows[i, t] += ones[i] / whole * missing[t]
    return remain, rows, kept, bare


@compiled
def gradients(
    gram: FloatArray, slope: FloatArray, members: IntArray, curvatures: FloatArray, multiplier: float
) -> FloatArray:
    """Return (m,) half the derivative of E^2, and of what keeps the sum, by the curvature of each candidate."""
    gradient = slope + multiplier
    for i in range(len(members)):
        for t in range(len(gradient)):
            gradient[t] += curvatures[i] * gram[members[i], t]
    return gradient


@compiled
def addition_scores(
    gram: FloatArray,
    diagonal: FloatArray,
    gradient: FloatArray,
    free: IntArray,
    least: FloatArray,
    most: FloatArray,
    has_sum: bool,
) -> FloatArray:
    """Return (m,) by how much E^2 changes if a candidate joins (0 or less), bounds of others aside."""
    remain = project(gram, diagonal, free, has_sum, False)[0]
    change = np.zeros(len(remain))
    for t in range(len(remain)):
        if remain[t] > INDEPENDENT * diagonal[t]:
            x = min(max(-gradient[t] / remain[t], least[t]), most[t])
            change[t] = (2 * gradient[t] + remain[t] * x) * x
    return change


@compiled
def best_swap(
    row: FloatArray,
    kept: float,
    k: float,
    gradient: FloatArray,
    remain: FloatArray,
    diagonal: FloatArray,
    is_open: BoolArray,
    least: FloatArray,
    most: FloatArray,
    tie: float,
) -> tuple[float, int]:
    """Return the change of E^2 by the best replacement of a member, and which candidate that is, -1 if none.

    Args:
        row: (m,) coefficients of the projection of candidates on the member.
        kept: its entry on the diagonal of the inverse of the members' gram matrix, with the sum kept.
        k: its curvature.
        gradient: (m,) half the derivative of E^2 by the curvature of a candidate.
        remain: (m,) what the projection leaves of the candidates' gram entries.
        diagonal: (m,) of the gram matrix.
        is_open: (m,) the candidates that may come in.
        least, most: (m,) bounds of the candidates' curvatures.
        tie: changes that differ by less, relatively, are equal; the first candidate counts.
    """
    share = 1.0 / kept
    lost = k * k * share
    values, lowest = np.empty(len(diagonal)), np.inf
    for t in range(len(diagonal)):
        values[t] = np.inf
        if is_open[t]:
            w = row[t]
            h = remain[t] + w * w * share
            if h > INDEPENDENT * diagonal[t]:
                g = gradient[t] - w * k * share
                x = min(max(-g / h, least[t]), most[t])
                values[t] = lost + (2.0 * g + h * x) * x
                lowest = min(lowest, values[t])
    if lowest < np.inf:
        limit = lowest + tie * abs(lowest)
        for t in range(len(diagonal)):
            if values[t] <= limit:
                return values[t], t
    return np.inf, -1
