"""Orientation of charts in the plane: the angles by which they are rotated."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import FloatArray, IntArray
from ..base.jit import compiled
from ..errors import OptionError
from .charts import Charts, Outlines, read_charts
from .straight import HALF_PI, RELATIVE_TOLERANCE, straight_directions

if TYPE_CHECKING:
    ComplexArray = NDArray[np.complex128]


def orient_charts(
    corner_uv: ArrayLike,
    chart_of_triangle: ArrayLike | None = None,
    *,
    corners: ArrayLike | None = None,
    up: ArrayLike | None = None,
) -> FloatArray:
    """Return (m, 3, 2) charts aligned with the axes, each rotated about the origin without other changes.

    Where much of a chart's border is straight, as for boxes, most of it becomes parallel to the axes; otherwise the
    rectangle of least area around the chart does. Without an up direction its long side is along u and the half of
    the chart with more area is below. With an up direction, the chart is rotated by the multiple of a quarter turn
    for which the surface rises the most along v.

    Args:
        corner_uv: (m, 3, 2) positions of the triangle corners in the plane, of any number of meshes.
        chart_of_triangle: (m,) chart index of each triangle, from 0; None for one chart.
        corners: (m, 3, 3) the triangle corners in space; needed for an up direction.
        up: (3,) the direction in space that should map to v.

    Raises:
        ArrayShapeError, NonFiniteError: the shape of an array is wrong, or its values are not finite.
        OptionError: a chart is mirrored, or `up` is not a direction, or is given without `corners`.
    """
    charts = read_charts(corner_uv, chart_of_triangle)
    outlines = charts.outlines()
    angles = straight_angles(charts, outlines, border_directions(outlines))
    if up is not None:
        rise = mean_rise(charts, corners, up) * np.exp(1j * angles)
        angles += HALF_PI * np.round((HALF_PI - np.angle(rise)) / HALF_PI)
    return charts.moved(np.exp(1j * angles))


def border_directions(outlines: Outlines) -> list[FloatArray]:
    """Return for each chart the directions of the straight parts of its border, see `straight_directions`."""
    return [straight_directions(outlines.sides[start:stop]) for start, stop in pairwise(outlines.start)]


def straight_angles(charts: Charts, outlines: Outlines, directions: list[FloatArray]) -> FloatArray:
    """Return (k,) the angle, radians, that aligns each chart with the axes, the half with more area below.

    Args:
        charts: the k charts.
        outlines: their outlines.
        directions: for each chart the directions of its border, see `border_directions`.
    """
    angles = np.array([straight_angle(outlines.points(c), directions[c]) for c in range(charts.count)])
    turned = outlines.times(np.exp(1j * angles)).sides.imag.ravel()
    start = 2 * outlines.start[:-1]
    middle = (np.minimum.reduceat(turned, start) + np.maximum.reduceat(turned, start)) / 2
    height = (charts.corners * np.exp(1j * angles)[charts.chart][:, None]).imag.mean(axis=1)
    top_heavy = charts.sums(charts.areas * (height - middle[charts.chart])) > 0
    return angles + np.where(top_heavy, np.pi, 0.0)


def straight_angle(points: ComplexArray, directions: FloatArray) -> float:
    """Return the angle, radians, that aligns the rectangle of least area around points, its long side along u.

    One side of the rectangle is along one of the directions. If there are none, it is along a side of the convex
    hull, as for the rectangle of least area overall (Freeman and Shapira 1975).
    """
    hull = convex_hull(points)
    if not len(directions):
        directions = np.angle(np.roll(hull, -1) - hull)
    width, height = _extents(hull, directions)
    area, longer = width * height, np.maximum(width, height)
    # Among rectangles of equal area, as around many quadrilaterals, the longest is chosen.
    best = int(np.where(area <= area.min() * (1 + RELATIVE_TOLERANCE), longer, 0.0).argmax())
    return float(-directions[best] + (HALF_PI if height[best] > width[best] else 0.0))


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


def mean_rise(charts: Charts, corners: ArrayLike | None, up: ArrayLike) -> ComplexArray:
    """Return (k,) for each chart the integral of the height gradient over the plane, as complex numbers.

    The gradient is constant on a triangle; multiplied by the area it is a sum over the sides without a division.
    """
    direction = np.asarray(up, dtype=np.float64)
    if direction.shape != (3,) or not np.isfinite(direction).all() or not direction.any():
        raise OptionError(f"up must be a direction, three numbers that are not all 0, got {up!r}")
    if corners is None:
        raise OptionError("an up direction needs the corners of the triangles in space")
    positions = np.asarray(corners, dtype=np.float64)
    if positions.shape != (*charts.corners.shape, 3):
        raise OptionError(f"corners must have shape {(*charts.corners.shape, 3)}, got {positions.shape}")
    height = positions @ (direction / np.abs(direction).max())
    opposite = charts.corners[:, [2, 0, 1]] - charts.corners[:, [1, 2, 0]]
    rise = 0.5j * (height * opposite).sum(axis=1)
    return charts.sums(rise.real) + 1j * charts.sums(rise.imag)


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
