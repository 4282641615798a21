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
    target = np.zeros(len(curvature))
    target[cones] = curvatures
    grounded = is_boundary.copy()
    if not is_boundary.any():
        needed = 2 * np.pi * euler_characteristic
        found = float(np.sum(curvatures))
        if abs(found - needed) > SUM_TOLERANCE:
            raise CurvatureError(
                f"cone curvatures must sum to 2 pi chi = {needed:.7g} ({2 * euler_characteristic} pi) on this "
                f"closed surface, but sum to {found:.7g} ({found / np.pi:.6g} pi): off by {found - needed:.3g}"
            )
        if len(cones):
            target[cones] += (needed - found) / len(cones)
            grounded[cones[0]] = True
        else:
            grounded[0] = True
    phi = GroundedLaplacian(laplacian, grounded).solve(target - curvature)
    on_boundary = target_from_log_scale(laplacian, curvature, phi, is_boundary)
    return ConeSolution(cones, target + on_boundary, phi)
