"""Cones of which some have given curvatures: the others have those with the least area distortion."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_matrix

from .._arrays import BoolArray, FloatArray, IntArray
from .given import cones_with_curvature
from .solution import ConeSolution
from .sparse.fit_curvatures import fit_curvatures
from .sparse.green import GreenOperator
from .sparse.limits import Limits


def fitted_cones(
    laplacian: csc_matrix,
    curvature: FloatArray,
    areas: FloatArray,
    is_boundary: BoolArray,
    euler_characteristic: int,
    cones: IntArray,
    curvatures: FloatArray,
    *,
    min_cone_angle: float,
    max_cone_angle: float | None,
) -> ConeSolution:
    """Return cones with the curvatures given, the others with those that make E the least.

    With Green's functions g, the linear log scale is phi_0 + sum k_i g_i, and E its standard deviation by area: a
    convex quadratic program in the curvatures that are not given.

    Args:
        laplacian, curvature, is_boundary: of n vertices.
        areas: (n,) weights that sum to 1.
        euler_characteristic: of the connected mesh.
        cones, curvatures: (s,) vertices off the boundary and radians, NaN where it is to be computed.
        min_cone_angle, max_cone_angle: bounds of what is computed, radians; left out where the sum that the surface
            needs cannot be had within them.
    """
    is_free = np.isnan(curvatures)
    is_closed = not is_boundary.any()
    limits = Limits.of_angles(None, min_cone_angle, max_cone_angle, positive_only=False)
    operator = GreenOperator(laplacian, areas, is_boundary, np.arange(len(areas)))
    responses = operator.responses(np.searchsorted(operator.vertices, cones))
    log_scale = -operator.solve(curvature[operator.vertices])
    gram = _covariances(responses, responses, operator.areas)
    slope = _covariances(responses, log_scale[None], operator.areas)[:, 0]
    held = curvatures[~is_free]
    total = 2 * np.pi * euler_characteristic - held.sum() if is_closed else np.nan
    count = int(is_free.sum())
    found, _, _ = fit_curvatures(
        np.ascontiguousarray(gram[np.ix_(is_free, is_free)]),
        slope[is_free] + gram[np.ix_(is_free, ~is_free)] @ held,
        np.full(count, limits.least),
        np.full(count, limits.most),
        float(total),
    )
    filled = curvatures.copy()
    filled[is_free] = found
    return cones_with_curvature(laplacian, curvature, is_boundary, euler_characteristic, cones, filled)


def _covariances(one: FloatArray, other: FloatArray, areas: FloatArray) -> FloatArray:
    """Return (k, l) the covariances by area of functions (k, f) and (l, f)."""
    products: FloatArray = (one * areas) @ other.T - np.outer(one @ areas, other @ areas)
    return products
