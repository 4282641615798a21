"""Rasterisation of triangles, compiled."""

from __future__ import annotations

import math

from .._arrays import FloatArray, IntArray
from ..compiled import compiled


@compiled
def first_centre(position: float, size: int) -> int:
    """Return the first pixel whose centre is at a position or beyond, from 0 up to the size."""
    return int(min(max(math.ceil(position - 0.5), 0.0), float(size)))


@compiled
def crossing(points: FloatArray, p: int, q: int, y: float) -> float:
    """Return the x at which the side between two points crosses a scan line; NaN if it does not."""
    # From the upper end to the lower in every triangle: both faces of an edge then round alike.
    if points[p, 1] > points[q, 1]:
        p, q = q, p
    if not points[p, 1] <= y < points[q, 1]:
        return math.nan
    drop = points[q, 1] - points[p, 1]
    return points[p, 0] + (y - points[p, 1]) / drop * (points[q, 0] - points[p, 0])


@compiled
def fill_nearest(points: FloatArray, faces: IntArray, depth: FloatArray, face: IntArray) -> None:
    """Write the nearest face, and its depth, to every pixel whose centre a face covers.

    points: (n, 3) pixel x to the right, pixel y downwards, and depth away from the eye. depth, face: (h, w) what there
    is already; of faces at the same depth the first stays.
    """
    height, width = depth.shape
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        xa, ya, za = points[a, 0], points[a, 1], points[a, 2]
        xb, yb, zb = points[b, 0] - xa, points[b, 1] - ya, points[b, 2] - za
        xc, yc, zc = points[c, 0] - xa, points[c, 1] - ya, points[c, 2] - za
        total = xb * yc - yb * xc
        right = (zb * yc - zc * yb) / total if total != 0 else 0.0
        down = (zc * xb - zb * xc) / total if total != 0 else 0.0
        # In a triangle seen nearly edge on the gradient is mostly rounding error.
        nearest = min(za, points[b, 2], points[c, 2])
        farthest = max(za, points[b, 2], points[c, 2])
        first = first_centre(min(ya, points[b, 1], points[c, 1]), height)
        stop = first_centre(max(ya, points[b, 1], points[c, 1]), height)
        for row in range(first, stop):
            y = row + 0.5
            left, end = math.inf, -math.inf
            for p, q in ((a, b), (b, c), (c, a)):
                x = crossing(points, p, q, y)
                if x < left:
                    left = x
                if x > end:
                    end = x
            for column in range(first_centre(left, width), first_centre(end, width)):
                z = za + right * (column + 0.5 - xa) + down * (y - ya)
                z = min(max(z, nearest), farthest)
                if z < depth[row, column]:
                    depth[row, column] = z
                    face[row, column] = f


@compiled
def count_steps(corners: FloatArray, steps: IntArray) -> None:
    """Add to every row where triangles begin, and subtract where they end: sums along rows are numbers of layers.

    corners: (m, 3, 2) pixel x to the right, pixel y downwards. steps: (h, w + 1). A pixel is covered if its centre is.
    """
    height, width = steps.shape[0], steps.shape[1] - 1
    for points in corners:
        first = first_centre(points[:, 1].min(), height)
        for row in range(first, first_centre(points[:, 1].max(), height)):
            left, end = math.inf, -math.inf
            for p in range(3):
                x = crossing(points, p, (p + 1) % 3, row + 0.5)
                if x < left:
                    left = x
                if x > end:
                    end = x
            if left < end:
                steps[row, first_centre(left, width)] += 1
                steps[row, first_centre(end, width)] -= 1
