"""Points and triangles of the plane, which may be upside down: column i of sides is the side opposite corner i."""

from __future__ import annotations

import numpy as np

from .._arrays import ComplexArray, FloatArray, IntArray
from ..compiled import compiled
from ..mesh import NEXT, PREVIOUS


def as_complex(places: FloatArray) -> ComplexArray:
    """Return (k,) points x + i y, given as (k, 2)."""
    points: ComplexArray = places[:, 0] + 1j * places[:, 1]
    return points


def as_pairs(points: ComplexArray) -> FloatArray:
    """Return (k, 2) points, given as (k,) x + i y."""
    return np.stack([points.real, points.imag], axis=1)


def signed_double_areas(corners: FloatArray) -> FloatArray:
    """Return (m,) twice the area of triangles with corners (m, 3, 2), negative where these run clockwise."""
    areas = np.empty(len(corners))
    fill_double_areas(np.ascontiguousarray(corners, dtype=np.float64), areas)
    return areas


def bounds(corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (m, 2) the least and the largest coordinates of triangles with corners (m, 3, 2)."""
    low, high = np.empty((2, len(corners), 2))
    points = np.ascontiguousarray(corners, dtype=np.float64).reshape(-1, 2)
    every = np.arange(len(corners))
    fill_bounds(points, np.arange(len(points)).reshape(-1, 3), every, low, high)
    return low, high


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


@compiled
def fill_double_areas(corners: FloatArray, areas: FloatArray) -> None:
    """Fill in (m,) twice the area of triangles with corners (m, 3, 2), negative where these run clockwise."""
    for f in range(len(corners)):
        x, y = corners[f, 0, 0], corners[f, 0, 1]
        areas[f] = (corners[f, 1, 0] - x) * (corners[f, 2, 1] - y) - (corners[f, 1, 1] - y) * (
            corners[f, 2, 0] - x
        )


@compiled
def fill_bounds(
    points: FloatArray, corners: IntArray, chosen: IntArray, low: FloatArray, high: FloatArray
) -> None:
    """Write the least and the largest coordinates of chosen triangles to (m, 2), at their own places there.

    points: (u, 2). corners: (m, 3) indices of points.
    """
    for f in chosen:
        for x in range(2):
            one, two, three = points[corners[f, 0], x], points[corners[f, 1], x], points[corners[f, 2], x]
            low[f, x], high[f, x] = min(one, two, three), max(one, two, three)
