"""Triangles of the plane, which may be upside down: column i of sides is the side opposite corner i."""

from __future__ import annotations

import numpy as np

from .._arrays import ComplexArray, FloatArray
from ..mesh import NEXT, PREVIOUS


def signed_double_areas(corners: FloatArray) -> FloatArray:
    """Return (m,) twice the area of triangles with corners (m, 3, 2), negative where these run clockwise."""
    one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    areas: FloatArray = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
    return areas


def signed_angles(sides: ComplexArray) -> FloatArray:
    """Return (m, 3) the corner angles, radians, of triangles with sides (m, 3); negative where they are upside down."""
    angles: FloatArray = np.angle(-sides[:, NEXT] * np.conj(sides[:, PREVIOUS]))
    return angles


def heights(sides: ComplexArray) -> FloatArray:
    """Return (m,) height over longest side of triangles with sides (m, 3); negative for those upside down."""
    doubled = (np.conj(sides[:, 0]) * sides[:, 1]).imag
    ratio: FloatArray = doubled / np.maximum((np.abs(sides) ** 2).max(axis=1), np.finfo(np.float64).tiny)
    return ratio


def sides_between(corners: FloatArray) -> ComplexArray:
    """Return (m, 3) the sides of triangles with corners (m, 3, 2)."""
    sides = np.ascontiguousarray(corners[:, PREVIOUS] - corners[:, NEXT], dtype=np.float64)
    return sides.view(np.complex128)[..., 0]
