"""Convex hulls, compiled."""

from __future__ import annotations

from .._arrays import FloatArray, IntArray
from ..geometry.compiled import compiled


@compiled
def fill_hull(points: FloatArray, hull: IntArray) -> int:
    """Find the corners of a convex hull by monotone chains (Andrew 1979) and return their number.

    Args:
        points: (n, 2) different points, n > 1, sorted by their first coordinate and then the second.
        hull: (n + 1,) filled with the corners, counterclockwise; only the two ends of points on a line.
    """
    count, last = 0, len(points) - 1
    for chain in range(2):
        begin = count
        for i in range(len(points)):
            k = i if chain == 0 else last - i
            while count > begin + 1:
                a, b = points[hull[count - 2]], points[hull[count - 1]]
                if (b[0] - a[0]) * (points[k, 1] - a[1]) > (b[1] - a[1]) * (points[k, 0] - a[0]):
                    break
                count -= 1
            hull[count] = k
            count += 1
        count -= 1  # each chain ends where the other begins
    return count
