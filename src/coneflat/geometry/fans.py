"""A test for disjoint triangles among thousands around one point, by their angles around it.

The bounding boxes of all such triangles in a quadrant intersect, so boxes cannot separate them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..base.arrays import FloatArray, IntArray
from ..base.jit import compiled
from ..mesh.connectivity import NEXT, PREVIOUS

# Number of corners at one point from which the angles are used; for fewer triangles, testing all pairs is fast enough.
MIN_CORNERS = 500
# Upper bound of the rounding error of angles (radians) and rotated coordinates, for coordinates of up to 1.
ANGLE_ROUNDING = 2.0**-46


@dataclass(frozen=True, eq=False)
class Fans:
    """Fans of triangles: the triangles around points where many of them meet.

    Attributes:
        numbers: (m,) the fan of each triangle, -1 for triangles in no fan.
        angles: (m, 2) the angles at which each triangle starts and ends around the point of its fan, counterclockwise,
            radians, from -pi to 2 pi. Undefined for triangles in no fan.
    """

    numbers: IntArray
    angles: FloatArray

    def sorted(self, order: IntArray) -> IntArray:
        """Return an order of the triangles in which those of each fan are consecutive and sorted by angle."""
        return np.lexsort((np.where(self.numbers < 0, np.argsort(order), self.angles[:, 0]), self.numbers))

    def tree(self, order: IntArray, leaves: int) -> tuple[IntArray, FloatArray]:
        """Return the fan and the range of angles of each node of a binary tree over the triangles in an order.

        Nodes are numbered as in `box_tree`. Nodes with triangles of several fans, or of none, have the fan -1.

        Args:
            order: (m,) the triangles of the first leaves.
            leaves: number of leaves, a power of two.

        Returns:
            (2 leaves - 1,) fans and (2 leaves - 1, 2) angles.
        """
        numbers = np.full(2 * leaves - 1, -1, dtype=np.int64)
        angles = np.zeros((2 * leaves - 1, 2))
        numbers[leaves - 1 : leaves - 1 + len(order)] = self.numbers[order]
        angles[leaves - 1 : leaves - 1 + len(order)] = self.angles[order]
        while leaves > 1:
            below = slice(leaves - 1, 2 * leaves - 1)
            leaves //= 2
            parents = slice(leaves - 1, 2 * leaves - 1)
            left, right = numbers[below][::2], numbers[below][1::2]
            numbers[parents] = np.where(left == right, left, -1)
            begins, ends = angles[below].T
            angles[parents, 0] = np.minimum(begins[::2], begins[1::2])
            angles[parents, 1] = np.maximum(ends[::2], ends[1::2])
        return numbers, angles


def find_fans(corners: FloatArray) -> Fans | None:
    """Return the fans of counterclockwise triangles (m, 3, 2) with coordinates of up to 1; None if there is none."""
    if len(corners) < MIN_CORNERS:
        return None
    places = corners.reshape(-1, 2) + 0.0  # -0.0 becomes 0.0
    # Points are counted by hash values of all of their bits: equal points have equal values, others seldom do.
    x, y = places.view(np.uint64).T
    mixed = x * np.uint64(0x9E3779B97F4A7C15) + y * np.uint64(0xC2B2AE3D27D4EB4F)
    mixed = (mixed ^ (mixed >> np.uint64(29))) * np.uint64(0xBF58476D1CE4E5B9)
    hashed = (mixed >> np.uint64(64 - len(places).bit_length())).astype(np.int64)
    counts = np.bincount(hashed)
    if counts.max() < MIN_CORNERS:
        return None
    points = places.view(np.complex128)[:, 0]
    suspected = np.flatnonzero((counts >= MIN_CORNERS)[hashed])
    _, number, count = np.unique(points[suspected], return_inverse=True, return_counts=True)
    is_many = count[number.ravel()] >= MIN_CORNERS
    suspected, number = suspected[is_many], number.ravel()[is_many]
    if not len(suspected):
        return None
    triangles, first = np.unique(suspected // 3, return_index=True)
    numbers = np.full(len(corners), -1, dtype=np.int64)
    numbers[triangles] = number[first]
    angles = np.zeros((len(corners), 2))
    apex = suspected[first] % 3
    at = points.reshape(-1, 3)
    leading, trailing = (at[triangles, step[apex]] - at[triangles, apex] for step in (NEXT, PREVIOUS))
    angles[triangles, 0] = np.angle(leading)
    angles[triangles, 1] = np.angle(leading) + np.angle(leading.conj() * trailing)
    return Fans(numbers, angles)


@compiled
def are_disjoint(numbers: IntArray, angles: FloatArray, i: int, j: int) -> bool:
    """Return whether the triangles of two nodes are in one fan with disjoint angles, so that interiors are disjoint."""
    if numbers[i] < 0 or numbers[i] != numbers[j]:
        return False
    for turn in range(-1, 2):
        begin, end = angles[j, 0] + turn * math.tau, angles[j, 1] + turn * math.tau
        if begin < angles[i, 1] + ANGLE_ROUNDING and end > angles[i, 0] - ANGLE_ROUNDING:
            return False
    return True
