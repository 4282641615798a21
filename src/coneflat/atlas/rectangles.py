"""The smallest rectangles and squares around points."""

from __future__ import annotations

import math

import numpy as np

from ..base.arrays import ComplexArray, FloatArray, IntArray
from ..base.jit import compiled

HALF_PI = np.pi / 2
# Lengths, areas and fractions of a turn with a smaller relative difference, and angles with a smaller difference in
# radians, are equal up to rounding.
RELATIVE_TOLERANCE = 1e-6


def straight_angle(points: ComplexArray, directions: FloatArray) -> float:
    """Return the angle, radians, that aligns the rectangle of least area around points, its long side along u.

    One side of the rectangle is along one of the directions. If there are none, it is along a side of the convex
    hull, as for the rectangle of least area overall (Freeman and Shapira 1975).
    """
    return float(straight_angles_of(points, np.zeros(len(points), dtype=np.int64), [directions])[0])


def straight_angles_of(points: ComplexArray, chart: IntArray, directions: list[FloatArray]) -> FloatArray:
    """Return (k,) the angles of `straight_angle` for the points (n,) of k charts; chart: (n,) that of each."""
    order = np.lexsort((points.imag, points.real, chart))
    points, chart = points[order], chart[order]
    is_new = np.concatenate([[True], (np.diff(chart) > 0) | (np.diff(points) != 0)])
    points, chart = points[is_new], chart[is_new]
    start = np.searchsorted(chart, np.arange(len(directions) + 1))
    ends = np.cumsum([len(of_border) for of_border in directions])
    return rectangle_angles(points.view(np.float64).reshape(-1, 2), start, np.concatenate(directions), ends)


@compiled
def rectangle_angles(
    points: FloatArray, start: IntArray, directions: FloatArray, ends: IntArray
) -> FloatArray:
    """Return (k,) the angles, radians, that align the rectangles of least area around charts, see `straight_angle`.

    Args:
        points: (n, 2) points of the charts, sorted and distinct within each chart.
        start: (k + 1,) the first point of each chart.
        directions: (d,) directions that the sides of rectangles must have.
        ends: (k,) where those of each chart end; a chart without any uses the sides of its convex hull.
    """
    angles, begin = np.zeros(len(ends)), 0
    for c in range(len(ends)):
        hull = hull_points(points[start[c] : start[c + 1]])
        if ends[c] == begin:
            angles[c] = longest_rectangle(*rectangles_along_hull(hull))
        else:
            angles[c] = longest_rectangle(*rectangles_along(hull, directions[begin : ends[c]]))
        begin = ends[c]
    return angles


@compiled
def hull_points(points: FloatArray) -> FloatArray:
    """Return (h, 2) the corners of the convex hull, counterclockwise, of points (n, 2) as for `fill_hull`."""
    indices, count = np.zeros(len(points) + 1, np.int64), 1
    if len(points) > 1:
        count = fill_hull(points, indices)
    hull = np.empty((count, 2))
    for i in range(count):
        hull[i, 0], hull[i, 1] = points[indices[i], 0], points[indices[i], 1]
    return hull


@compiled
def rectangles_along_hull(hull: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (h,) the angles, widths and heights of the rectangles with a side along each side of a hull (h, 2)."""
    count = len(hull)
    angle, width, height = np.empty(count), np.empty(count), np.empty(count)
    # The corners that are farthest along a side of the hull, at a right angle to it, and against it.
    ahead, top, behind = 0, 0, 0
    for i in range(count):
        head = (i + 1) % count
        angle[i] = math.atan2(hull[head, 1] - hull[i, 1], hull[head, 0] - hull[i, 0])
        x, y = math.cos(angle[i]), math.sin(angle[i])
        ahead = climb(hull, max(ahead, i), x, y)
        top = climb(hull, max(top, ahead), -y, x)
        behind = climb(hull, max(behind, top), -x, -y)
        f, t, n = ahead % count, top % count, behind % count
        width[i] = (hull[f, 0] - hull[n, 0]) * x + (hull[f, 1] - hull[n, 1]) * y
        height[i] = (hull[t, 1] - hull[i, 1]) * x - (hull[t, 0] - hull[i, 0]) * y
    return angle, width, height


@compiled
def rectangles_along(hull: FloatArray, directions: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the directions (d,), and (d,) the widths and heights of the rectangles along them around a hull (h, 2)."""
    width, height = np.empty(len(directions)), np.empty(len(directions))
    for i in range(len(directions)):
        x, y = math.cos(directions[i]), math.sin(directions[i])
        low_x, low_y, high_x, high_y = np.inf, np.inf, -np.inf, -np.inf
        for k in range(len(hull)):
            along, across = hull[k, 0] * x + hull[k, 1] * y, hull[k, 1] * x - hull[k, 0] * y
            low_x, high_x = min(low_x, along), max(high_x, along)
            low_y, high_y = min(low_y, across), max(high_y, across)
        width[i], height[i] = high_x - low_x, high_y - low_y
    return directions, width, height


@compiled
def longest_rectangle(angle: FloatArray, width: FloatArray, height: FloatArray) -> float:
    """Return the angle that aligns the rectangle of least area with its long side along u.

    Among rectangles of equal area, as around many quadrilaterals, the longest is chosen.

    angle, width, height: (r,) those of the rectangles.
    """
    smallest, longest, best = np.inf, -1.0, 0
    for i in range(len(angle)):
        smallest = min(smallest, width[i] * height[i])
    for i in range(len(angle)):
        longer = max(width[i], height[i])
        if width[i] * height[i] <= smallest * (1 + RELATIVE_TOLERANCE) and longer > longest:
            longest, best = longer, i
    return -angle[best] + (HALF_PI if height[best] > width[best] else 0.0)


@compiled
def climb(hull: FloatArray, at: int, x: float, y: float) -> int:
    """Return the place on a hull, from a place on and counterclockwise, at which the corners cease to rise.

    Args:
        hull: (h, 2) corners, counterclockwise; places are counted on beyond their number.
        at: the place to begin at.
        x, y: the direction in which corners rise.
    """
    for _ in range(len(hull)):
        tail, head = at % len(hull), (at + 1) % len(hull)
        if (hull[head, 0] - hull[tail, 0]) * x + (hull[head, 1] - hull[tail, 1]) * y <= 0.0:
            break
        at += 1
    return at


def square_angle(points: ComplexArray, directions: FloatArray) -> float:
    """Return the angle, radians, that aligns the smallest square around points with a side along one of the directions.

    If there are no directions, it is the smallest square overall. Between two angles at which the points that touch
    its sides change, width and height are cosines; their maximum is smallest at an end, or where they are equal.
    """
    hull = convex_hull(points)
    if len(directions):
        width, height = _extents(hull, directions)
        return float(-directions[np.maximum(width, height).argmin()])
    ends = np.unique(np.mod(np.angle(np.roll(hull, -1) - hull), HALF_PI))
    middle = (ends + np.append(ends[1:], ends[0] + HALF_PI)) / 2
    across, along = _spans(hull, middle), _spans(hull, middle + HALF_PI)
    # (across . (cos, sin) = along . (-sin, cos))
    equal = np.arctan2(along.imag - across.real, across.imag + along.real)
    angles = np.concatenate([ends, equal])
    width, height = _extents(hull, angles)
    return float(-angles[np.maximum(width, height).argmin()])


def convex_hull(points: ComplexArray) -> ComplexArray:
    """Return the corners of the convex hull, counterclockwise; the two end points if the points are on a line."""
    points = np.unique(points)
    if len(points) == 1:
        return points
    hull = np.empty(len(points) + 1, dtype=np.int64)
    return points[hull[: fill_hull(points.view(np.float64).reshape(-1, 2), hull)]]


def _spans(hull: ComplexArray, angles: FloatArray) -> ComplexArray:
    """Return for each direction the vector from the hull's nearest corner to its farthest along that direction."""
    sides = np.roll(hull, -1) - hull
    start = np.angle(sides[0])
    # Corner i + 1 is the farthest in the directions between a quarter turn before side i and before side i + 1.
    directions = np.maximum.accumulate(np.mod(np.angle(sides) - start, 2 * np.pi))
    directions[0] = 0.0

    def farthest(angle: FloatArray) -> ComplexArray:
        after = np.searchsorted(directions, np.mod(angle + HALF_PI - start, 2 * np.pi), side="right")
        return hull[after % len(hull)]

    return farthest(angles) - farthest(angles + np.pi)


def _extents(hull: ComplexArray, angles: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the hull's extents along the directions and perpendicular to them."""
    axis = np.exp(1j * angles)
    width = (np.conj(axis) * _spans(hull, angles)).real
    height = (np.conj(1j * axis) * _spans(hull, angles + HALF_PI)).real
    return width, height


@compiled
def fill_hull(points: FloatArray, hull: IntArray) -> int:
    """Fill in the corners of a convex hull by monotone chains (Andrew 1979) and return their number.

    Args:
        points: (n, 2) distinct points, n > 1, sorted by their first coordinate and then the second.
        hull: (n + 1,) filled with the indices of the corners, counterclockwise; of collinear points only the two ends.
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
