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
