"""Straight runs of charts' borders, and the rotations that align most of them with the axes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ..base.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from ..base.jit import compiled

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
    """Mark the points at which a curve is split into straight runs, including its ends.

    Args:
        curve: (n, 2) its points.
        stray: largest distance of a run from the segment between its ends, relative to the segment's length.
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
    order, first = np.empty(len(sides), dtype=np.int64), np.empty(len(sides) + 1, dtype=np.int64)
    curves = follow_curves(following, ~passes[start], order, first)
    return order, first[: curves + 1]


@compiled
def follow_curves(following: IntArray, begins: BoolArray, order: IntArray, first: IntArray) -> int:
    """Fill in the sides curve by curve and where each curve begins; return the number of curves.

    Args:
        following: (s,) the side after each side; -1 at an end.
        begins: (s,) True where a curve begins; curves without such a side are closed.
        order: (s,) filled with the sides in order.
        first: (s + 1,) filled with where each curve begins in `order`, and with s after the last.
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
