"""Triangles given by their side lengths: column i is the side opposite corner i.

The formulas use the slacks b + c - a, which are evaluated so that results are accurate also for needles and caps
(W. Kahan, "Miscalculating area and angles of a needle-like triangle", 2014).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import BoolArray, FloatArray, IntArray, as_floats, as_indices, dots
from ..base.jit import compiled
from ..errors import ArrayShapeError, FaceIndexError
from ..mesh.connectivity import NEXT, PREVIOUS, TriangleMesh, corner_fans, measure_sides

#: Cosine of the dihedral angle, about 53 degrees, above which an edge is drawn sharp. It is between the 42 degrees of
#: an icosahedron, which approximates a sphere, and the 60 degrees of a hexagonal prism, which has sharp edges.
CREASE_COSINE = 0.6


def edge_lengths(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return (m, 3) side lengths in model units; both sides of an edge get the same bits.

    Args:
        vertices: (n, 3) positions, or (n, 2) in the plane.
        faces: (m, 3) vertex indices.

    Raises:
        ArrayShapeError: the vertices are not (n, 3) or (n, 2), or the faces are not (m, 3).
        FaceIndexError: a face refers to a vertex that does not exist.
    """
    points, triangles = as_floats("vertices", vertices), as_indices("faces", faces)
    if points.ndim != 2:
        raise ArrayShapeError(
            f"vertices must have the shape (n, 3), or (n, 2) in the plane, got {points.shape}"
        )
    if triangles.ndim != 2 or triangles.shape[1] != 3:
        raise ArrayShapeError(f"faces must have the shape (m, 3), got {triangles.shape}")
    if triangles.size and not 0 <= triangles.min() <= triangles.max() < len(points):
        raise FaceIndexError(
            f"faces refer to vertices {triangles.min()} to {triangles.max()}, but there are {len(points)}, from 0"
        )
    return measure_sides(points, triangles)


def as_triples(lengths: ArrayLike) -> FloatArray:
    """Return lengths as a contiguous (m, 3) float array, as compiled loops need; raise ArrayShapeError otherwise."""
    array = as_floats("lengths", lengths)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ArrayShapeError(f"lengths must have the shape (m, 3), got {array.shape}")
    return array


def slacks(lengths: FloatArray) -> FloatArray:
    """Return (m, 3) the slack b + c - a of every side a; negative if the triangle inequality is broken.

    Args:
        lengths: (m, 3) side lengths, column i opposite corner i.
    """
    return measure_slacks(as_triples(lengths))


def is_broken(lengths: FloatArray) -> BoolArray:
    """Return (m,) True where the three lengths break the triangle inequality (Section 2.3 of the paper).

    Args:
        lengths: (m, 3) side lengths, column i opposite corner i.
    """
    return np.asarray(slacks(lengths).min(axis=1) < 0)


def double_areas(lengths: FloatArray) -> FloatArray:
    """Return (m,) twice the area of each triangle; 0 if the triangle inequality is broken.

    Args:
        lengths: (m, 3) side lengths, column i opposite corner i.
    """
    return measure_double_areas(as_triples(lengths))


def corner_angles(lengths: FloatArray) -> FloatArray:
    """Return (m, 3) corner angles in radians.

    If the triangle inequality is broken, the angles are complex numbers. Their real parts are returned: pi opposite the
    side that is too long and 0 at the others (Section 4.3 of the paper).

    Args:
        lengths: (m, 3) side lengths, column i opposite corner i.
    """
    slack = np.maximum(slacks(lengths), 0)
    # Computed column by column, as NumPy is slow at sums along an axis of length three.
    perimeter = (lengths[:, 0] + lengths[:, 1] + lengths[:, 2])[:, None]
    angles: FloatArray = 2 * np.arctan2(
        np.sqrt(slack[:, NEXT] * slack[:, PREVIOUS]), np.sqrt(perimeter * slack)
    )
    return angles


def cotangents(lengths: FloatArray) -> FloatArray:
    """Return (m, 3) cotangents of the corner angles; the triangles must have area.

    Args:
        lengths: (m, 3) side lengths, column i opposite corner i.
    """
    return measure_cotangents(as_triples(lengths))


@compiled
def side_slack(lengths: FloatArray, t: int, i: int) -> float:
    """Return the slack of side i of triangle t: by how much the two other sides together are longer."""
    b, c = lengths[t, (i + 1) % 3], lengths[t, (i + 2) % 3]
    return float(min(b, c) - (lengths[t, i] - max(b, c)))


@compiled
def measure_slacks(lengths: FloatArray) -> FloatArray:
    """Return the slacks (m, 3), b + c - a for every side a, of triangles with sides (m, 3)."""
    slack = np.empty(lengths.shape)
    for t in range(len(lengths)):
        for i in range(3):
            slack[t, i] = side_slack(lengths, t, i)
    return slack


@compiled
def measure_cotangents(lengths: FloatArray) -> FloatArray:
    """Return the cotangents (m, 3) of the angles of triangles with sides (m, 3); NumPy would need a dozen arrays."""
    cots = np.empty(lengths.shape)
    for t in range(len(lengths)):
        perimeter, product = lengths[t, 0] + lengths[t, 1] + lengths[t, 2], 1.0
        for i in range(3):
            cots[t, i] = side_slack(lengths, t, i)
            product *= 0.0 if cots[t, i] < 0.0 else cots[t, i]
        # Eight times the area, with the same rounding as in `measure_double_areas`.
        eightfold = 4 * (math.sqrt(perimeter * product) / 2)
        slack_0, slack_1, slack_2 = cots[t, 0], cots[t, 1], cots[t, 2]
        cots[t, 0] = (perimeter * slack_0 - slack_1 * slack_2) / eightfold
        cots[t, 1] = (perimeter * slack_1 - slack_2 * slack_0) / eightfold
        cots[t, 2] = (perimeter * slack_2 - slack_0 * slack_1) / eightfold
    return cots


@compiled
def measure_double_areas(lengths: FloatArray) -> FloatArray:
    """Return twice the area (m,) of triangles with sides (m, 3)."""
    areas = np.empty(len(lengths))
    for t in range(len(lengths)):
        product = 1.0
        for i in range(3):
            slack = side_slack(lengths, t, i)
            product *= 0.0 if slack < 0.0 else slack  # NaN is preserved
        areas[t] = math.sqrt((lengths[t, 0] + lengths[t, 1] + lengths[t, 2]) * product) / 2
    return areas


def face_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return (m, 3) normals of faces, whose lengths are twice the areas.

    Args:
        vertices, faces: (n, 3) positions, (m, 3) indices.
    """
    a, b, c = (np.take(vertices, faces[:, k], axis=0) for k in range(3))
    return np.asarray(np.cross(b - a, c - a))


def vertex_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return (n, 3) unit normals of vertices, the area-weighted means of those of their faces; 0 if undefined.

    Args:
        vertices, faces: (n, 3) positions, (m, 3) indices.
    """
    return unit_vectors(sums_at(faces, face_normals(vertices, faces)[:, None], len(vertices)))


def corner_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Return (m, 3, 3) unit normals of corners: angle-weighted means over the faces up to the nearest creases.

    Args:
        vertices, faces: (n, 3) positions, (m, 3) indices.
    """
    flat = unit_vectors(face_normals(vertices, faces))
    pairs = TriangleMesh(vertices, faces).edge_halfedges
    pairs = pairs[pairs[:, 1] >= 0]
    smooth = pairs[dots(flat[pairs[:, 0] // 3], flat[pairs[:, 1] // 3]) > CREASE_COSINE]
    count, fan = corner_fans(faces, smooth[:, 0], smooth[:, 1])
    weights = flat[:, None, :] * corner_angles(edge_lengths(vertices, faces))[:, :, None]
    return unit_vectors(sums_at(fan, weights, count))[fan]


def sums_at(places: IntArray, vectors: FloatArray, count: int) -> FloatArray:
    """Return (count, 3) the sum of the vectors (m, 3 or 1, 3) that have each index in `places` (m, 3)."""
    index, components = places.ravel(), np.broadcast_to(vectors, (*places.shape, 3)).reshape(-1, 3).T
    return np.stack([np.bincount(index, component, count) for component in components], axis=1)


def unit_vectors(vectors: FloatArray) -> FloatArray:
    """Return (k, 3) vectors scaled to unit length; 0 for zero vectors and those that are not finite."""
    with np.errstate(over="ignore", invalid="ignore"):
        # Divided by the largest component, so that squares neither overflow nor vanish.
        scaled = vectors / np.maximum(np.abs(vectors).max(axis=1, keepdims=True), np.finfo(float).tiny)
        lengths = np.linalg.norm(scaled, axis=1, keepdims=True)
    is_vector = np.isfinite(lengths) & (lengths > 0)
    return np.where(is_vector, scaled / np.where(is_vector, lengths, 1), 0.0)


def dihedral_angles(mesh: TriangleMesh) -> FloatArray:
    """Return (e,) the signed angle between the normals of the two faces of each edge, radians; 0 on the boundary.

    If the faces are counterclockwise seen from outside, it is positive at convex and negative at concave edges.
    """
    normals = face_normals(mesh.vertices, mesh.faces)
    first_normals, second_normals = normals[mesh.edge_faces[:, 0]], normals[mesh.edge_faces[:, 1]]
    side = mesh.edge_halfedges[:, 0]
    along = mesh.vertices[mesh.heads[side]] - mesh.vertices[mesh.tails[side]]
    across = np.cross(first_normals, second_normals)
    angles = np.arctan2(np.sqrt(dots(across, across)), dots(first_normals, second_normals))
    return np.where(mesh.is_boundary_edge, 0.0, np.where(dots(across, along) < 0, -angles, angles))
