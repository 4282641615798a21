"""Thousands of triangles around one point: which of them have no inner point in common, by their angles around it.

The boxes of all in a quarter of the plane meet, and so tell nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._arrays import FloatArray, IntArray
from ..compiled import compiled
from ..mesh import NEXT, PREVIOUS

TAU = 2 * np.pi
# Corners at one point from which on it is worth it; fewer triangles meet in few enough pairs.
MANY = 500
# Points are counted by this many bits that depend on all of theirs.
HASHED = 20
# By how much angles computed of coordinates up to 1 may be off, radians, and more.
ROUNDED = 2.0**-46


@dataclass(frozen=True, eq=False)
class Fans:
    """Triangles around points that many of them meet in.

    Attributes:
        numbers: (m,) the fan of each triangle, -1 for most.
        angles: (m, 2) where each begins and ends around the point of its fan, counterclockwise, radians; from
            -pi to 2 pi. Of no meaning for those in none.
    """

    numbers: IntArray
    angles: FloatArray

    def sorted(self, order: IntArray) -> IntArray:
        """Return an order of the triangles, but those of each fan one after the other as they lie around its point."""
        rank = np.empty(len(order))
        rank[order] = np.arange(len(order))
        is_in_none = self.numbers < 0
        along: IntArray = np.lexsort((np.where(is_in_none, rank, self.angles[:, 0]), self.numbers))
        return along

    def tree(self, order: IntArray, leaves: int) -> tuple[IntArray, FloatArray]:
        """Return, for each node of a binary tree above the triangles in an order, the fan of all and their angles.

        Nodes are numbered as of `box_tree`; those above triangles of several fans, or of none, have -1.
        """
        numbers = np.full(2 * leaves - 1, -1, dtype=np.int64)
        angles = np.zeros((2 * leaves - 1, 2))
        numbers[leaves - 1 : leaves - 1 + len(order)] = self.numbers[order]
        angles[leaves - 1 : leaves - 1 + len(order)] = self.angles[order]
        while leaves > 1:
            below = slice(leaves - 1, 2 * leaves - 1)
            leaves //= 2
            own, left, right = slice(leaves - 1, 2 * leaves - 1), numbers[below][::2], numbers[below][1::2]
            numbers[own] = np.where(left == right, left, -1)
            begins, ends = angles[below].T
            angles[own, 0] = np.minimum(begins[::2], begins[1::2])
            angles[own, 1] = np.maximum(ends[::2], ends[1::2])
        return numbers, angles


def find_fans(corners: FloatArray) -> Fans | None:
    """Return the fans of many triangles (m, 3, 2), counterclockwise, coordinates up to 1; None if there is none."""
    if len(corners) < MANY:
        return None
    points = (corners.reshape(-1, 2) + 0.0) @ np.array([1, 1j])  # a zero has one sign
    hashed = _hashed(points)
    suspected = np.flatnonzero((np.bincount(hashed, minlength=1 << HASHED) >= MANY)[hashed])
    if not len(suspected):
        return None
    _, number, count = np.unique(points[suspected], return_inverse=True, return_counts=True)
    is_many = count[number.ravel()] >= MANY
    suspected, number = suspected[is_many], number.ravel()[is_many]
    if not len(suspected):
        return None
    triangles, first = np.unique(suspected // 3, return_index=True)
    numbers = np.full(len(corners), -1, dtype=np.int64)
    numbers[triangles] = number[first]
    angles = np.zeros((len(corners), 2))
    apex = suspected[first] % 3
    places = points.reshape(-1, 3)
    one, two = (places[triangles, step[apex]] - places[triangles, apex] for step in (NEXT, PREVIOUS))
    angles[triangles, 0] = np.angle(one)
    angles[triangles, 1] = np.angle(one) + np.angle(one.conj() * two)
    return Fans(numbers, angles)


def _hashed(points: FloatArray) -> IntArray:
    """Return numbers of few bits that are the same for the same points, and seldom for others."""
    bits = np.ascontiguousarray(points).view(np.uint64).reshape(-1, 2)
    mixed = bits[:, 0] * np.uint64(0x9E3779B97F4A7C15) + bits[:, 1] * np.uint64(0xC2B2AE3D27D4EB4F)
    mixed ^= mixed >> np.uint64(29)
    mixed *= np.uint64(0xBF58476D1CE4E5B9)
    return (mixed >> np.uint64(64 - HASHED)).astype(np.int64)


@compiled
def lie_apart(numbers: IntArray, angles: FloatArray, i: int, j: int) -> bool:
    """Return whether the triangles of two nodes are of one fan and of other angles: so no inner points are in both."""
    if numbers[i] < 0 or numbers[i] != numbers[j]:
        return False
    for turn in range(-1, 2):
        begin, end = angles[j, 0] + turn * TAU, angles[j, 1] + turn * TAU
        if begin < angles[i, 1] + ROUNDED and end > angles[i, 0] - ROUNDED:
            return False
    return True
