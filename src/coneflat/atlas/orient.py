"""Orientation of charts in the plane: the angles by which they are rotated."""

from __future__ import annotations

import numpy as np

from ..base.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from ..base.jit import compiled
from .border_runs import straight_runs
from .charts import Charts, Outlines
from .rectangles import HALF_PI, RELATIVE_TOLERANCE, straight_angles_of

# Directions that differ by less, in radians, are the same. At most about a tenth of a smooth border is in one of them.
SAME_DIRECTION = np.radians(1.5)
# Fraction of a border that must be in one direction, modulo quarter turns. It is a third for an equilateral triangle
# and a hexagon, a sixth for a rim of 24 sides, up to 28 % and mostly 10 % for free forms.
MIN_STRAIGHT_SHARE = 0.4


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
    angles = straight_angles_of(outlines.sides.ravel(), chart, directions)
    turned = outlines.times(np.exp(1j * angles)).sides.imag.ravel()
    start = 2 * outlines.start[:-1]
    middle = (np.minimum.reduceat(turned, start) + np.maximum.reduceat(turned, start)) / 2
    height = charts.rotated(angles).corners.imag.mean(axis=1)
    top_heavy = charts.sums(charts.areas * (height - middle[charts.chart])) > 0
    return angles + np.where(top_heavy, np.pi, 0.0)


@compiled
def common_directions(
    angles: FloatArray, lengths: FloatArray, start: IntArray, borders: FloatArray
) -> tuple[FloatArray, IntArray]:
    """Return the directions of the straight runs of charts, and (k,) where those of each chart end.

    Args:
        angles: (r,) directions of the runs, in [0, pi / 2), ascending within each chart.
        lengths: (r,) their lengths.
        start: (k + 1,) the first run of each chart.
        borders: (k,) the length of each chart's border.
    """
    directions, count, ends = np.empty(len(angles)), 0, np.empty(len(borders), np.int64)
    for c in range(len(borders)):
        first, end = start[c], start[c + 1]
        count += fill_directions(angles[first:end], lengths[first:end], borders[c], directions[count:])
        ends[c] = count
    return directions[:count], ends


@compiled
def fill_directions(angles: FloatArray, lengths: FloatArray, border: float, directions: FloatArray) -> int:
    """Fill in the directions of the straight runs of a chart, and return their number.

    A direction is that of the runs nearly parallel or perpendicular to it, which have the largest total length.

    Args:
        angles, lengths: (r,) directions of the runs, in [0, pi / 2), ascending, and their lengths.
        border: the length of the border.
        directions: (r,) or more, filled.
    """
    around, total = three_times(angles, lengths)
    begin, end = alike_runs(angles, around)
    largest, count = 0.0, 0
    for i in range(len(angles)):
        largest = max(largest, total[end[i]] - total[begin[i]])
    if largest <= MIN_STRAIGHT_SHARE * border:
        return 0
    for i in range(len(angles)):
        if total[end[i]] - total[begin[i]] < largest * (1 - RELATIVE_TOLERANCE):
            continue
        middle = median_direction(around, total, begin[i], end[i])
        is_new = True
        for earlier in range(count):
            off = (middle - directions[earlier] + HALF_PI / 2) % HALF_PI - HALF_PI / 2
            is_new = is_new and abs(off) > SAME_DIRECTION
        if is_new:
            directions[count] = middle
            count += 1
    return count


@compiled
def three_times(angles: FloatArray, lengths: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (3r,) angles of runs, a quarter turn apart, and (3r + 1,) the sums of the lengths before each."""
    size = len(angles)
    around, total = np.empty(3 * size), np.empty(3 * size + 1)
    total[0] = 0.0
    for j in range(3 * size):
        around[j] = angles[j % size] + (j // size - 1) * HALF_PI
        total[j + 1] = total[j] + lengths[j % size]
    return around, total


@compiled
def alike_runs(angles: FloatArray, around: FloatArray) -> tuple[IntArray, IntArray]:
    """Return (r,) for each run the first of `three_times` with the same direction, and the first one after these."""
    begin, end = np.empty(len(angles), np.int64), np.empty(len(angles), np.int64)
    low, high = 0, 0
    for i in range(len(angles)):
        while around[low] < angles[i] - SAME_DIRECTION:
            low += 1
        while high < len(around) and around[high] <= angles[i] + SAME_DIRECTION:
            high += 1
        begin[i], end[i] = low, high
    return begin, end


@compiled
def median_direction(around: FloatArray, total: FloatArray, begin: int, end: int) -> float:
    """Return the median direction of some runs, weighted by length.

    With the median, small deviations of some runs do not rotate a border that is otherwise exactly straight.

    Args:
        around, total: angles of runs and sums of their lengths, see `three_times`.
        begin, end: the first run, and the first one after the last.
    """
    # The median is between the first runs with so much of the length up to their ends.
    before, after, half = begin, begin, (total[end] - total[begin]) / 2
    while before < end - 1 and total[before + 1] - total[begin] < half * (1 - RELATIVE_TOLERANCE):
        before += 1
    while after < end - 1 and total[after + 1] - total[begin] < half * (1 + RELATIVE_TOLERANCE):
        after += 1
    return ((around[before] + around[after]) / 2) % HALF_PI


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


def mean_rise(charts: Charts, heights: FloatArray) -> ComplexArray:
    """Return (k,) for each chart the integral of the gradient of heights (m, 3) over the plane, as complex numbers.

    The gradient is constant on a triangle; multiplied by the area it is a sum over the sides without a division.
    """
    opposite = charts.corners[:, [2, 0, 1]] - charts.corners[:, [1, 2, 0]]
    rise = 0.5j * (heights * opposite).sum(axis=1)
    return charts.sums(rise.real) + 1j * charts.sums(rise.imag)
