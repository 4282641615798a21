"""Orientation of charts in the plane: the angles by which they are rotated, and the straight runs of their borders."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ..base.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from ..base.jit import compiled
from .charts import Charts, Outlines

HALF_PI = np.pi / 2
# A run is straight if its distance from the line between its ends is below this fraction of its length. This includes
# arcs of less than 5 degrees, and a side of a box whose points are off by a thousandth of it.
MAX_STRAY = 0.01
# Fraction of a run at each end that is ignored for the direction: there it may bend into a rounded corner.
END_SHARE = 1 / 8
# Directions that differ by less, in radians, are the same. At most about a tenth of a smooth border is in one of them.
SAME_DIRECTION = np.radians(1.5)
# Fraction of a border that must be in one direction, modulo quarter turns. It is a third for an equilateral triangle
# and a hexagon, a sixth for a rim of 24 sides, up to 28 % and mostly 10 % for free forms.
MIN_STRAIGHT_SHARE = 0.4
# Lengths, areas and fractions of a turn with a smaller relative difference, and angles with a smaller difference in
# radians, are equal up to rounding.
RELATIVE_TOLERANCE = 1e-6


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
    height = charts.rotated(angles).corners.imag.mean(axis=1)
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


def mean_rise(charts: Charts, heights: FloatArray) -> ComplexArray:
    """Return (k,) for each chart the integral of the gradient of heights (m, 3) over the plane, as complex numbers.

    The gradient is constant on a triangle; multiplied by the area it is a sum over the sides without a division.
    """
    opposite = charts.corners[:, [2, 0, 1]] - charts.corners[:, [1, 2, 0]]
    rise = 0.5j * (heights * opposite).sum(axis=1)
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


def straight_directions(sides: ComplexArray) -> FloatArray:
    """Return the directions, radians in [0, pi / 2), of the straight parts of a border; none if too little is straight.

    Perpendicular directions count as one. Several directions are returned only if the same length of the border is in
    each, as for a regular polygon.

    Args:
        sides: (s, 2) start and end of each side of an outline as complex numbers, in any order.
    """
    runs = straight_runs(sides)
    lengths, angles = np.abs(runs), np.mod(np.angle(runs), HALF_PI)
    order = np.argsort(angles, kind="stable")
    lengths, angles = lengths[order], angles[order]
    around = np.concatenate([angles - HALF_PI, angles, angles + HALF_PI])
    total = np.concatenate([[0.0], np.cumsum(np.tile(lengths, 3))])
    begin = np.searchsorted(around, angles - SAME_DIRECTION)
    end = np.searchsorted(around, angles + SAME_DIRECTION, side="right")
    alike = total[end] - total[begin]
    border = np.abs(sides[:, 1] - sides[:, 0]).sum()
    if not len(runs) or alike.max() <= MIN_STRAIGHT_SHARE * border:
        return np.empty(0)
    best = alike >= alike.max() * (1 - RELATIVE_TOLERANCE)
    return _separate([_middle_angle(runs[order], angle) for angle in angles[best]])


def _middle_angle(runs: ComplexArray, near: float) -> float:
    """Return the median direction, weighted by length, of the runs nearly parallel or perpendicular to a direction.

    With the median, small deviations of some runs do not rotate a border that is otherwise exactly straight.
    """
    turned = runs * np.exp(-1j * near)
    off = np.angle(turned * 1j ** -np.round(np.angle(turned) / HALF_PI))
    order = np.argsort(off, kind="stable")
    order = order[np.abs(off[order]) <= SAME_DIRECTION]
    until = np.cumsum(np.abs(runs[order]))
    both = np.searchsorted(until, until[-1] / 2 * np.array([1 - RELATIVE_TOLERANCE, 1 + RELATIVE_TOLERANCE]))
    return float(np.mod(near + off[order][both].mean(), HALF_PI))


def _separate(angles: list[float]) -> FloatArray:
    """Return the angles, modulo a quarter turn, without those nearly equal to an earlier one."""
    kept: list[float] = []
    for angle in angles:
        off = [abs((angle - other + HALF_PI / 2) % HALF_PI - HALF_PI / 2) for other in kept]
        if all(angle_off > SAME_DIRECTION for angle_off in off):
            kept.append(angle)
    return np.array(kept)


def along_axes(directions: list[FloatArray], turned: FloatArray, angles: FloatArray) -> BoolArray:
    """Return (k, t) True for the angles that rotate a chart's straight border closest to the axes; all if it has none.

    Args:
        directions: for each of k charts the directions of its straight border, see `straight_directions`.
        turned: (k,) the angle by which each chart is already rotated, radians.
        angles: (k, t) further rotation angles to choose from, radians.
    """
    allowed = np.ones(angles.shape, dtype=bool)
    for c, of_border in enumerate(directions):
        if len(of_border):
            lying = of_border + turned[c] + angles[c][:, None]
            off = np.abs(lying - HALF_PI * np.round(lying / HALF_PI)).min(axis=1)
            allowed[c] = off <= off.min() + RELATIVE_TOLERANCE
    return allowed


def straight_runs(sides: ComplexArray) -> ComplexArray:
    """Return (r,) the straight runs of a border, as complex vectors with their length and their middle's direction.

    Each curve of the border is split recursively at its farthest point from the line between its ends, until all
    pieces are straight (Ramer 1972, Douglas and Peucker 1973).
    """
    points, number = np.unique(sides.ravel(), return_inverse=True)
    order, first = border_curves(number.reshape(-1, 2), len(points))
    runs = [_runs_of_curve(sides[order[start:stop]]) for start, stop in pairwise(first)]
    return np.concatenate(runs) if runs else np.empty(0, dtype=np.complex128)


def _runs_of_curve(sides: ComplexArray) -> ComplexArray:
    """Return the straight runs of one curve, whose sides are in order."""
    curve = sides[:, 0]
    if sides[-1, 1] == curve[0]:
        # If the curve has corners, the point farthest from the centre is one of them.
        begin = int(np.abs(curve - curve.mean()).argmax())
        curve = np.roll(curve, -begin)
    curve = np.append(curve, curve[0] if sides[-1, 1] == sides[0, 0] else sides[-1, 1])
    is_end = np.zeros(len(curve), dtype=np.bool_)
    split_curve(curve.view(np.float64).reshape(-1, 2), is_end)
    ends = np.flatnonzero(is_end)
    along = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(curve)))])
    start, length = along[ends[:-1]], np.diff(along[ends])
    low, high = (
        np.interp(at, along, curve.real) + 1j * np.interp(at, along, curve.imag)
        for at in (start + END_SHARE * length, start + (1 - END_SHARE) * length)
    )
    return np.asarray((high - low) / (1 - 2 * END_SHARE))


@compiled
def split_curve(curve: FloatArray, is_end: BoolArray) -> None:
    """Mark the points at which a curve is split into straight runs, including its ends.

    Args:
        curve: (n, 2) its points.
        is_end: (n,) all False on entry; filled with True at the splits.
    """
    stack = np.empty((len(curve), 2), dtype=np.int64)
    stack[0, 0], stack[0, 1] = 0, len(curve) - 1
    is_end[0] = is_end[len(curve) - 1] = True
    count = 1
    while count > 0:
        count -= 1
        start, stop = stack[count, 0], stack[count, 1]
        x, y = curve[stop, 0] - curve[start, 0], curve[stop, 1] - curve[start, 1]
        square = x * x + y * y
        farthest, where = MAX_STRAY * MAX_STRAY * square, -1
        for i in range(start + 1, stop):
            u, v = curve[i, 0] - curve[start, 0], curve[i, 1] - curve[start, 1]
            part = min(max((u * x + v * y) / square, 0.0), 1.0) if square > 0 else 0.0
            distance = (u - part * x) ** 2 + (v - part * y) ** 2
            if distance > farthest:
                farthest, where = distance, i
        if where >= 0:
            is_end[where] = True
            stack[count, 0], stack[count, 1] = start, where
            stack[count + 1, 0], stack[count + 1, 1] = where, stop
            count += 2


def border_curves(sides: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """Return (s,) the sides of a border ordered along its curves, and (c + 1,) where each of the c curves begins.

    A curve ends at a point unless exactly one side ends and exactly one side starts there.

    Args:
        sides: (s, 2) start and end point index of each side.
        count: number of points.
    """
    start, end = sides.T
    passes = (np.bincount(start, minlength=count) == 1) & (np.bincount(end, minlength=count) == 1)
    leaving = np.empty(count, dtype=np.int64)
    leaving[start] = np.arange(len(sides))
    following = np.where(passes[end], leaving[end], -1)
    return follow_curves(following, ~passes[start])


@compiled
def follow_curves(following: IntArray, begins: BoolArray) -> tuple[IntArray, IntArray]:
    """Return (s,) the sides curve by curve, and (c + 1,) where each of the c curves begins, with s after the last.

    Args:
        following: (s,) the side after each side; -1 at an end.
        begins: (s,) True where a curve begins; curves without such a side are closed.
    """
    order, first = np.empty(len(following), np.int64), np.empty(len(following) + 1, np.int64)
    done = np.zeros(len(following), dtype=np.bool_)
    found, curves = 0, 0
    for closed in (False, True):
        for side in range(len(following)):
            if done[side] or not (begins[side] or closed):
                continue
            first[curves] = found
            curves += 1
            while side >= 0 and not done[side]:
                done[side] = True
                order[found] = side
                found += 1
                side = following[side]
    first[curves] = found
    return order, first[: curves + 1]
