"""Cones at given vertices: curvatures that phi = 0 there leads to, curvatures given, or the best of those left open.

What a user gives goes to `fitted_cones`, no cones at all to `cones_at`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csc_matrix

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..base.defaults import TYPED_TOLERANCE
from ..errors import CurvatureError
from ..stages import ConeSolution
from .solution import GroundedLaplacian, target_from_log_scale

if TYPE_CHECKING:
    from .sparse.linear_model import LinearModel


def cones_at(
    laplacian: csc_matrix,
    curvature: FloatArray,
    is_boundary: BoolArray,
    euler_characteristic: int,
    cones: IntArray,
) -> ConeSolution:
    """Compute the curvatures of cones at given vertices (Section 3.1 of the paper) of a connected mesh.

    Target curvatures and log scale are one Dirichlet problem: phi = 0 on cones and boundary, L phi = -K
    elsewhere; then the target is K + L phi.

    Raises:
        CurvatureError: a closed surface that is not a torus has no cone to carry its curvature.
    """
    is_singular = is_boundary.copy()
    is_singular[cones] = True
    grounded = is_singular.copy()
    if not is_singular.any():
        if euler_characteristic != 0:
            raise CurvatureError(
                f"a closed surface of Euler characteristic {euler_characteristic} has a total curvature of "
                f"{2 * euler_characteristic} pi and needs cones to carry it, but none is given"
            )
        grounded[0] = True
    phi = GroundedLaplacian(laplacian, grounded).solve(-curvature)
    target = target_from_log_scale(laplacian, curvature, phi, is_singular)
    return ConeSolution(cones, target, phi)


def cones_with_curvature(
    laplacian: csc_matrix,
    curvature: FloatArray,
    is_boundary: BoolArray,
    euler_characteristic: int,
    cones: IntArray,
    curvatures: FloatArray,
) -> ConeSolution:
    """Solve for the log scale of cones with given curvatures (Eq. 1 of the paper) on a connected mesh.

    On a bounded mesh phi = 0 on the boundary, which takes what the cones leave.

    Raises:
        CurvatureError: on a closed mesh, the curvatures do not sum to 2 pi chi.
    """
    is_closed = not is_boundary.any()
    target = np.zeros(len(curvature))
    target[cones] = checked_sum(curvatures, euler_characteristic if is_closed else None)
    grounded = is_boundary.copy()
    if is_closed:
        grounded[cones[0] if len(cones) else 0] = True
    phi = GroundedLaplacian(laplacian, grounded).solve(target - curvature)
    on_boundary = target_from_log_scale(laplacian, curvature, phi, is_boundary)
    return ConeSolution(cones, target + on_boundary, phi)


def checked_sum(curvatures: FloatArray, euler_characteristic: int | None) -> FloatArray:
    """Return the curvatures (s,) of a closed mesh's cones, radians, with the sum that they must have, to rounding.

    euler_characteristic: None where there is a boundary, which takes what they leave.

    Raises:
        CurvatureError: they do not sum to 2 pi chi.
    """
    if euler_characteristic is None:
        return curvatures
    needed = 2 * np.pi * euler_characteristic
    found = float(np.sum(curvatures))
    if abs(found - needed) > TYPED_TOLERANCE:
        raise CurvatureError(
            f"cone curvatures must sum to 2 pi chi = {needed:.7g} ({2 * euler_characteristic} pi) on this "
            f"closed surface, but sum to {found:.7g} ({found / np.pi:.6g} pi): off by {found - needed:.3g}"
        )
    return curvatures + (needed - found) / len(curvatures) if len(curvatures) else curvatures


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
    from .sparse.fit_curvatures import fit_curvatures
    from .sparse.limits import Limits

    operator, is_free = linear.operator, np.isnan(curvatures)
    euler = euler_characteristic if operator.is_closed else None
    if not is_free.any():
        return linear.solution_of(cones, checked_sum(curvatures, euler))
    limits = Limits.of_angles(None, min_cone_angle, max_cone_angle, positive_only=False)
    unknown = np.full(len(linear.curvature), -1, dtype=np.int64)
    unknown[operator.vertices] = np.arange(len(operator.vertices))
    responses = operator.responses(unknown[cones])
    gram = _covariances(responses, responses, operator.areas)
    slope = _covariances(responses, linear.log_scale[None], operator.areas)[:, 0]
    prescribed = curvatures[~is_free]
    total = np.nan if euler is None else 2 * np.pi * euler - prescribed.sum()
    count = int(is_free.sum())
    found, _, _ = fit_curvatures(
        np.ascontiguousarray(gram[np.ix_(is_free, is_free)]),
        slope[is_free] + gram[np.ix_(is_free, ~is_free)] @ prescribed,
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
