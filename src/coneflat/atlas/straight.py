"""Straight runs of charts' borders, and how charts are turned to have most of them along the axes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ..base.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from ..base.compiled import compiled

HALF_PI = np.pi / 2
# A run is straight if it strays from the line between its ends by less than this part of its length: an arc of less
# than 5 degrees is; so is a side of a box whose points are off by a thousandth of it.
MAX_STRAY = 0.01
# Of a run, the part at each end that is not asked for the direction: there it may turn into a rounded corner.
END_SHARE = 1 / 8
# Directions that differ by less, in radians, are the same. Of a smooth border at most a tenth or so lies in one.
SAME_DIRECTION = np.radians(1.5)
# The part of a border that must lie in one direction, but for quarter turns: of an equilateral triangle and a hexagon
# a third does, of a rim of 24 sides a sixth, of free forms up to 28 % and mostly 10 %.
MIN_STRAIGHT_SHARE = 0.4
# Lengths, areas and parts of a turn that differ by less, relatively, and angles that do, in radians, are the same but
# for rounding.
RELATIVE_TOLERANCE = 1e-6


def straight_directions(sides: ComplexArray) -> FloatArray:
    """Return the directions, radians in [0, pi / 2), in which most of a border is straight; none if too little is.

    Directions at right angles count as one. There are several only where as much of the border lies in each, as of a
    regular polygon.

    Args:
        sides: (s, 2) start and end of each side of an outline, in any order.
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
    """Return the median direction, by length, of the runs that are nearly along one or across it.

    So what is exactly straight is not turned by the little that some runs are off.
    """
    turned = runs * np.exp(-1j * near)
    off = np.angle(turned * 1j ** -np.round(np.angle(turned) / HALF_PI))
    order = np.argsort(off, kind="stable")
    order = order[np.abs(off[order]) <= SAME_DIRECTION]
    until = np.cumsum(np.abs(runs[order]))
    both = np.searchsorted(until, until[-1] / 2 * np.array([1 - RELATIVE_TOLERANCE, 1 + RELATIVE_TOLERANCE]))
    return float(np.mod(near + off[order][both].mean(), HALF_PI))


def _separate(angles: list[float]) -> FloatArray:
    """Return angles modulo a quarter turn without those that are nearly the same as one before."""
    kept: list[float] = []
    for angle in angles:
        off = [abs((angle - other + HALF_PI / 2) % HALF_PI - HALF_PI / 2) for other in kept]
        if all(apart > SAME_DIRECTION for apart in off):
            kept.append(angle)
    return np.array(kept)


def along_axes(directions: list[FloatArray], turned: FloatArray, angles: FloatArray) -> BoolArray:
    """Return (k, t) the angles by which charts may be turned: where a border is straight, to be nearest to the axes.

    Args:
        directions: in which the border of each of k charts is straight, see `straight_directions`.
        turned: (k,) what each chart is turned by already, radians.
        angles: (k, t) to choose from.
    """
    allowed = np.ones(angles.shape, dtype=bool)
    for c, of_border in enumerate(directions):
        if len(of_border):
            lying = of_border + turned[c] + angles[c][:, None]
            off = np.abs(lying - HALF_PI * np.round(lying / HALF_PI)).min(axis=1)
            allowed[c] = off <= off.min() + RELATIVE_TOLERANCE
    return allowed


def straight_runs(sides: ComplexArray) -> ComplexArray:
    """Return (r,) the straight runs of a border, as vectors along their middle that are as long as they are.

    Each curve of it is split where it is farthest from the line between its ends, and again, until what is left is
    straight (Ramer 1972, Douglas and Peucker 1973).
    """
    points, number = np.unique(sides.ravel(), return_inverse=True)
    order, first = border_curves(number.reshape(-1, 2), len(points))
    runs = [_runs_of_curve(sides[order[start:stop]]) for start, stop in pairwise(first)]
    return np.concatenate(runs) if runs else np.empty(0, dtype=np.complex128)


def _runs_of_curve(sides: ComplexArray) -> ComplexArray:
    """Return the straight runs of one curve, whose sides follow one another."""
    curve = sides[:, 0]
    if sides[-1, 1] == curve[0]:
        # What is farthest from the middle is a corner of whatever has corners.
        begin = int(np.abs(curve - curve.mean()).argmax())
        curve = np.roll(curve, -begin)
    curve = np.append(curve, curve[0] if sides[-1, 1] == sides[0, 0] else sides[-1, 1])
    is_end = np.zeros(len(curve), dtype=np.bool_)
    split_curve(curve.view(np.float64).reshape(-1, 2), MAX_STRAY, is_end)
    ends = np.flatnonzero(is_end)
    along = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(curve)))])
    start, length = along[ends[:-1]], np.diff(along[ends])
    low, high = (
        np.interp(at, along, curve.real) + 1j * np.interp(at, along, curve.imag)
        for at in (start + END_SHARE * length, start + (1 - END_SHARE) * length)
    )
    return np.asarray((high - low) / (1 - 2 * END_SHARE))


@compiled
def split_curve(curve: FloatArray, stray: float, is_end: BoolArray) -> None:
    """Mark where a curve is split into straight runs, its ends included.

    Args:
        curve: (n, 2) its points.
        stray: how far a run may be from the segment between its ends, relative to the segment.
        is_end: (n,) all False; changed.
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
        farthest, where = stray * stray * square, -1
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
    """Return the sides of a border in the order of its curves, and the first side of each curve and their number.

    Curves end where not exactly one side comes in and one goes out.

    Args:
        sides: (s, 2) start and end of each.
        count: number of points.
    """
    start, end = sides.T
    passes = (np.bincount(start, minlength=count) == 1) & (np.bincount(end, minlength=count) == 1)
    leaving = np.empty(count, dtype=np.int64)
    leaving[start] = np.arange(len(sides))
    following = np.where(passes[end], leaving[end], -1)
    order, first = np.empty(len(sides), dtype=np.int64), np.empty(len(sides) + 1, dtype=np.int64)
    curves = follow_curves(following, ~passes[start], order, first)
    return order, first[: curves + 1]


@compiled
def follow_curves(following: IntArray, begins: BoolArray, order: IntArray, first: IntArray) -> int:
    """Fill in sides curve by curve, and the first of each, and return the number of curves.

    Args:
        following: (s,) the side after each; -1 at an end.
        begins: (s,) True where no side comes before; curves without such a side are closed.
        order: (s,) filled.
        first: (s + 1,) filled up to one more than the number of curves.
    """
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
    return curves
