"""The scaled Jacobians of quads."""

from __future__ import annotations

import numpy as np

from .._arrays import FloatArray, IntArray, dots


def least_jacobians(points: FloatArray, quads: IntArray) -> FloatArray:
    """Return (p,) the least scaled Jacobian of each quad: sines of its angles, seen along the normal.

    The normal is that of the two diagonals; 1 is a rectangle's, and below 0 a quad is turned over at a corner.
    """
    corners = points[quads]
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    normal /= np.maximum(np.sqrt(dots(normal, normal)), np.finfo(float).tiny)[:, None]
    least = np.full(len(quads), np.inf)
    for i in range(4):
        a, b = corners[:, i - 1] - corners[:, i], corners[:, (i + 1) % 4] - corners[:, i]
        scale = np.maximum(np.sqrt(dots(a, a) * dots(b, b)), np.finfo(float).tiny)
        least = np.minimum(least, dots(np.cross(b, a), normal) / scale)
    return least
