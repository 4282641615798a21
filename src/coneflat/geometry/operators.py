"""Vertex areas and the area-weighted norm, angle defects, and the cotangent Laplacian."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_matrix

from ..base.arrays import BoolArray, FloatArray, Int32Array, IntArray, as_faces, as_floats, unit_exponent
from ..base.jit import compiled
from ..errors import ArrayShapeError, OptionError
from .triangles import double_areas

# Smallest weight, relative to the largest; smaller weights are raised to it. With zero weights, the norm would be
# degenerate.
MIN_WEIGHT = 1e-6
# Products and sums of numbers up to this, and down to its inverse, neither overflow nor underflow.
MAX_SAFE_NUMBER = 1e100


def vertex_areas(faces: IntArray, lengths: FloatArray, vertex_count: int) -> FloatArray:
    """Return (n,) vertex areas: a third of the area of the triangles at each vertex.

    Args:
        faces: (m, 3) vertex indices.
        lengths: (m, 3) side lengths, model units.
        vertex_count: number n of vertices.
    """
    thirds = np.repeat(double_areas(lengths) / 6, 3)
    return np.bincount(faces.ravel(), weights=thirds, minlength=vertex_count).astype(np.float64)


def area_distortion(log_scale: FloatArray, areas: FloatArray) -> float:
    """Return the area distortion E, the area-weighted standard deviation of the log scale; 0 for uniform scaling.

    log_scale, areas: (n,).
    """
    share = areas / areas.sum()
    mean = share @ log_scale
    return float(np.sqrt(share @ (log_scale - mean) ** 2))


def weighted_areas(areas: FloatArray, weights: FloatArray | None) -> FloatArray:
    """Return (n,) areas times weights, normalised to the sum 1.

    Args:
        areas: (n,) vertex areas.
        weights: (n,) importance weights, not negative; None for 1.

    Raises:
        OptionError: a weight is negative or not finite, or all weights are zero.
    """
    if weights is None:
        return areas / areas.sum()
    if np.shape(weights) != areas.shape or not np.isfinite(weights).all() or (weights < 0).any():
        raise OptionError(f"importance weights must be {len(areas)} finite numbers that are not negative")
    if not weights.max() > 0:
        raise OptionError("importance weights are zero everywhere")
    share = areas * np.maximum(at_unit_scale(weights), MIN_WEIGHT)
    return np.asarray(share / share.sum())


def at_unit_scale(values: FloatArray) -> FloatArray:
    """Return nonnegative values, not all 0, times the power of two that scales the largest to between 1/2 and 1."""
    return np.ldexp(values, -unit_exponent(values))


def at_safe_scale(values: FloatArray) -> FloatArray:
    """Return the values unchanged if sums of their products with lengths are finite, else scaled to unit size."""
    return (
        values if 1 / MAX_SAFE_NUMBER < values.max(initial=1.0) < MAX_SAFE_NUMBER else at_unit_scale(values)
    )


def angle_defect(faces: IntArray, angles: FloatArray, is_boundary_vertex: BoolArray) -> FloatArray:
    """Return (n,) curvature in radians: 2 pi (inside) or pi (boundary) minus the sum of the angles.

    Its sum is 2 pi times the Euler characteristic (Gauss-Bonnet).

    Args:
        faces: (m, 3) vertex indices.
        angles: (m, 3) corner angles, radians.
        is_boundary_vertex: (n,) mask.
    """
    full = np.where(is_boundary_vertex, np.pi, 2 * np.pi)
    defect: FloatArray = full - np.bincount(
        faces.ravel(), weights=angles.ravel(), minlength=len(is_boundary_vertex)
    )
    return defect


def cotangent_laplacian(faces: IntArray, cots: FloatArray, vertex_count: int) -> csc_matrix:
    """Return the (n, n) positive semidefinite Laplacian, w_ij = (cot a + cot b) / 2.

    (L x)_i = sum_j w_ij (x_i - x_j). Its kernel consists of the functions that are constant on each component.

    Args:
        faces: (m, 3) vertex indices.
        cots: (m, 3) cotangents of the corner angles.
        vertex_count: number n of vertices.

    Raises:
        ArrayShapeError, EmptyMeshError, FaceIndexError: the arrays do not fit each other.
    """
    triangles, given = as_faces(faces, vertex_count), as_floats("cots", cots)
    if given.shape != triangles.shape:
        raise ArrayShapeError(f"cots must have the shape {triangles.shape} of the faces, got {given.shape}")
    starts = np.zeros(vertex_count + 1, dtype=np.int32)
    rows = np.empty(6 * len(triangles) + vertex_count, dtype=np.int32)
    values = np.empty(len(rows))
    count = fill_laplacian(triangles, np.ascontiguousarray(given), starts, rows, values)
    shape = vertex_count, vertex_count
    return csc_matrix((values[:count].copy(), rows[:count].copy(), starts), shape=shape)


@compiled
def fill_laplacian(
    faces: IntArray, cots: FloatArray, starts: Int32Array, rows: Int32Array, values: FloatArray
) -> int:
    """Write the Laplacian in CSC form with sorted rows and without zero entries; return the number of entries.

    starts: (n + 1,) zeros on entry. rows, values: buffers for n + 6m entries.
    """
    n = len(starts) - 1
    leaving, entering = np.zeros(n), np.zeros(n)
    for f in range(len(faces)):
        for c in range(3):
            i, j, w = faces[f, (c + 1) % 3], faces[f, (c + 2) % 3], cots[f, c] / 2
            starts[i + 1] += 1
            starts[j + 1] += 1
            leaving[i] += w
            entering[j] += w
    for v in range(n):
        starts[v + 1] += starts[v] + 1
    # Each column has its diagonal entry first, then two entries for each side at its vertex.
    place = starts[:-1].copy()
    for v in range(n):
        rows[place[v]], values[place[v]] = v, leaving[v] + entering[v]
        place[v] += 1
    for f in range(len(faces)):
        for c in range(3):
            i, j, w = faces[f, (c + 1) % 3], faces[f, (c + 2) % 3], cots[f, c] / 2
            rows[place[i]], values[place[i]] = j, -w
            # Advanced before the next entry, since an edge of an intrinsic triangulation may be a loop (i == j).
            place[i] += 1
            rows[place[j]], values[place[j]] = i, -w
            place[j] += 1
    # The matrix is symmetric; its transpose, computed column by column, has sorted rows.
    of_column, of_value = rows.copy(), values.copy()
    place[:] = starts[:-1]
    for v in range(n):
        for at in range(starts[v], starts[v + 1]):
            row = of_column[at]
            rows[place[row]], values[place[row]] = v, of_value[at]
            place[row] += 1
    return sum_repeated(starts, rows, values)


@compiled
def sum_repeated(starts: Int32Array, rows: Int32Array, values: FloatArray) -> int:
    """Sum consecutive entries of the same row and remove zeros, in place; return the number of entries left."""
    kept, begin = 0, 0
    for v in range(len(starts) - 1):
        at, end = begin, starts[v + 1]
        starts[v] = kept
        while at < end:
            row, value = rows[at], 0.0
            while at < end and rows[at] == row:
                value += values[at]
                at += 1
            if value != 0.0:
                rows[kept], values[kept] = row, value
                kept += 1
        begin = end
    starts[-1] = kept
    return kept
