"""The sides of triangles in the plane that no others cancel: the outline of what they cover."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .._arrays import ComplexArray, IntArray
from ..compiled import compiled
from ..mesh import NEXT


def cancel_sides(sides: ComplexArray, chart: IntArray) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return which sides of triangles have the same ends, and how often they run one direction more than the other.

    Args:
        sides: (s, 2) start and end of each.
        chart: (s,) sides of different charts are different.

    Returns:
        (s,) the first side with the same ends, in either order; and (s,) of each such side how often it is there as
        it runs less how often against it, 0 where they cancel.
    """
    sides = np.ascontiguousarray(sides) + 0.0  # no -0.0: it has other bits
    table = np.full(2 ** (2 * max(len(sides), 1) - 1).bit_length(), -1, dtype=np.int32)
    same, balance = np.empty((2, len(sides)), dtype=np.int32)
    match_sides(sides.view(np.uint64).reshape(-1, 2), chart, table, same, balance)
    return same, balance


def triangle_sides(corners: ComplexArray) -> ComplexArray:
    """Return (3m, 2) start and end of the sides of triangles with corners (m, 3): side i begins at corner i."""
    sides: ComplexArray = np.stack([corners, corners[:, NEXT]], axis=2).reshape(-1, 2)
    return sides


@compiled
def match_sides(
    bits: NDArray[np.uint64],
    chart: IntArray,
    table: NDArray[np.int32],
    same: NDArray[np.int32],
    balance: NDArray[np.int32],
) -> None:
    """Find the sides of a chart that have the same ends, by a table of the sides seen so far.

    Args:
        bits: (2s, 2) of the coordinates of the ends, start and end of each side.
        chart: (s,) chart of each side.
        table: 2^p numbers, at least twice as many as sides, all -1; overwritten.
        same: (s,) filled: the first side with the same ends, in either order.
        balance: (s,) filled: of each such side, how often it is there as it runs less how often against it.
    """
    mask = np.uint64(len(table) - 1)
    for side in range(len(chart)):
        start, end = 2 * side, 2 * side + 1
        # The hash must not depend on the order of the ends.
        key = _mixed(_hash(bits[start]) + _hash(bits[end]) + np.uint64(chart[side]))
        balance[side] = 0
        while True:
            slot = np.int64(key & mask)
            other = table[slot]
            if other < 0:
                table[slot] = other = side
            other_start, other_end = 2 * other, 2 * other + 1
            if chart[other] == chart[side]:
                if _equal(bits, start, other_start) and _equal(bits, end, other_end):
                    same[side] = other
                    balance[other] += 1
                    break
                if _equal(bits, start, other_end) and _equal(bits, end, other_start):
                    same[side] = other
                    balance[other] -= 1
                    break
            key += np.uint64(1)


@compiled
def _equal(bits: NDArray[np.uint64], one: int, two: int) -> bool:
    return bool(bits[one, 0] == bits[two, 0] and bits[one, 1] == bits[two, 1])


@compiled
def _hash(point: NDArray[np.uint64]) -> np.uint64:
    return _mixed(_mixed(point[0]) + point[1])


@compiled
def _mixed(bits: np.uint64) -> np.uint64:
    """Return 64 bits, each of which depends on all given: products with odd numbers carry up, shifts carry down."""
    bits = (bits ^ (bits >> np.uint64(32))) * np.uint64(0x9E3779B97F4A7C15)
    bits = (bits ^ (bits >> np.uint64(29))) * np.uint64(0xD6E8FEB86659FD93)
    return bits ^ (bits >> np.uint64(32))
