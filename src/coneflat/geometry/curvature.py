"""Discrete Gaussian curvature."""

from __future__ import annotations

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray


def angle_defect(faces: IntArray, angles: FloatArray, is_boundary_vertex: BoolArray) -> FloatArray:
    """Return (n,) curvature in radians: 2 pi (inside) or pi (boundary) minus the sum of the angles.

    It sums to 2 pi times the Euler characteristic (Gauss-Bonnet).
    """
    full = np.where(is_boundary_vertex, np.pi, 2 * np.pi)
    defect: FloatArray = full - np.bincount(
        faces.ravel(), weights=angles.ravel(), minlength=len(is_boundary_vertex)
    )
    return defect
