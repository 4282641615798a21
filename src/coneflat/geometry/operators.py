"""Areas at vertices, and the norm that goes with them."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_matrix, diags

from .._arrays import BoolArray, FloatArray, IntArray, unit_exponent
from ..errors import OptionError
from ..mesh import NEXT, PREVIOUS
from .triangles import double_areas

# Of the largest: weights below count as this. Without any, the norm would not tell apart what only lies there.
LEAST_WEIGHT = 1e-6
# Numbers up to this, and down to its inverse, can be multiplied and summed up without a thought.
LARGE = 1e100


def vertex_areas(faces: IntArray, lengths: FloatArray, vertex_count: int) -> FloatArray:
    """Return (n,) a third of the area of the triangles at each vertex."""
    thirds = np.repeat(double_areas(lengths) / 6, 3)
    return np.bincount(faces.ravel(), weights=thirds, minlength=vertex_count).astype(np.float64)


def area_distortion(log_scale: FloatArray, areas: FloatArray) -> float:
    """Return E, the standard deviation of the log scale by area: 0 for a map that scales all alike."""
    mean = np.average(log_scale, weights=areas)
    return float(np.sqrt(np.average((log_scale - mean) ** 2, weights=areas)))


def weighted_areas(areas: FloatArray, weights: FloatArray | None) -> FloatArray:
    """Return (n,) areas times weights, made to sum to 1."""
    if weights is None:
        return areas / areas.sum()
    if np.shape(weights) != areas.shape or not np.isfinite(weights).all() or (weights < 0).any():
        raise OptionError(f"importance weights must be {len(areas)} numbers that are finite and not negative")
    if not weights.max() > 0:
        raise OptionError("importance weights are zero everywhere")
    share = areas * np.maximum(at_unit_scale(weights), LEAST_WEIGHT)
    return np.asarray(share / share.sum())


def at_unit_scale(values: FloatArray) -> FloatArray:
    """Return values of 0 and more, not all 0, times the power of two that brings the largest to between 1/2 and 1."""
    return np.ldexp(values, -unit_exponent(values))


def at_safe_scale(values: FloatArray) -> FloatArray:
    """Return values as they are where sums of their products with lengths are finite, else at unit scale."""
    return values if 1 / LARGE < values.max(initial=1.0) < LARGE else at_unit_scale(values)


def angle_defect(faces: IntArray, angles: FloatArray, is_boundary_vertex: BoolArray) -> FloatArray:
    """Return (n,) curvature in radians: 2 pi (inside) or pi (boundary) minus the sum of the angles.

    It sums to 2 pi times the Euler characteristic (Gauss-Bonnet).
    """
    full = np.where(is_boundary_vertex, np.pi, 2 * np.pi)
    defect: FloatArray = full - np.bincount(
        faces.ravel(), weights=angles.ravel(), minlength=len(is_boundary_vertex)
    )
    return defect


def cotangent_laplacian(faces: IntArray, cots: FloatArray, vertex_count: int) -> csc_matrix:
    """Return the (n, n) positive semidefinite Laplacian, w_ij = (cot a + cot b) / 2.

    (L x)_i = sum_j w_ij (x_i - x_j); its kernel are the constants on each component.
    """
    i = faces[:, NEXT].ravel().astype(np.int32)
    j = faces[:, PREVIOUS].ravel().astype(np.int32)
    w = cots.ravel() / 2
    shape = vertex_count, vertex_count
    # Half of the entries, and their mirror image: sorting all of them at once takes three times as long.
    half = csc_matrix((w, (i, j)), shape=shape)
    weights = half + half.T.tocsc()
    diagonal = np.bincount(i, w, vertex_count) + np.bincount(j, w, vertex_count)
    return csc_matrix(diags(diagonal, format="csc") - weights)
