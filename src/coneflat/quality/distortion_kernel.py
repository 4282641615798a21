"""Triangles and edges of a UV map, one by one: array expressions go through memory a dozen times for them."""

from __future__ import annotations

import math

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray
from ..compiled import compiled


@compiled
def measure_triangles(
    vertices: FloatArray, faces: IntArray, corner_uv: FloatArray, zero: float
) -> tuple[FloatArray, BoolArray, FloatArray, BoolArray, FloatArray]:
    """Return twice the area of triangles and whether they have any, the same in the plane, and their QC distortion.

    Args:
        vertices: (n, 3) positions.
        faces: (m, 3).
        corner_uv: (m, 3, 2).
        zero: twice the area over the square of the longest side up to which there is none.

    Returns:
        (m,) each. Areas in the plane have a sign. QC is the ratio of the singular values of the map, NaN where one of
        the areas is none.
    """
    count = len(faces)
    area, uv_area, ratio = np.empty(count), np.empty(count), np.empty(count)
    has_area, has_uv_area = np.empty(count, np.bool_), np.empty(count, np.bool_)
    one, two, normal = np.empty(3), np.empty(3), np.empty(3)
    for f in range(count):
        along, inner, across, opposite = 0.0, 0.0, 0.0, 0.0
        for x in range(3):
            start = vertices[faces[f, 0], x]
            one[x], two[x] = vertices[faces[f, 1], x] - start, vertices[faces[f, 2], x] - start
            along += one[x] * one[x]
            inner += one[x] * two[x]
            across += two[x] * two[x]
            opposite += (two[x] - one[x]) ** 2
        square = 0.0
        for x in range(3):
            y, z = (x + 1) % 3, (x + 2) % 3
            normal[x] = one[y] * two[z] - one[z] * two[y]
            square += normal[x] * normal[x]
        area[f] = math.sqrt(square)
        has_area[f] = area[f] > zero * max(along, across, opposite)
        u1, v1 = corner_uv[f, 1, 0] - corner_uv[f, 0, 0], corner_uv[f, 1, 1] - corner_uv[f, 0, 1]
        u2, v2 = corner_uv[f, 2, 0] - corner_uv[f, 0, 0], corner_uv[f, 2, 1] - corner_uv[f, 0, 1]
        uv_area[f] = u1 * v2 - v1 * u2
        longest = max(u1 * u1 + v1 * v1, u2 * u2 + v2 * v2, (u2 - u1) ** 2 + (v2 - v1) ** 2)
        has_uv_area[f] = abs(uv_area[f]) > zero * longest
        ratio[f] = np.nan
        if has_area[f] and has_uv_area[f]:
            # The images of two orthonormal vectors, the first along the first side.
            base = math.sqrt(along)
            height = area[f] / base
            x1, y1 = u1 / base, v1 / base
            x2, y2 = (u2 - x1 * inner / base) / height, (v2 - y1 * inner / base) / height
            larger = (math.hypot(x1 + y2, y1 - x2) + math.hypot(x1 - y2, y1 + x2)) / 2
            # The smaller one from the determinant: their difference would cancel.
            smaller = abs(uv_area[f]) / area[f] / larger
            ratio[f] = max(larger / smaller, 1.0)
    return area, has_area, uv_area, has_uv_area, ratio


@compiled
def sum_angles(faces: IntArray, corner_uv: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Return (n,) the sum of the angles in the plane around each vertex, and by what a rounded point changes it.

    Angles are those of the triangles' shapes, whichever way these are turned, so a vertex that its triangles go
    around twice has 4 pi. Where a side has no length there is no angle. The change is in radians per unit that points
    are off by, infinite beside such a side.

    Args:
        faces: (m, 3) the vertices, or whatever else angles are to be summed up at.
        corner_uv: (m, 3, 2).
        count: n.
    """
    sums, change = np.zeros(count), np.zeros(count)
    for f in range(len(faces)):
        for i in range(3):
            at, one, two = corner_uv[f, i], corner_uv[f, (i + 1) % 3], corner_uv[f, (i + 2) % 3]
            u1, v1, u2, v2 = one[0] - at[0], one[1] - at[1], two[0] - at[0], two[1] - at[1]
            length1, length2 = math.hypot(u1, v1), math.hypot(u2, v2)
            change[faces[f, i]] += 1.0 / length1 + 1.0 / length2
            if length1 > 0.0 and length2 > 0.0:
                # Of sides of length one, lest products of tiny or huge ones are no numbers.
                u1, v1, u2, v2 = u1 / length1, v1 / length1, u2 / length2, v2 / length2
                sums[faces[f, i]] += abs(math.atan2(u1 * v2 - v1 * u2, u1 * u2 + v1 * v2))
    return sums, change
