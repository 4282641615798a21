"""Angle sums and cotangents of a scaled metric, compiled."""

from __future__ import annotations

import math

from .._arrays import FloatArray, IntArray
from ..geometry.compiled import compiled


@compiled
def add_angles(
    i: int, j: int, k: int, a: float, b: float, c: float, angle_sum: FloatArray
) -> tuple[bool, float, float, float, float]:
    """Add the angles of a triangle with sides a, b, c opposite i, j, k to the sums there.

    Where the triangle inequality is broken they are pi and 0, pi opposite the side that is too long. Returns whether it
    is, four times the area, and the cotangents at i, j, k; these are 0 then.
    """
    slack_a = min(b, c) - (a - max(b, c))
    slack_b = min(c, a) - (b - max(c, a))
    slack_c = min(a, b) - (c - max(a, b))
    if min(slack_a, slack_b, slack_c) <= 0.0:
        wide = i if slack_a <= 0.0 else (j if slack_b <= 0.0 else k)
        angle_sum[wide] += math.pi
        return True, 0.0, 0.0, 0.0, 0.0
    perimeter = a + b + c
    root = math.sqrt(perimeter * slack_a * slack_b * slack_c)
    angle_i = 2 * math.atan2(root, perimeter * slack_a)
    angle_j = 2 * math.atan2(root, perimeter * slack_b)
    angle_sum[i] += angle_i
    angle_sum[j] += angle_j
    angle_sum[k] += math.pi - angle_i - angle_j  # a third of the time less, and as exact as their sum is
    return (
        False,
        root,
        (perimeter * slack_a - slack_b * slack_c) / (2 * root),
        (perimeter * slack_b - slack_c * slack_a) / (2 * root),
        (perimeter * slack_c - slack_a * slack_b) / (2 * root),
    )


@compiled
def sum_angles(
    tail: IntArray, length: FloatArray, scale: FloatArray, angle_sum: FloatArray, cots: FloatArray
) -> int:
    """Fill the angle sum at each vertex and the cotangent opposite each half-edge.

    A side from i to j has the length length * scale_i * scale_j. Where the triangle inequality is broken the
    angles are those of the convex extension (Springborn, Schroeder, Pinkall 2008, Section 5.1): pi opposite
    the side that is too long, 0 at the others, and no cotangents. Returns the number of broken triangles.
    """
    broken = 0
    angle_sum[:] = 0.0
    for h in range(0, len(tail), 3):
        # The corner opposite side i is at the tail of side i + 2.
        j, k, i = tail[h], tail[h + 1], tail[h + 2]
        a = length[h] * scale[j] * scale[k]
        b = length[h + 1] * scale[k] * scale[i]
        c = length[h + 2] * scale[i] * scale[j]
        largest = max(a, b, c)
        a /= largest
        b /= largest
        c /= largest
        is_broken, _, cots[h], cots[h + 1], cots[h + 2] = add_angles(i, j, k, a, b, c, angle_sum)
        broken += is_broken
    return broken


@compiled
def find_negative_weights(twin: IntArray, cots: FloatArray, found: IntArray) -> int:
    """Write a half-edge of each edge whose cotangents sum to less than 0, so is not Delaunay; return their number."""
    count = 0
    for h in range(len(twin)):
        t = twin[h]
        # The margin is the rounding of the cotangents; the test that decides on a flip has its own.
        if t > h and cots[h] + cots[t] < -1e-13 * (abs(cots[h]) + abs(cots[t])):
            found[count] = h
            count += 1
    return count
