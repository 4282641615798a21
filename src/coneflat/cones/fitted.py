"""Cones of which some have given curvatures: the others have those with the least area distortion."""

from __future__ import annotations

import numpy as np

from .._arrays import FloatArray, IntArray
from .given import checked_sum
from .solution import ConeSolution
from .sparse.fit_curvatures import fit_curvatures
from .sparse.limits import Limits
from .sparse.linear_model import LinearModel


def fitted_cones(
    linear: LinearModel,
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
        linear: of the connected mesh.
        euler_characteristic: of it.
        cones, curvatures: (s,) vertices off the boundary and radians, NaN where it is to be computed.
        min_cone_angle, max_cone_angle: bounds of what is computed, radians; left out where the sum that the surface
            needs cannot be had within them.

    Raises:
        CurvatureError: all are given, and on a closed mesh do not sum to 2 pi chi.
    """
    operator, is_free = linear.operator, np.isnan(curvatures)
    euler = euler_characteristic if operator.is_closed else None
    if not is_free.any():
        return linear.solution_of(cones, checked_sum(curvatures, euler))
    limits = Limits.of_angles(None, min_cone_angle, max_cone_angle, positive_only=False)
    unknown = np.full(len(linear.curvature), -1, dtype=np.int64)
    unknown[operator.vertices] = np.arange(len(operator.vertices))
    responses = operator.known_responses(unknown[cones])
    gram = _covariances(responses, responses, operator.areas)
    slope = _covariances(responses, linear.log_scale[None], operator.areas)[:, 0]
    held = curvatures[~is_free]
    total = np.nan if euler is None else 2 * np.pi * euler - held.sum()
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
    return linear.solution_of(cones, checked_sum(filled, euler))


def _covariances(one: FloatArray, other: FloatArray, areas: FloatArray) -> FloatArray:
    """Return (k, l) the covariances by area of functions (k, f) and (l, f)."""
    products: FloatArray = (one * areas) @ other.T - np.outer(one @ areas, other @ areas)
    return products
