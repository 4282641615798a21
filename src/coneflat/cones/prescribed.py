"""Cones at given vertices: with curvatures that follow from phi = 0, with given curvatures, or with fitted curvatures.

Cones that a user gives are handled by `fitted_cones`, and the case of no cones by `cones_at`.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_matrix

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..base.defaults import TYPED_TOLERANCE
from ..errors import CurvatureError
from ..stages import ConeSolution
from .solution import GroundedLaplacian, target_from_log_scale
from .sparse.fit_curvatures import fit_curvatures
from .sparse.limits import Limits
from .sparse.linear_model import LinearModel


def cones_at(
    laplacian: csc_matrix,
    curvature: FloatArray,
    is_boundary: BoolArray,
    euler_characteristic: int,
    cones: IntArray,
) -> ConeSolution:
    """Return cones at given vertices of a connected mesh with curvatures that follow from phi = 0 (Section 3.1).

    The section is that of the paper. The log conformal factor solves a Dirichlet problem: phi = 0 at cones and
    boundary, and L phi = -K elsewhere. The target curvature is then K + L phi.

    Args:
        laplacian: (n, n) cotangent Laplacian L.
        curvature: (n,) angle defect K, radians.
        is_boundary: (n,) mask.
        euler_characteristic: chi of the mesh.
        cones: (s,) vertices.

    Raises:
        CurvatureError: a closed surface that is not a torus has no cones.
    """
    is_singular = is_boundary.copy()
    is_singular[cones] = True
    grounded = is_singular.copy()
    if not is_singular.any():
        if euler_characteristic != 0:
            raise CurvatureError(
                f"a closed surface of Euler characteristic {euler_characteristic} has a total curvature of "
                f"{2 * euler_characteristic} pi and needs cones to absorb it, but has none: give or allow some"
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
    """Return the log conformal factor of cones with given curvatures (Eq. 1 of the paper) on a connected mesh.

    On a mesh with boundary, phi = 0 on the boundary, which absorbs the remaining curvature.

    Args:
        laplacian: (n, n) cotangent Laplacian.
        curvature: (n,) angle defect, radians.
        is_boundary: (n,) mask.
        euler_characteristic: chi of the mesh.
        cones, curvatures: (s,) vertices and radians.

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
    """Return (s,) the curvatures of cones, corrected so that their sum is 2 pi chi up to rounding.

    Args:
        curvatures: (s,) radians.
        euler_characteristic: chi of a closed mesh; None for a mesh with boundary, which absorbs the remaining
            curvature.

    Raises:
        CurvatureError: the curvatures do not sum to 2 pi chi.
    """
    if euler_characteristic is None:
        return curvatures
    needed = 2 * np.pi * euler_characteristic
    total = float(np.sum(curvatures))
    if abs(total - needed) > TYPED_TOLERANCE:
        raise CurvatureError(
            f"cone curvatures must sum to 2 pi chi = {needed:.7g} ({2 * euler_characteristic} pi) on this "
            f"closed surface, but sum to {total:.7g} ({total / np.pi:.6g} pi): off by {total - needed:.3g}"
        )
    return curvatures + (needed - total) / len(curvatures) if len(curvatures) else curvatures


def fitted_cones(
    linear: LinearModel,
    euler_characteristic: int,
    cones: IntArray,
    curvatures: FloatArray,
    *,
    min_cone_angle: float,
    max_cone_angle: float | None,
) -> ConeSolution:
    """Return cones with given curvatures; those that are not given minimise E.

    With the Green's functions g_i of the cones, the linear log conformal factor is phi_0 + sum k_i g_i, and E is its
    area-weighted standard deviation. This is a convex quadratic program in the curvatures that are not given.

    Args:
        linear: the linear model of the connected mesh.
        euler_characteristic: chi of the mesh.
        cones, curvatures: (s,) inner vertices and radians; NaN where the curvature is to be computed.
        min_cone_angle, max_cone_angle: bounds of the computed cone angles, radians. They are ignored if they do not
            allow the sum of curvatures that the surface needs.

    Raises:
        CurvatureError: all curvatures are given, and on a closed mesh they do not sum to 2 pi chi.

    Notes:
        With the area weights a and A = diag(a) - a a^T, E^2 = (phi_0 + G k)^T A (phi_0 + G k), where the columns of G
        are the g_i. The Gram matrix is G^T A G and the linear term G^T A phi_0.

    See Also:
        fit_curvatures: the quadratic program.
        ConeSearch: also searches for the vertices.
    """
    operator, is_free = linear.operator, np.isnan(curvatures)
    euler = euler_characteristic if operator.is_closed else None
    if not is_free.any():
        return linear.solution_of(cones, checked_sum(curvatures, euler))
    limits = Limits.of_angles(None, min_cone_angle, max_cone_angle, positive_only=False)
    responses = operator.responses(operator.unknowns_of(cones))
    gram = _covariances(responses, responses, operator.areas)
    slope = _covariances(responses, linear.log_scale[None], operator.areas)[:, 0]
    prescribed = curvatures[~is_free]
    total = np.nan if euler is None else 2 * np.pi * euler - prescribed.sum()
    count = int(is_free.sum())
    gram_of_free, coupling = (
        np.ascontiguousarray(gram[np.ix_(is_free, is_free)]),
        gram[np.ix_(is_free, ~is_free)],
    )
    lower, upper = np.full(count, limits.lower), np.full(count, limits.upper)
    fitted, _, _ = fit_curvatures(
        gram_of_free, slope[is_free] + coupling @ prescribed, lower, upper, float(total)
    )
    filled = curvatures.copy()
    filled[is_free] = fitted
    return linear.solution_of(cones, checked_sum(filled, euler))


def _covariances(first: FloatArray, second: FloatArray, areas: FloatArray) -> FloatArray:
    """Return (k, l) the area-weighted covariances of functions (k, f) and (l, f)."""
    return (first * areas) @ second.T - np.outer(first @ areas, second @ areas)
