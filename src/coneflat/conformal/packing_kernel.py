"""Angle sums of circle packings, and how they change with the radii, compiled."""

from __future__ import annotations

import math

from .._arrays import FloatArray, IntArray
from ..geometry.compiled import compiled
from .angle_kernel import add_angles


@compiled
def sum_packing_angles(
    tail: IntArray, inversive: FloatArray, radius: FloatArray, angle_sum: FloatArray, weights: FloatArray
) -> int:
    """Fill the angle sum at each vertex and twice the derivative of angles opposite each half-edge.

    With circles of radii g about the corners, raising log g_j turns the angle at i by h_k / l_k, where h_k is the
    height of the radical centre over the side between them (Guo 2011; Glickenstein 2011):

        2 h_k / l_k = cot a_k + (g_i^2 cot a_j + g_j^2 cot a_i) / l_k^2 - g_k^2 / (2 A)

    Where the triangle inequality is broken the angles are pi and 0, as in the convex extension of the energy
    (Luo, "Rigidity of polyhedral surfaces III", 2011), and there are no weights. Returns the number of broken
    triangles.
    """
    broken = 0
    angle_sum[:] = 0.0
    for h in range(0, len(tail), 3):
        # The corner opposite side i is at the tail of side i + 2.
        j, k, i = tail[h], tail[h + 1], tail[h + 2]
        largest = max(radius[i], radius[j], radius[k])
        gi, gj, gk = radius[i] / largest, radius[j] / largest, radius[k] / largest
        a = math.sqrt(gj * gj + gk * gk + 2 * inversive[h] * (gj * gk))
        b = math.sqrt(gk * gk + gi * gi + 2 * inversive[h + 1] * (gk * gi))
        c = math.sqrt(gi * gi + gj * gj + 2 * inversive[h + 2] * (gi * gj))
        is_broken, root, cot_i, cot_j, cot_k = add_angles(i, j, k, a, b, c, angle_sum)
        if is_broken:
            broken += 1
            weights[h] = weights[h + 1] = weights[h + 2] = 0.0
            continue
        gi, gj, gk = gi * gi, gj * gj, gk * gk
        weights[h] = cot_i + (gj * cot_k + gk * cot_j) / (a * a) - 2 * gi / root
        weights[h + 1] = cot_j + (gk * cot_i + gi * cot_k) / (b * b) - 2 * gj / root
        weights[h + 2] = cot_k + (gi * cot_j + gj * cot_i) / (c * c) - 2 * gk / root
    return broken
