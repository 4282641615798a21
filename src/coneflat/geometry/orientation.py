"""The exact orientation predicate: on which side of a line a point lies.

A floating-point filter decides nearly all cases; the others are evaluated exactly (J. R. Shewchuk, "Adaptive precision
floating-point arithmetic and fast robust geometric predicates", 1997). Coordinates must be 0 or have magnitudes from
2^-420 to 2^420, so that nothing overflows or underflows.
"""

from __future__ import annotations

import numpy as np

from ..base.arrays import FloatArray, IntArray
from ..base.jit import compiled

# Rounding of the determinant, relative to the sum of the magnitudes of its two products (Shewchuk, Section 4.3).
FILTER = (3 + 16 * 2.0**-53) * 2.0**-53
# Factor that splits a number into two halves of 26 bits (Dekker 1971).
SPLITTER = 2.0**27 + 1


@compiled
def orientation(px: float, py: float, qx: float, qy: float, rx: float, ry: float, parts: FloatArray) -> float:
    """Return a number that is positive if r is left of the line from p to q, negative if it is right, 0 if on it.

    parts: (12,) buffer for exact sums.
    """
    left = (px - rx) * (qy - ry)
    right = (py - ry) * (qx - rx)
    if abs(left - right) >= FILTER * (abs(left) + abs(right)):
        return left - right
    for count in (0, 4, 8):
        _add_product(parts, count, px, qy)
        _add_product(parts, count + 2, -py, qx)
        px, py, qx, qy, rx, ry = qx, qy, rx, ry, px, py
    largest = 11
    while largest > 0 and parts[largest] == 0:
        largest -= 1
    return parts[largest]


@compiled
def _add_product(parts: FloatArray, count: int, x: float, y: float) -> None:
    """Add the product x y to a sum, exactly (Dekker 1971).

    parts: the components of the sum, of which the first `count` are used. They do not overlap and have ascending
    magnitudes, so the last one that is not 0 has the sign of the sum.
    """
    scaled = SPLITTER * x
    x_high = scaled - (scaled - x)
    x_low = x - x_high
    scaled = SPLITTER * y
    y_high = scaled - (scaled - y)
    y_low = y - y_high
    product = x * y
    error = x_low * y_low - (((product - x_high * y_high) - x_low * y_high) - x_high * y_low)
    for term in (error, product):
        for i in range(count):  # Shewchuk, GROW-EXPANSION
            total = parts[i] + term
            moved = total - parts[i]
            parts[i] = (parts[i] - (total - moved)) + (term - moved)
            term = total
        parts[count] = term
        count += 1


@compiled
def fill_orientations(corners: FloatArray, parts: FloatArray, signs: IntArray) -> None:
    """Write the orientations (m,) of triangles (m, 6): 1 counterclockwise, -1 clockwise, 0 without area."""
    for t in range(len(corners)):
        c = corners[t]
        turn = orientation(c[0], c[1], c[2], c[3], c[4], c[5], parts)
        signs[t] = int(turn > 0) - int(turn < 0)


def counterclockwise(corners: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return (m, 3, 2) the triangles, with clockwise ones reversed, and (m,) their orientations 1, -1 or 0."""
    signs = np.empty(len(corners), dtype=np.int64)
    fill_orientations(corners.reshape(-1, 6), np.empty(12), signs)
    clockwise = np.flatnonzero(signs < 0)
    if not len(clockwise):
        return corners, signs
    oriented = corners.copy()
    oriented[clockwise] = corners[clockwise][:, ::-1]
    return oriented, signs
