"""The table of all exchanges of one cone for another: plain loops over what the dense model has projected."""

from __future__ import annotations

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray
from ..compiled import compiled


@compiled
def swap_table(
    rows: FloatArray,
    kept: FloatArray,
    curvatures: FloatArray,
    gradient: FloatArray,
    remain: FloatArray,
    floor: FloatArray,
    is_open: BoolArray,
    least: FloatArray,
    most: float,
    tie: float,
) -> tuple[FloatArray, IntArray]:
    """Return (p,) the change of E^2 by the best replacement of each member, and which candidate that is.

    Args:
        rows: (p, m) coefficients of the projection of candidates on members.
        kept: (p,) diagonal of the inverse of the members' gram matrix, with the sum kept.
        curvatures: (p,) of the members.
        gradient: (m,) half the derivative of E^2 by the curvature of a candidate.
        remain: (m,) what the projection leaves of the candidates' gram entries.
        floor: (m,) what must be left of them once a member is gone.
        is_open: (m,) the candidates that may come in.
        least: (m,) bound of the candidates' curvatures.
        most: the upper bound.
        tie: changes that differ by less, relatively, are equal; the first candidate counts.
    """
    size, count = rows.shape
    change = np.full(size, np.inf)
    which = np.full(size, -1)
    values = np.empty(count)
    for i in range(size):
        k, share = curvatures[i], 1.0 / kept[i]
        lost = k * k * share
        lowest = np.inf
        for t in range(count):
            values[t] = np.inf
            if is_open[t]:
                w = rows[i, t]
                h = remain[t] + w * w * share
                if h > floor[t]:
                    g = gradient[t] - w * k * share
                    x = min(max(-g / h, least[t]), most)
                    values[t] = lost + (2.0 * g + h * x) * x
                    lowest = min(lowest, values[t])
        if lowest < np.inf:
            limit = lowest + tie * abs(lowest)
            for t in range(count):
                if values[t] <= limit:
                    change[i], which[i] = values[t], t
                    break
    return change, which
