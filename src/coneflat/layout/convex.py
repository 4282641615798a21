"""Polygons of the input made convex in the plane.

Meshes of polygons are flattened as triangles, along diagonals of our choice. Others that read the polygons choose their
own: what they see is upright, too, only where the polygon is convex.
"""

from __future__ import annotations

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray
from ..geometry.planar import heights, sides_between
from ..mesh import TriangleMesh
from ..polygons import Polygons

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
    wished = np.unique(triples[np.isin(owner, chosen)])
    wished = wished[movable[wished]]
    if not len(wished):
        return points
    # What is concave in space may be so in the plane; it must not stand in the way of others.
    hopeless = np.isin(owner, np.setdiff1d(owner[is_bad], chosen))
    return _moved(points, np.concatenate([uv_faces, triples[~hopeless]]), wished)


def _moved(points: FloatArray, triangles: IntArray, moving: IntArray) -> FloatArray:
    """Return the points, some of them moved so that triangles (t, 3) at them are upright, where that can be."""
    from .convex_kernel import move_points

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
