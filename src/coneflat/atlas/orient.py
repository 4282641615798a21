"""Orientation of charts in the plane: the angles by which they are rotated, and the straight runs of their borders."""

from __future__ import annotations

import math

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
    """Return for each chart the directions, radians in [0, pi / 2), of the straight parts of its border.

    There are none if too little is straight. Perpendicular directions count as one. Several directions are returned
    only if the same length of the border is in each, as for a regular polygon.
    """
    runs, chart = straight_runs(outlines)
    lengths, angles = np.abs(runs), np.mod(np.angle(runs), HALF_PI)
    order = np.lexsort((angles, chart))
    start = np.searchsorted(chart[order], np.arange(len(outlines) + 1))
    borders = np.add.reduceat(np.abs(outlines.sides[:, 1] - outlines.sides[:, 0]), outlines.start[:-1])
    directions, ends = common_directions(angles[order], lengths[order], start, borders)
    return np.split(directions, ends[:-1])


def straight_angles(charts: Charts, outlines: Outlines, directions: list[FloatArray]) -> FloatArray:
    """Return (k,) the angle, radians, that aligns each chart with the axes, the half with more area below.

    Args:
        charts: the k charts.
        outlines: their outlines.
        directions: for each chart the directions of its border, see `border_directions`.
    """
    chart = np.repeat(np.arange(len(outlines)), 2 * np.diff(outlines.start))
    angles = _rectangle_angles(outlines.sides.ravel(), chart, directions)
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
    return float(_rectangle_angles(points, np.zeros(len(points), dtype=np.int64), [directions])[0])


def _rectangle_angles(points: ComplexArray, chart: IntArray, directions: list[FloatArray]) -> FloatArray:
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
    angles = np.zeros(len(ends))
    for c in range(len(ends)):
        first, size = start[c], start[c + 1] - start[c]
        hull, corners = np.zeros(size + 1, np.int64), 1
        if size > 1:
            corners = fill_hull(points[first : first + size], hull)
        begin = ends[c - 1] if c > 0 else 0
        is_free = ends[c] == begin
        count = corners if is_free else ends[c] - begin
        angle, width, height = np.empty(count), np.empty(count), np.empty(count)
        # The corners that are farthest along a side of the hull, at a right angle to it, and against it.
        ahead, top, behind = 0, 0, 0
        for i in range(count):
            if is_free:
                tail, head = first + hull[i], first + hull[(i + 1) % corners]
                angle[i] = math.atan2(points[head, 1] - points[tail, 1], points[head, 0] - points[tail, 0])
                x, y = math.cos(angle[i]), math.sin(angle[i])
                ahead = climb(points, hull, corners, first, max(ahead, i), x, y)
                top = climb(points, hull, corners, first, max(top, ahead), -y, x)
                behind = climb(points, hull, corners, first, max(behind, top), -x, -y)
                f, t, n = (
                    first + hull[ahead % corners],
                    first + hull[top % corners],
                    first + hull[behind % corners],
                )
                width[i] = (points[f, 0] - points[n, 0]) * x + (points[f, 1] - points[n, 1]) * y
                height[i] = (points[t, 1] - points[tail, 1]) * x - (points[t, 0] - points[tail, 0]) * y
            else:
                angle[i] = directions[begin + i]
                x, y = math.cos(angle[i]), math.sin(angle[i])
                low_x, low_y, high_x, high_y = np.inf, np.inf, -np.inf, -np.inf
                for k in range(corners):
                    u, v = points[first + hull[k], 0], points[first + hull[k], 1]
                    along, across = u * x + v * y, v * x - u * y
                    low_x, high_x = min(low_x, along), max(high_x, along)
                    low_y, high_y = min(low_y, across), max(high_y, across)
                width[i], height[i] = high_x - low_x, high_y - low_y
        smallest, longest, best = np.inf, -1.0, 0
        for i in range(count):
            smallest = min(smallest, width[i] * height[i])
        for i in range(count):
            # Among rectangles of equal area, as around many quadrilaterals, the longest is chosen.
            longer = max(width[i], height[i])
            if width[i] * height[i] <= smallest * (1 + RELATIVE_TOLERANCE) and longer > longest:
                longest, best = longer, i
        angles[c] = -angle[best] + (HALF_PI if height[best] > width[best] else 0.0)
    return angles


@compiled
def climb(points: FloatArray, hull: IntArray, corners: int, first: int, at: int, x: float, y: float) -> int:
    """Return the place on a hull, from a place on and counterclockwise, at which the points cease to rise.

    Args:
        points: (n, 2) points.
        hull: corners of the hull, counterclockwise, as indices from `first` on.
        corners: number of the corners; places are counted on beyond it.
        first: see `hull`.
        at: the place to begin at.
        x, y: the direction in which points rise.
    """
    for _ in range(corners):
        tail, head = first + hull[at % corners], first + hull[(at + 1) % corners]
        if (points[head, 0] - points[tail, 0]) * x + (points[head, 1] - points[tail, 1]) * y <= 0.0:
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


@compiled
def common_directions(
    angles: FloatArray, lengths: FloatArray, start: IntArray, borders: FloatArray
) -> tuple[FloatArray, IntArray]:
    """Return the directions of the straight runs of charts, and (k,) where those of each chart end.

    A direction is the median, weighted by length, of the runs nearly parallel or perpendicular to it: with the median,
    small deviations of some runs do not rotate a border that is otherwise exactly straight.

    Args:
        angles: (r,) directions of the runs, in [0, pi / 2), ascending within each chart.
        lengths: (r,) their lengths.
        start: (k + 1,) the first run of each chart.
        borders: (k,) the length of each chart's border.
    """
    max_runs = 0
    for c in range(len(borders)):
        max_runs = max(max_runs, start[c + 1] - start[c])
    # The runs of a chart three times, a quarter turn apart: their angles, and the sums of the lengths before each.
    around, total = np.empty(3 * max_runs), np.empty(3 * max_runs + 1)
    begin, end, alike = np.empty(max_runs, np.int64), np.empty(max_runs, np.int64), np.empty(max_runs)
    directions, count, ends = np.empty(len(angles)), 0, np.empty(len(borders), np.int64)
    for c in range(len(borders)):
        size, first = start[c + 1] - start[c], count
        total[0] = 0.0
        for j in range(3 * size):
            at = start[c] + j % size
            around[j] = angles[at] + (j // size - 1) * HALF_PI
            total[j + 1] = total[j] + lengths[at]
        low, high, largest = 0, 0, 0.0
        for i in range(size):
            angle = angles[start[c] + i]
            while around[low] < angle - SAME_DIRECTION:
                low += 1
            while high < 3 * size and around[high] <= angle + SAME_DIRECTION:
                high += 1
            begin[i], end[i], alike[i] = low, high, total[high] - total[low]
            largest = max(largest, alike[i])
        for i in range(size if largest > MIN_STRAIGHT_SHARE * borders[c] else 0):
            if alike[i] < largest * (1 - RELATIVE_TOLERANCE):
                continue
            # The median is between the first runs with so much of the length up to their ends.
            before, after = begin[i], begin[i]
            while before < end[i] - 1 and total[before + 1] - total[begin[i]] < alike[i] / 2 * (
                1 - RELATIVE_TOLERANCE
            ):
                before += 1
            while after < end[i] - 1 and total[after + 1] - total[begin[i]] < alike[i] / 2 * (
                1 + RELATIVE_TOLERANCE
            ):
                after += 1
            middle = ((around[before] + around[after]) / 2) % HALF_PI
            is_new = True
            for earlier in range(first, count):
                off = (middle - directions[earlier] + HALF_PI / 2) % HALF_PI - HALF_PI / 2
                is_new = is_new and abs(off) > SAME_DIRECTION
            if is_new:
                directions[count] = middle
                count += 1
        ends[c] = count
    return directions[:count], ends


def along_axes(directions: list[FloatArray], turned: FloatArray, angles: FloatArray) -> BoolArray:
    """Return (k, t) True for the angles that rotate a chart's straight border closest to the axes; all if it has none.

    Args:
        directions: for each of k charts the directions of its straight border, see `border_directions`.
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


def straight_runs(outlines: Outlines) -> tuple[ComplexArray, IntArray]:
    """Return (r,) the straight runs of borders, as complex vectors with their length and their middle's direction.

    Each curve of a border is split recursively at its farthest point from the line between its ends, until all
    pieces are straight (Ramer 1972, Douglas and Peucker 1973). Also (r,) the chart of each run.
    """
    sides, chart = outlines.sides, np.repeat(np.arange(len(outlines)), np.diff(outlines.start))
    order, first = border_curves(*_numbered_ends(sides, chart))
    runs, curve = runs_of_curves(sides[order], first)
    return runs, chart[order[first[curve]]]


def _numbered_ends(sides: ComplexArray, chart: IntArray) -> tuple[IntArray, int]:
    """Return (s, 2) the number of the point at the ends of each side, and the count; charts share no point."""
    ends, of = sides.ravel(), np.repeat(chart, 2)
    order = np.lexsort((ends.imag, ends.real, of))
    is_new = (np.diff(of[order]) > 0) | (np.diff(ends[order]) != 0)
    number = np.empty(len(ends), dtype=np.int64)
    number[order] = np.concatenate([[0], np.cumsum(is_new)])
    return number.reshape(-1, 2), int(is_new.sum()) + 1


@compiled
def runs_of_curves(sides: ComplexArray, first: IntArray) -> tuple[ComplexArray, IntArray]:
    """Return (r,) the straight runs of curves, and (r,) the curve of each.

    Args:
        sides: (s, 2) start and end of each side, in order within each curve.
        first: (c + 1,) where each curve begins.
    """
    runs, of, count = np.empty(len(sides), np.complex128), np.empty(len(sides), np.int64), 0
    for c in range(len(first) - 1):
        begin, size = first[c], first[c + 1] - first[c]
        is_closed, shift = sides[first[c + 1] - 1, 1] == sides[begin, 0], 0
        if is_closed:
            # If the curve has corners, the point farthest from the centre is one of them.
            centre, largest = 0.0 + 0.0j, -1.0
            for i in range(size):
                centre += sides[begin + i, 0] / size
            for i in range(size):
                distance = abs(sides[begin + i, 0] - centre)
                if distance > largest:
                    largest, shift = distance, i
        curve, along = np.empty((size + 1, 2)), np.zeros(size + 1)
        for i in range(size + 1):
            point = (
                sides[begin + size - 1, 1]
                if i == size and not is_closed
                else sides[begin + (i + shift) % size, 0]
            )
            curve[i, 0], curve[i, 1] = point.real, point.imag
            if i > 0:
                along[i] = along[i - 1] + math.hypot(
                    curve[i, 0] - curve[i - 1, 0], curve[i, 1] - curve[i - 1, 1]
                )
        is_end = np.zeros(size + 1, np.bool_)
        split_curve(curve, is_end)
        last = 0
        for i in range(1, size + 1):
            if is_end[i]:
                # The run without its ends, which may bend into a rounded corner.
                length = along[i] - along[last]
                low = point_along(curve, along, last, i, along[last] + END_SHARE * length)
                high = point_along(curve, along, last, i, along[last] + (1 - END_SHARE) * length)
                runs[count] = (high - low) / (1 - 2 * END_SHARE)
                of[count] = c
                count += 1
                last = i
    return runs[:count], of[:count]


@compiled
def point_along(curve: FloatArray, along: FloatArray, first: int, last: int, at: float) -> complex:
    """Return the point of a curve (n, 2) between two of its points, at a length (n,) along it."""
    i = first
    while i < last - 1 and along[i + 1] < at:
        i += 1
    length = along[i + 1] - along[i]
    share = min((at - along[i]) / length, 1.0) if length > 0 else 0.0
    x = curve[i, 0] + share * (curve[i + 1, 0] - curve[i, 0])
    return complex(x, curve[i, 1] + share * (curve[i + 1, 1] - curve[i, 1]))


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
    count, curves = 0, 0
    for closed in (False, True):
        for side in range(len(following)):
            if done[side] or not (begins[side] or closed):
                continue
            first[curves] = count
            curves += 1
            while side >= 0 and not done[side]:
                done[side] = True
                order[count] = side
                count += 1
                side = following[side]
    first[curves] = count
    return order, first[: curves + 1]
