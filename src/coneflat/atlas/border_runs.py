"""Straight runs of the borders of charts."""

from __future__ import annotations

import math

import numpy as np

from ..base.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from ..base.jit import compiled
from .charts import Outlines

# A run is straight if its distance from the line between its ends is below this fraction of its length. This includes
# arcs of less than 5 degrees, and a side of a box whose points are off by a thousandth of it.
MAX_STRAY = 0.01
# Fraction of a run at each end that is ignored for the direction: there it may bend into a rounded corner.
END_SHARE = 1 / 8


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
