"""Areas, quasi-conformal distortion and angles of the triangles of a map, in compiled loops."""

from __future__ import annotations

import math

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..base.jit import compiled

ZERO_AREA = 1e-12  # twice the area over the longest side squared; smaller ones are rounding errors


@compiled
def measure_triangles(
    vertices: FloatArray, faces: IntArray, corner_uv: FloatArray
) -> tuple[FloatArray, BoolArray, FloatArray, BoolArray, FloatArray]:
    """Return the areas of triangles on the model and in the plane, and their QC distortion.

    Args:
        vertices: (n, 3) positions.
        faces: (m, 3).
        corner_uv: (m, 3, 2).

    Returns:
        Five arrays (m,): twice the area on the model, whether it is nonzero, twice the signed area in the plane,
        whether it is nonzero, and QC, the ratio of the singular values of the map, NaN where one of the areas is zero.
    """
    count = len(faces)
    area, uv_area, ratio = np.empty(count), np.empty(count), np.empty(count)
    has_area, has_uv_area = np.empty(count, np.bool_), np.empty(count, np.bool_)
    first, second, normal = np.empty(3), np.empty(3), np.empty(3)
    for f in range(count):
        along, inner, across, opposite = 0.0, 0.0, 0.0, 0.0
        for x in range(3):
            start = vertices[faces[f, 0], x]
            first[x], second[x] = vertices[faces[f, 1], x] - start, vertices[faces[f, 2], x] - start
            along += first[x] * first[x]
            inner += first[x] * second[x]
            across += second[x] * second[x]
            opposite += (second[x] - first[x]) ** 2
        square = 0.0
        for x in range(3):
            y, z = (x + 1) % 3, (x + 2) % 3
            normal[x] = first[y] * second[z] - first[z] * second[y]
            square += normal[x] * normal[x]
        area[f] = math.sqrt(square)
        has_area[f] = area[f] > ZERO_AREA * max(along, across, opposite)
        u1, v1 = corner_uv[f, 1, 0] - corner_uv[f, 0, 0], corner_uv[f, 1, 1] - corner_uv[f, 0, 1]
        u2, v2 = corner_uv[f, 2, 0] - corner_uv[f, 0, 0], corner_uv[f, 2, 1] - corner_uv[f, 0, 1]
        uv_area[f] = u1 * v2 - v1 * u2
        longest = max(u1 * u1 + v1 * v1, u2 * u2 + v2 * v2, (u2 - u1) ** 2 + (v2 - v1) ** 2)
        has_uv_area[f] = abs(uv_area[f]) > ZERO_AREA * longest
        ratio[f] = np.nan
        if has_area[f] and has_uv_area[f]:
            # (x1, y1) and (x2, y2) are the images of two orthonormal vectors, the first along the first side.
            base = math.sqrt(along)
            height = area[f] / base
            x1, y1 = u1 / base, v1 / base
            x2, y2 = (u2 - x1 * inner / base) / height, (v2 - y1 * inner / base) / height
            larger = (math.hypot(x1 + y2, y1 - x2) + math.hypot(x1 - y2, y1 + x2)) / 2
            # The smaller singular value follows from the determinant; a difference would suffer from cancellation.
            smaller = abs(uv_area[f]) / area[f] / larger
            ratio[f] = max(larger / smaller, 1.0)
    return area, has_area, uv_area, has_uv_area, ratio


@compiled
def sum_angles(faces: IntArray, corner_uv: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Return (n,) the sum of the angles around each vertex in the plane, and (n,) its sensitivity to rounding.

    Angles are unsigned, so a vertex around which the triangles wind twice has 4 pi. Corners at a side of zero length
    have no angle. The sensitivity is in radians per unit of displacement of the points, infinite at such corners.

    Args:
        faces: (m, 3) indices of the vertices, or of other items for which angles are summed.
        corner_uv: (m, 3, 2).
        count: n.
    """
    sums, change = np.zeros(count), np.zeros(count)
    u, v, length = np.empty(3), np.empty(3), np.empty(3)
    for f in range(len(faces)):
        for i in range(3):  # the sides from each corner to the next
            u[i] = corner_uv[f, (i + 1) % 3, 0] - corner_uv[f, i, 0]
            v[i] = corner_uv[f, (i + 1) % 3, 1] - corner_uv[f, i, 1]
            length[i] = math.hypot(u[i], v[i])
            if length[i] > 0.0:
                # Unit vectors avoid underflow and overflow in the products.
                u[i], v[i] = u[i] / length[i], v[i] / length[i]
        for i in range(3):
            before = (i + 2) % 3
            change[faces[f, i]] += 1.0 / length[i] + 1.0 / length[before]
            if length[i] > 0.0 and length[before] > 0.0:
                across = u[i] * v[before] - v[i] * u[before]
                along = -(u[i] * u[before] + v[i] * v[before])
                sums[faces[f, i]] += abs(math.atan2(across, along))
    return sums, change
