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


def bounds(corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (m, 2) the least and the largest coordinates of triangles with corners (m, 3, 2)."""
    # Corner by corner: NumPy is slow at least values along an axis of three.
    one, two, three = corners[:, 0], corners[:, 1], corners[:, 2]
    return np.minimum(np.minimum(one, two), three), np.maximum(np.maximum(one, two), three)


def signed_angles(sides: ComplexArray) -> FloatArray:
    """Return (m, 3) the corner angles, radians, of triangles with sides (m, 3); negative where they are upside down."""
    angles = np.empty(sides.shape)
    for i in range(3):  # column by column: NumPy is slow at picking columns
        angles[:, i] = np.angle(-sides[:, NEXT[i]] * np.conj(sides[:, PREVIOUS[i]]))
    return angles


def heights(sides: ComplexArray) -> FloatArray:
    """Return (m,) height over longest side of triangles with sides (m, 3); negative for those upside down."""
    doubled = (np.conj(sides[:, 0]) * sides[:, 1]).imag
    squares = sides.real**2 + sides.imag**2
    longest = np.maximum(np.maximum(squares[:, 0], squares[:, 1]), squares[:, 2])
    ratio: FloatArray = doubled / np.maximum(longest, np.finfo(np.float64).tiny)
    return ratio


def sides_between(corners: FloatArray) -> ComplexArray:
    """Return (m, 3) the sides of triangles with corners (m, 3, 2)."""
    sides = np.empty(corners.shape)
    for i in range(3):
        np.subtract(corners[:, PREVIOUS[i]], corners[:, NEXT[i]], out=sides[:, i])
    return sides.view(np.complex128)[..., 0]


def map_factors(rest: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """Return (m, 3) the derivatives, by the places of the corners, of a and b in the map z -> a z + b conj(z).

    The map takes triangles from the shapes that they should have, of which `rest` (m, 3) has the sides, to the plane.
    Its singular values are |a| + |b| and |a| - |b|. Of triangles without area there is none: not numbers.
    """
    r0, r1 = rest[:, 0], rest[:, 1]
    area = r0 * np.conj(r1) - np.conj(r0) * r1
    found = []
    with np.errstate(divide="ignore", invalid="ignore"):
        for c0, c1 in ((np.conj(r1) / area, -np.conj(r0) / area), (-r1 / area, r0 / area)):
            # Side 0 runs from corner 1 to corner 2, side 1 from corner 2 to corner 0.
            found.append(np.stack([c1, -c0, c0 - c1], axis=1))
    return found[0], found[1]
