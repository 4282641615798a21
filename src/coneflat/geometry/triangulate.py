"""Triangulation of polygons.

Quads and convex polygons are split here, vectorised. Other polygons are triangulated one at a time by the ear clipping
of mapbox_earcut.
"""

from __future__ import annotations

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray, dots
from ..errors import DegenerateFaceError, FaceIndexError
from ..mesh.connectivity import TriangleMesh
from ..mesh.polygons import fan_corners, first_bad_corner, polygon_of
from .delaunay import intrinsic_delaunay
from .triangles import edge_lengths

#: Relative to the area of a polygon and to the lengths of the diagonals of a quad: smaller areas count as zero, smaller
#: differences as equal. It is far above the rounding of collinear corners and of rotated squares (about 1e-16).
_ROUNDING = 1e-9


def triangulate(vertices: FloatArray, corners: IntArray, offsets: IntArray) -> tuple[IntArray, IntArray]:
    """Return the triangulation of polygons: k - 2 triangles for a polygon of k corners, with its orientation.

    A quad is split along the diagonal for which both halves have the orientation of the quad; if both diagonals do,
    along the shorter one. Larger convex polygons are split into fans. Others are triangulated by ear clipping, and
    their diagonals are flipped to Delaunay. Coordinates may be NaN; the indices of the result are then still valid.

    Args:
        vertices: (n, 3) positions.
        corners: (c,) vertex of every polygon corner, polygon after polygon.
        offsets: (p + 1,) polygon i has the corners corners[offsets[i]:offsets[i + 1]].

    Returns:
        (m, 3) vertex indices, in the order of the polygons; a view of `corners` if all are triangles. (m, 3) the
        same as indices into `corners`.

    Raises:
        DegenerateFaceError: a polygon has fewer than 3 corners.
        FaceIndexError: a corner refers to a vertex that does not exist.
    """
    corners = np.asarray(corners, dtype=np.int64)
    offsets = np.asarray(offsets, dtype=np.int64)
    sizes = np.diff(offsets)
    _check(len(vertices), corners, offsets, sizes)

    if len(corners) == 3 * len(sizes):
        return corners.reshape(-1, 3), np.arange(len(corners)).reshape(-1, 3)
    first_triangle = np.cumsum(sizes - 2) - (sizes - 2)
    face_corners = np.empty((int((sizes - 2).sum()), 3), dtype=np.int64)

    for size in np.unique(sizes).tolist():
        polygons = np.flatnonzero(sizes == size)
        polygon_corners = corners[offsets[polygons, None] + np.arange(size)]
        local = fan_corners(np.array([0, size]))
        if size == 4:
            use_02 = _splits_at_first_corner(vertices, polygon_corners)[:, None, None]
            local = np.where(use_02, local, [[0, 1, 3], [1, 2, 3]])
        elif size > 4:
            local = _ngons(vertices[polygon_corners])
        rows = first_triangle[polygons, None] + np.arange(size - 2)
        face_corners[rows] = offsets[polygons, None, None] + local
    return corners[face_corners], face_corners


def is_polygon_side(face_corners: IntArray, offsets: IntArray) -> BoolArray:
    """Return (m, 3) whether the side from triangle corner k to k + 1 is a side of its polygon.

    It is False for the diagonals that `triangulate` adds. Triangles may have either orientation.

    Args:
        face_corners: (m, 3) polygon corner at each triangle corner.
        offsets: (p + 1,) where the corners of each polygon start.
    """
    sizes = np.diff(offsets)[polygon_of(face_corners, offsets)][:, None]
    steps = np.abs(face_corners - np.roll(face_corners, -1, axis=1))
    return np.asarray((steps == 1) | (steps == sizes - 1))


def _check(vertex_count: int, corners: IntArray, offsets: IntArray, sizes: IntArray) -> None:
    if np.any(sizes < 3):
        i = int(np.argmax(sizes < 3))
        raise DegenerateFaceError(f"face {i} has {sizes[i]} corners, but a face needs at least 3")
    c = first_bad_corner(corners, vertex_count)
    if c is not None:
        i = int(np.searchsorted(offsets, c, side="right")) - 1
        raise FaceIndexError(f"face {i} refers to vertex {corners[c]}, but there are {vertex_count} vertices")


def _splits_at_first_corner(vertices: FloatArray, quads: IntArray) -> BoolArray:
    """Return (q,) whether to split quads from corner 0 to 2 instead of from 1 to 3.

    The choice does not depend on which corner comes first.
    """
    p0, p1, p2, p3 = (vertices[quads[:, k]] for k in range(4))
    with np.errstate(invalid="ignore", over="ignore"):
        normal = np.cross(p2 - p0, p3 - p1)
        threshold = _ROUNDING * dots(normal, normal)
        valid_02 = (dots(np.cross(p1 - p0, p2 - p0), normal) > threshold) & (
            dots(np.cross(p2 - p0, p3 - p0), normal) > threshold
        )
        valid_13 = (dots(np.cross(p1 - p0, p3 - p0), normal) > threshold) & (
            dots(np.cross(p2 - p1, p3 - p1), normal) > threshold
        )
        length_02 = dots(p2 - p0, p2 - p0)
        length_13 = dots(p3 - p1, p3 - p1)
        choice = length_02 < length_13
        tied = np.abs(length_02 - length_13) <= _ROUNDING * (length_02 + length_13)
    if tied.any():
        # The diagonal from the lexicographically first corner is chosen, so that on a grid all diagonals are parallel.
        rank = np.empty(len(vertices), dtype=np.int64)
        rank[np.lexsort(vertices.T[::-1])] = np.arange(len(vertices))
        ranks = rank[quads[tied]]
        choice[tied] = ranks[:, [0, 2]].min(axis=1) < ranks[:, [1, 3]].min(axis=1)
    return np.where(valid_02 == valid_13, choice, valid_02)


def _ngons(points: FloatArray) -> IntArray:
    """Return (q, k - 2, 3) triangles of q polygons of k > 4 corners, as corner numbers 0 to k - 1.

    The numbers ascend in each triangle, so that it has the orientation of its polygon.

    points: (q, k, 3) positions of the corners.
    """
    size = points.shape[1]
    triangles = np.tile(fan_corners(np.array([0, size])), (len(points), 1, 1))
    clipped: list[int] = []
    planes, ears = [], []
    with np.errstate(invalid="ignore", over="ignore"):
        normals = _newell_normals(points)
        for i in np.flatnonzero(~_is_convex(points, normals)).tolist():
            plane = _in_plane(points[i], normals[i])
            faces = None if plane is None else _clipped(plane)
            if plane is not None and faces is not None:
                ears.append(faces + size * len(clipped))
                planes.append(plane)
                clipped.append(i)
    if clipped:
        # Ear clipping may give triangles with collinear corners; Delaunay flips remove them.
        mesh = TriangleMesh(np.concatenate(planes), np.concatenate(ears))
        delaunay, _ = intrinsic_delaunay(mesh, edge_lengths(mesh.vertices, mesh.faces))
        triangles[clipped] = np.sort(delaunay.faces.reshape(-1, size - 2, 3) % size, axis=2)
    return triangles


def _newell_normals(points: FloatArray) -> FloatArray:
    """Return (q, 3) normals by Newell's method, whose lengths are twice the areas."""
    local = points - points[:, :1]
    return np.asarray(np.cross(local[:, 1:-1], local[:, 2:]).sum(axis=1))


def _is_convex(points: FloatArray, normals: FloatArray) -> BoolArray:
    """Return (q,) whether every corner turns left and the fan from corner 0 covers the polygon once."""
    threshold = _ROUNDING * np.einsum("ij,ij->i", normals, normals)
    sides = np.roll(points, -1, axis=1) - points
    turns = np.einsum("qki,qi->qk", np.cross(np.roll(sides, 1, axis=1), sides), normals)
    local = points - points[:, :1]
    fan = np.einsum("qki,qi->qk", np.cross(local[:, 1:-1], local[:, 2:]), normals)
    return np.asarray(np.all(turns > threshold[:, None], axis=1) & np.all(fan > threshold[:, None], axis=1))


def _in_plane(points: FloatArray, normal: FloatArray) -> FloatArray | None:
    """Return (k, 2) the polygon projected along its normal, counterclockwise; None if the normal is undefined."""
    length = np.linalg.norm(normal)
    if not np.isfinite(points).all() or not np.isfinite(length) or length == 0:
        return None
    up = normal / length
    across = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    across /= np.linalg.norm(across)
    local = points - points.mean(axis=0)
    return np.stack([local @ across, local @ np.cross(up, across)], axis=1)


def _clipped(plane: FloatArray) -> IntArray | None:
    """Return (k - 2, 3) triangles of a polygon in the plane, by ear clipping; None if they do not use all corners.

    Neighbouring polygons still use these corners. This happens if a polygon touches or crosses itself.
    """
    from mapbox_earcut import triangulate_float64

    size = len(plane)
    ears = np.asarray(triangulate_float64(np.ascontiguousarray(plane), np.array([size], dtype=np.uint32)))
    if len(ears) != 3 * (size - 2) or len(np.unique(ears)) < size:
        return None
    return np.sort(ears.reshape(-1, 3).astype(np.int64), axis=1)
