"""The area of the plane that overlapping triangles cover."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from ..base.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from ..mesh.connectivity import NEXT
from .layers import MAX_CELLS, trace_sides
from .orientation import counterclockwise

# Largest number of crossings of horizontal lines with sides, which take about a minute. With more, the areas are not
# computed.
MAX_CROSSINGS = 200_000_000
# Number of crossings that are sorted at a time, to bound the memory.
CROSSINGS_PER_BLOCK = MAX_CROSSINGS // 100


def overlap_areas(corners: FloatArray, pairs: IntArray) -> tuple[float, float]:
    """Return the area inside at least two triangles, and the area inside at least one.

    Args:
        corners: (m, 3, 2) corners of the triangles, counterclockwise or without area.
        pairs: (k, 2) all pairs of triangles that overlap.

    Returns:
        The two areas; both NaN if they would take too long, as with many long triangles in all directions.

    Notes:
        The number of triangles that cover a point is the winding number of their sides around it, in which the sides
        that two triangles share cancel. Along a horizontal line, it changes where the line crosses a side. Between
        the heights at which sides end or cross, the lengths of line that are covered once, twice or three times are
        linear functions of the height. Their value in the middle times the difference in height is therefore an area
        that is exact up to rounding. Only triangles that overlap others are needed. The outline of the region that
        they cover is short, and its sides cross only in the given pairs.
    """
    total = float(_cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 1]).sum()) / 2
    if not len(pairs):
        return 0.0, total
    triangles, index = np.unique(pairs, return_inverse=True)
    corners, pairs = corners[triangles], index.reshape(-1, 2)
    corners = corners - corners.min(axis=(0, 1))
    steps = _outline(corners)
    overlap, excess = _sweep(corners, steps, _crossings(corners, steps != 0, pairs))
    return overlap, total - excess


def approximate_overlap_areas(corners: FloatArray) -> tuple[float, float]:
    """Return approximate areas inside at least two triangles and inside at least one, by counting pixels.

    Args:
        corners: (m, 3, 2) corners of the triangles, of any orientation.
    """
    low = corners.min(axis=(0, 1))
    size = corners.max(axis=(0, 1)) - low
    if not size.min() > 0:
        return 0.0, 0.0
    # Half a pixel less, so that the points of largest coordinates are in the last pixels.
    pixels = counterclockwise((corners - low) * ((MAX_CELLS - 0.5) / size))[0]
    marks, steps = np.zeros((2, MAX_CELLS + 1, MAX_CELLS + 1), dtype=np.int32)
    sides = np.stack([pixels, pixels[:, NEXT]], axis=2)
    trace_sides(sides.reshape(-1, 4), 0.0, 0.0, 1.0, marks, steps)
    layers = np.cumsum(steps, axis=1)
    pixel = float(np.prod(size / (MAX_CELLS - 0.5)))
    return int(np.count_nonzero(layers > 1)) * pixel, int(np.count_nonzero(layers)) * pixel


def _cross(first: FloatArray, second: FloatArray) -> FloatArray:
    return first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]


def _outline(corners: FloatArray) -> IntArray:
    """Return (m, 3) the multiplicity of the side from each corner in the outline; sides with the same ends are summed.

    The first of sides with the same ends has the sum, positive in its own direction; the others have 0.
    """
    places = corners @ np.array([1, 1j])
    sides = np.stack([places, places[:, NEXT]], axis=2).reshape(-1, 2)
    first_equal, balance = cancel_sides(sides, np.zeros(places.size, dtype=np.int64))
    return np.where(first_equal == np.arange(len(first_equal)), balance, 0).reshape(-1, 3)


def cancel_sides(sides: ComplexArray, chart: IntArray) -> tuple[IntArray, IntArray]:
    """Return which sides of triangles have the same ends, and their sum with signs by direction.

    Args:
        sides: (s, 2) start and end of each.
        chart: (s,) chart of each side; sides of different charts are never equal.

    Returns:
        (s,) the first side with the same ends, in either order; and (s,) for each such first side, the number of
        sides in its direction minus the number in the opposite direction, 0 if they cancel.
    """
    number = np.unique(sides + 0.0, return_inverse=True)[1].reshape(sides.shape)
    keys = np.stack([chart, number.min(axis=1), number.max(axis=1)])
    order = np.lexsort(keys)
    begins = np.append(True, np.diff(keys[:, order], axis=1).any(axis=0))[: len(order)]
    first_equal = np.empty(len(order), dtype=np.int64)
    first_equal[order] = order[begins][np.cumsum(begins) - 1]
    runs_up = number[:, 0] <= number[:, 1]
    balance = np.bincount(first_equal, np.where(runs_up == runs_up[first_equal], 1, -1), len(first_equal))
    return first_equal, balance.astype(np.int64)


def _crossings(corners: FloatArray, on_outline: BoolArray, pairs: IntArray) -> FloatArray:
    """Return the heights (y) at which sides on the outline of overlapping triangles cross."""
    heights = []
    for i in range(3):
        for j in range(3):
            first, second = pairs[on_outline[pairs[:, 0], i] & on_outline[pairs[:, 1], j]].T
            start, along = corners[first, i], corners[first, NEXT[i]] - corners[first, i]
            opposite, across = corners[second, j], corners[second, NEXT[j]] - corners[second, j]
            slope = _cross(along, across)
            with np.errstate(divide="ignore", invalid="ignore"):  # parallel sides
                fraction = _cross(opposite - start, across) / slope
                opposite_fraction = _cross(opposite - start, along) / slope
            meet = (fraction > 0) & (fraction < 1) & (opposite_fraction > 0) & (opposite_fraction < 1)
            heights.append(start[meet, 1] + fraction[meet] * along[meet, 1])
    return np.concatenate(heights)


def _sweep(corners: FloatArray, steps: IntArray, crossings: FloatArray) -> tuple[float, float]:
    """Return the area of winding number 2 or more, and the sum of the areas of numbers at least 2, 3, 4 and so on.

    Args:
        corners: (m, 3, 2) corners of the triangles.
        steps: (m, 3) multiplicity of the side from each corner to the next in the outline.
        crossings: heights at which sides of the outline cross.
    """
    start, end, step = corners[steps != 0], corners[:, NEXT][steps != 0], steps[steps != 0]
    falls = end[:, 1] < start[:, 1]
    low, high = np.where(falls[:, None], end, start), np.where(falls[:, None], start, end)
    step, along = np.where(falls, step, -step), high - low
    heights = np.unique(np.concatenate([low[:, 1], high[:, 1], crossings]))
    first, last = np.searchsorted(heights, low[:, 1]), np.searchsorted(heights, high[:, 1])
    if int((last - first).sum()) > MAX_CROSSINGS:
        return float("nan"), float("nan")
    overlap = excess = 0.0
    for begin, stop in _blocks(first, last, len(heights)):
        bottom = np.maximum(first, begin)
        count = np.maximum(np.minimum(last, stop) - bottom, 0)
        side = np.repeat(np.arange(len(count)), count)
        strip = np.arange(len(side)) - np.repeat(np.cumsum(count) - count - bottom, count)
        above = (heights[strip] + heights[strip + 1]) / 2 - low[side, 1]
        x = low[side, 0] + along[side, 0] * (above / along[side, 1])
        order = np.lexsort((x, strip))
        layers = np.cumsum(step[side[order]])[:-1]  # 0 at the end of each strip
        areas = np.diff(x[order]) * np.diff(heights)[strip[order[:-1]]]
        overlap += float(areas[layers > 1].sum())
        excess += float((areas * np.maximum(layers - 1, 0)).sum())
    return overlap, excess


def _blocks(first: IntArray, last: IntArray, count: int) -> Iterator[tuple[int, int]]:
    """Yield ranges of strips between `count` heights with at most `CROSSINGS_PER_BLOCK` crossings, if possible.

    first, last: (s,) the lowest and the highest height of each side.
    """
    begun = np.bincount(first, minlength=count) - np.bincount(last, minlength=count)
    crossed, block = np.cumsum(np.cumsum(begun)), CROSSINGS_PER_BLOCK
    cuts = np.searchsorted(crossed, np.arange(block, crossed[-1], block))
    yield from pairwise(np.unique(np.concatenate([[0], cuts, [count - 1]])).tolist())
