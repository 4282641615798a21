"""Points of the plane moved, one after the other, to where given triangles are upright.

Where all corners but one stay, a triangle is upright in a half-plane of that one. What a point can do for its
triangles is so the polygon that is common to half-planes, found by clipping; the point goes to the nearest place there.
"""

from __future__ import annotations

import math

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray
from ..geometry.compiled import compiled


@compiled
def move_points(
    points: FloatArray,
    moving: IntArray,
    first: IntArray,
    sides: IntArray,
    margins: FloatArray,
    least: float,
    stayed: BoolArray,
) -> bool:
    """Move points in turn to the nearest places where their triangles are upright; return whether any moved.

    Args:
        points: (u, 2), changed in place.
        moving: (k,) points to be moved, in this order.
        first: (k + 1,) where the triangles of each begin.
        sides: (t, 2) the other two corners of each triangle, as it runs.
        margins: twice the area wanted, over the square of the longest side; tried in this order.
        least: the same, of triangles that are upright as they are.
        stayed: (k,) set to whether a point has a triangle that is not upright, and no place to go.
    """
    most = 4 + int((first[1:] - first[:-1]).max())
    polygon, clipped = np.empty((most, 2)), np.empty((most, 2))
    moved = False
    for k in range(len(moving)):
        v, begin, end = moving[k], first[k], first[k + 1]
        stayed[k] = False
        worst = np.inf
        for t in range(begin, end):
            worst = min(worst, _height(points, v, sides[t, 0], sides[t, 1]))
        if worst > least:
            continue
        stayed[k] = True
        for margin in margins:
            count = _fill_box(points, v, sides[begin:end], polygon)
            for t in range(begin, end):
                a, b = sides[t, 0], sides[t, 1]
                wanted = margin
                height = _height(points, v, a, b)
                if height > least:
                    wanted = min(margin, height)
                count = _clip(points, v, a, b, wanted, polygon, count, clipped)
                polygon, clipped = clipped, polygon
                if count == 0:
                    break
            if count > 2:
                _go_nearest(points, v, polygon, count)
                stayed[k] = False
                moved = True
                break
    return moved


@compiled
def _longest(points: FloatArray, v: int, a: int, b: int) -> float:
    """Return the square of the longest side of a triangle."""
    one = (points[a, 0] - points[v, 0]) ** 2 + (points[a, 1] - points[v, 1]) ** 2
    two = (points[b, 0] - points[v, 0]) ** 2 + (points[b, 1] - points[v, 1]) ** 2
    three = (points[b, 0] - points[a, 0]) ** 2 + (points[b, 1] - points[a, 1]) ** 2
    return max(one, two, three)


@compiled
def _height(points: FloatArray, v: int, a: int, b: int) -> float:
    """Return twice the area of a triangle over the square of its longest side."""
    area = (points[b, 0] - points[a, 0]) * (points[v, 1] - points[a, 1])
    area -= (points[b, 1] - points[a, 1]) * (points[v, 0] - points[a, 0])
    return area / max(_longest(points, v, a, b), 1e-300)


@compiled
def _fill_box(points: FloatArray, v: int, sides: IntArray, polygon: FloatArray) -> int:
    """Put the box around a point and its neighbours in `polygon`, and return its number of corners."""
    low_x = high_x = points[v, 0]
    low_y = high_y = points[v, 1]
    for a in sides.ravel():
        low_x, high_x = min(low_x, points[a, 0]), max(high_x, points[a, 0])
        low_y, high_y = min(low_y, points[a, 1]), max(high_y, points[a, 1])
    for i, (x, y) in enumerate(((low_x, low_y), (high_x, low_y), (high_x, high_y), (low_x, high_y))):
        polygon[i, 0], polygon[i, 1] = x, y
    return 4


@compiled
def _clip(
    points: FloatArray,
    v: int,
    a: int,
    b: int,
    margin: float,
    polygon: FloatArray,
    count: int,
    clipped: FloatArray,
) -> int:
    """Put in `clipped` the part of a polygon where a triangle has an area, and return its number of corners."""
    x, y = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
    area = margin * _longest(points, v, a, b)
    kept = 0
    for i in range(count):
        j = (i + 1) % count
        here = x * (polygon[i, 1] - points[a, 1]) - y * (polygon[i, 0] - points[a, 0]) - area
        there = x * (polygon[j, 1] - points[a, 1]) - y * (polygon[j, 0] - points[a, 0]) - area
        if here >= 0:
            clipped[kept] = polygon[i]
            kept += 1
        if (here > 0 and there < 0) or (here < 0 and there > 0):
            part = here / (here - there)
            clipped[kept, 0] = polygon[i, 0] + part * (polygon[j, 0] - polygon[i, 0])
            clipped[kept, 1] = polygon[i, 1] + part * (polygon[j, 1] - polygon[i, 1])
            kept += 1
    return kept


@compiled
def _go_nearest(points: FloatArray, v: int, polygon: FloatArray, count: int) -> None:
    """Move a point to the nearest one of a convex polygon that runs counterclockwise."""
    best, x, y, inside = np.inf, points[v, 0], points[v, 1], True
    for i in range(count):
        j = (i + 1) % count
        along_x, along_y = polygon[j, 0] - polygon[i, 0], polygon[j, 1] - polygon[i, 1]
        from_x, from_y = points[v, 0] - polygon[i, 0], points[v, 1] - polygon[i, 1]
        inside = inside and along_x * from_y - along_y * from_x >= 0
        square = along_x * along_x + along_y * along_y
        part = min(max((along_x * from_x + along_y * from_y) / square, 0.0), 1.0) if square > 0 else 0.0
        near_x, near_y = polygon[i, 0] + part * along_x, polygon[i, 1] + part * along_y
        way = math.hypot(points[v, 0] - near_x, points[v, 1] - near_y)
        if way < best:
            best, x, y = way, near_x, near_y
    if not inside:
        points[v, 0], points[v, 1] = x, y
