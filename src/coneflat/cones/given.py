"""Cones that the user gives: positions, or positions and curvatures."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_matrix

from .._arrays import BoolArray, FloatArray, IntArray
from ..errors import CurvatureError
from .solution import ConeSolution, GroundedLaplacian, target_from_log_scale

SUM_TOLERANCE = 1e-6  # radians: what a curvature typed with seven digits is off by


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
        CurvatureError: a closed surface that is no torus has no cone to carry its curvature.
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
    if abs(found - needed) > SUM_TOLERANCE:
        raise CurvatureError(
            f"cone curvatures must sum to 2 pi chi = {needed:.7g} ({2 * euler_characteristic} pi) on this "
            f"closed surface, but sum to {found:.7g} ({found / np.pi:.6g} pi): off by {found - needed:.3g}"
        )
    return curvatures + (needed - found) / len(curvatures) if len(curvatures) else curvatures
