"""Vertex areas and the area-weighted norm, angle defects, and the cotangent Laplacian."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_matrix, diags

from ..base.arrays import BoolArray, FloatArray, IntArray, as_faces, as_floats, unit_exponent
from ..errors import ArrayShapeError, OptionError
from ..mesh.connectivity import NEXT, PREVIOUS
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
    """Return the area distortion E: the area-weighted standard deviation of the log conformal factor, 0 if uniform.

    log_scale, areas: (n,).
    """
    share = areas / areas.sum()
    return float(np.sqrt(share @ (log_scale - share @ log_scale) ** 2))


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
    is_safe = 1 / MAX_SAFE_NUMBER < values.max(initial=1.0) < MAX_SAFE_NUMBER
    return values if is_safe else at_unit_scale(values)


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
    triangles, corner_cots = as_faces(faces, vertex_count), as_floats("cots", cots)
    if corner_cots.shape != triangles.shape:
        raise ArrayShapeError(
            f"cots must have the shape {triangles.shape} of the faces, got {corner_cots.shape}"
        )
    tails, heads = triangles[:, NEXT].ravel(), triangles[:, PREVIOUS].ravel()
    shape = vertex_count, vertex_count
    half = csc_matrix((corner_cots.ravel() / 2, (tails, heads)), shape=shape)
    weights = half + half.T
    laplacian = csc_matrix(diags(np.asarray(weights.sum(axis=0))[0]) - weights)
    laplacian.eliminate_zeros()
    return laplacian
