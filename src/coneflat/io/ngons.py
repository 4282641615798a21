"""Triangulating polygons of five and more corners."""

from __future__ import annotations

from collections import deque

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray

#: Part of a polygon's area below which a triangle in it counts as empty: above the rounding of collinear
#: corners, below any triangle worth having.
_EMPTY_TRIANGLE = 1e-9

#: Corners that a fan is tried from: all of any usual polygon, and so few that no polygon takes long.
_APEXES = 256

#: Diagonals of a polygon looked at before the shapes reached so far are taken: seconds.
_MOST_TRIALS = 200_000


def triangulate_ngons(points: FloatArray) -> IntArray:
    """Return triangles of q polygons of the same number of corners k.

    Args:
        points: (q, k, 3) their corners; k > 3.

    Returns:
        (q, k - 2, 3) corner positions 0 to k - 1, in each triangle ascending, so that it is oriented as its
        polygon is.
    """
    size = points.shape[1]
    fan = np.stack([np.zeros(size - 2, np.int64), np.arange(1, size - 1), np.arange(2, size)], axis=1)
    triangles = np.tile(fan, (len(points), 1, 1))
    with np.errstate(invalid="ignore", over="ignore"):
        normals = _newell_normals(points)
        for i in np.flatnonzero(~_is_convex(points, normals)).tolist():
            plane = _in_plane(points[i], normals[i])
            if plane is not None:
                triangles[i] = _concave(plane)
    return triangles


def _newell_normals(points: FloatArray) -> FloatArray:
    """Return (q, 3) Newell's normals, of twice the area's length."""
    local = points - points[:, :1]
    return np.asarray(np.cross(local[:, 1:-1], local[:, 2:]).sum(axis=1))


def _is_convex(points: FloatArray, normals: FloatArray) -> BoolArray:
    """Return (q,) whether every corner turns left and the fan from corner 0 covers the polygon once."""
    least = _EMPTY_TRIANGLE * np.einsum("ij,ij->i", normals, normals)
    sides = np.roll(points, -1, axis=1) - points
    turns = np.einsum("qki,qi->qk", np.cross(np.roll(sides, 1, axis=1), sides), normals)
    local = points - points[:, :1]
    fan = np.einsum("qki,qi->qk", np.cross(local[:, 1:-1], local[:, 2:]), normals)
    return np.asarray(np.all(turns > least[:, None], axis=1) & np.all(fan > least[:, None], axis=1))


def _in_plane(points: FloatArray, normal: FloatArray) -> FloatArray | None:
    """Return (k, 2) the polygon seen against its normal, counterclockwise; None if it has no plane."""
    length = np.linalg.norm(normal)
    if not np.isfinite(points).all() or not np.isfinite(length) or length == 0:
        return None
    up = normal / length
    across = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    across /= np.linalg.norm(across)
    local = points - points.mean(axis=0)
    return np.stack([local @ across, local @ np.cross(up, across)], axis=1)


def _concave(plane: FloatArray) -> IntArray:
    """Return (k - 2, 3) triangles of a polygon in the plane that may be concave."""
    from mapbox_earcut import triangulate_float64

    size = len(plane)
    fan, smallest = _best_fan(plane)
    if smallest > 0:
        return fan
    ears = np.asarray(triangulate_float64(np.ascontiguousarray(plane), np.array([size], dtype=np.uint32)))
    # Where a polygon touches or crosses itself, earcut may leave corners out, which neighbours still have.
    if len(ears) == 3 * (size - 2) and len(np.unique(ears)) == size:
        return _flipped(plane, np.sort(ears.reshape(-1, 3).astype(np.int64), axis=1))
    return fan


def _flipped(plane: FloatArray, triangles: IntArray) -> IntArray:
    """Return triangles of better shape, by flipping diagonals while the worse of the two triangles gains.

    Ear clipping is content with triangles between three corners on a line.
    """
    points = [complex(x, y) for x, y in plane.tolist()]
    faces = [tuple(face) for face in triangles.tolist()]
    # Of each directed side, the triangle and the corner opposite.
    across = {(face[k], face[k - 2]): (t, face[k - 1]) for t, face in enumerate(faces) for k in range(3)}

    def shape(*face: int) -> float:
        a, b, c = (points[i] for i in face)
        sides = abs(b - a) ** 2 + abs(c - b) ** 2 + abs(a - c) ** 2
        return ((b - a).conjugate() * (c - a)).imag / sides if sides else 0.0

    # Every flip raises the sorted list of shapes, so this ends; most diagonals are flipped once, if at all.
    waiting = deque((a, b) for a, b in across if a < b and (b, a) in across)
    for _ in range(_MOST_TRIALS):
        if not waiting:
            break
        a, b = waiting.popleft()
        if (a, b) not in across or (b, a) not in across:
            continue
        (t, c), (s, d) = across[a, b], across[b, a]
        gain = min(shape(d, b, c), shape(a, d, c)) - min(shape(a, b, c), shape(b, a, d))
        if gain > _EMPTY_TRIANGLE:
            del across[a, b], across[b, a]
            for number, face in ((t, (d, b, c)), (s, (a, d, c))):
                faces[number] = face
                across |= {(face[k], face[k - 2]): (number, face[k - 1]) for k in range(3)}
            waiting += [
                (min(side), max(side)) for side in ((a, d), (d, b), (b, c), (c, a)) if side[::-1] in across
            ]
    return np.sort(np.array(faces, dtype=np.int64), axis=1)


def _best_fan(plane: FloatArray) -> tuple[IntArray, float]:
    """Return the fan whose smallest triangle is largest, and that triangle's part of the polygon's area.

    Of very large polygons, some of the corners are tried.

    The part is 0 where triangles are empty or turned over, or the fan is not one turn around its centre.
    """
    size = len(plane)
    best = (-np.inf, 0)
    for apex in range(0, size, -(-size // _APEXES)):
        local = np.roll(plane, -apex, axis=0)[1:] - plane[apex]
        areas = local[:-1, 0] * local[1:, 1] - local[:-1, 1] * local[1:, 0]
        best = max(best, (float(areas.min()), -apex))
    apex = -best[1]
    rim = np.roll(np.arange(size), -apex)
    local = plane[rim[1:]] - plane[apex]
    areas = local[:-1, 0] * local[1:, 1] - local[:-1, 1] * local[1:, 0]
    angles = np.arctan2(areas, np.einsum("ij,ij->i", local[:-1], local[1:]))
    fan = np.stack([np.full(size - 2, apex), rim[1:-1], rim[2:]], axis=1)
    total = areas.sum()
    sound = areas.min() > _EMPTY_TRIANGLE * total and angles.sum() < 2 * np.pi
    return np.sort(fan, axis=1), float(areas.min() / total) if sound else 0.0
