"""Polygons of the input made convex in the plane.

Meshes of polygons are flattened as triangles, along diagonals of our choice. Others that read the polygons choose their
own: what they see is upright, too, only where the polygon is convex.
"""

from __future__ import annotations

import math

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray
from ..compiled import compiled
from ..geometry.planar import heights, sides_between
from ..input.polygons import Polygons
from ..mesh import TriangleMesh

# Height over longest side of a triangle from which on it is safely upright: rounding in the plane is 1e-16 of the
# extent, and the finest edges are some 1e-6 of it.
UPRIGHT = 1e-8
# The same, as it is wanted of corners that are to become convex: as much of it as there is room for.
WANTED = (0.1, 0.03, 0.01, 1e-3)
# Sine of the angle up to which a corner on the model is straight but for rounding.
STRAIGHT = 1e-6
# Times all points of the polygons that are not convex are moved in turn.
ROUNDS = 20


def make_convex(
    points: FloatArray, uv_faces: IntArray, polygons: Polygons, positions: FloatArray
) -> FloatArray:
    """Return points at which as many polygons as can be are convex.

    Points inside charts move, as little as they must; outlines of charts, and so seams and what they promise, stay.
    Polygons that are not convex on the model either are left alone.

    Args:
        points: (u, 2) of the plane.
        uv_faces: (m, 3) the point of each triangle corner.
        polygons: what the triangles are parts of.
        positions: (m, 3, 3) the triangle corners on the model.
    """
    triples, owner = polygons.corner_triples(polygons.points(uv_faces))
    is_bad = heights(sides_between(points[triples])) <= UPRIGHT
    if not is_bad.any():
        return points
    chosen = np.unique(owner[is_bad & ~_concave_in_space(polygons, positions)[owner]])
    mesh = TriangleMesh(points, uv_faces)
    movable = ~mesh.is_boundary_vertex
    wanted = np.unique(triples[np.isin(owner, chosen)])
    wanted = wanted[movable[wanted]]
    if not len(wanted):
        return points
    # What is concave in space may be so in the plane; it must not stand in the way of others.
    hopeless = np.isin(owner, np.setdiff1d(owner[is_bad], chosen))
    return _moved(points, np.concatenate([uv_faces, triples[~hopeless]]), wanted)


def _moved(points: FloatArray, triangles: IntArray, moving: IntArray) -> FloatArray:
    """Return the points, some of them moved so that triangles (t, 3) at them are upright, where that can be."""
    rank = np.full(len(points), -1, dtype=np.int64)
    rank[moving] = np.arange(len(moving))
    near = triangles[(rank[triangles] >= 0).any(axis=1)]
    corner, row = np.nonzero(rank[near].T >= 0)
    order = np.argsort(rank[near[row, corner]], kind="stable")
    row, corner = row[order], corner[order]
    sides = np.stack([near[row, (corner + 1) % 3], near[row, (corner + 2) % 3]], axis=1)
    first = np.searchsorted(rank[near[row, corner]], np.arange(len(moving) + 1))
    moved, stayed = points.copy(), np.zeros(len(moving), dtype=bool)
    for _ in range(ROUNDS):
        if not move_points(moved, moving, first, sides, np.array(WANTED), UPRIGHT, stayed):
            break
    return moved


def _concave_in_space(polygons: Polygons, positions: FloatArray) -> BoolArray:
    """Return (p,) whether a polygon has a corner that turns the other way on the model, seen along its normal."""
    count = len(polygons.offsets) - 1
    place = np.zeros((int(polygons.offsets[-1]), 3))
    place[polygons.corners] = positions
    owner = polygons.owner
    normals = np.cross(positions[:, 1] - positions[:, 0], positions[:, 2] - positions[:, 0])
    normal = np.stack([np.bincount(owner, normals[:, k], count) for k in range(3)], axis=1)
    known = polygons.points(polygons.corners)
    triples, polygon = polygons.corner_triples(known)
    before, at, after = (place[triples[:, k]] for k in range(3))
    turn = np.einsum("ij,ij->i", np.cross(at - before, after - at), normal[polygon])
    size = np.linalg.norm(at - before, axis=1) * np.linalg.norm(after - at, axis=1)
    size *= np.linalg.norm(normal[polygon], axis=1)
    concave = np.zeros(count, dtype=bool)
    concave[polygon[turn < -STRAIGHT * size]] = True
    return concave


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
        distance = math.hypot(points[v, 0] - near_x, points[v, 1] - near_y)
        if distance < best:
            best, x, y = distance, near_x, near_y
    if not inside:
        points[v, 0], points[v, 1] = x, y
