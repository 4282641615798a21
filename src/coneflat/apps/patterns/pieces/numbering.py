"""The order of pieces and sides, which depends on the shape of the surface, not on its numbering; names by number."""

from __future__ import annotations

import numpy as np

from ....base import FloatArray, IntArray

# Relative difference of sizes up to which they are equal, so that positions decide on the order.
EQUAL = 1e-6
# Positions are ordered along this direction: by x, then by y, then by z unless they differ by much more.
DIRECTION = np.array([1.0, 1e-2, 1e-4])


def order_by_size(sizes: FloatArray, positions: FloatArray) -> IntArray:
    """Return (k,) the order of items: the largest first, those of equal size by position.

    Args:
        sizes: (k,) positive sizes.
        positions: (k, 3) their positions.
    """
    order = np.argsort(-sizes, kind="stable")
    descending = sizes[order]
    is_smaller = descending[1:] < (1 - EQUAL) * descending[:-1]
    group = np.empty(len(sizes), dtype=np.int64)
    group[order] = np.concatenate([[0], np.cumsum(is_smaller)])[: len(sizes)]
    return np.lexsort((positions @ DIRECTION, group))


def order_around(positions: FloatArray, axis: FloatArray) -> IntArray:
    """Return (k,) the order of positions (k, 3) around an axis (3,) through their mean."""
    upward = axis / np.linalg.norm(axis)
    # The first one is beside the coordinate axis that is farthest from the axis.
    right = np.eye(3)[np.abs(upward).argmin()]
    right = right - (right @ upward) * upward
    right /= np.linalg.norm(right)
    moved = positions - positions.mean(axis=0)
    angles = np.arctan2(moved @ np.cross(upward, right), moved @ right) % (2 * np.pi)
    return np.argsort(angles, kind="stable")


def letters(number: int) -> str:
    """Return A, B, ..., Z, AA, AB, ... for a number from 0."""
    name = ""
    while number >= 0:
        number, digit = divmod(number, 26)
        name, number = chr(ord("A") + digit) + name, number - 1
    return name
