"""Pairs of triangles whose interiors meet, compiled."""

from __future__ import annotations

from .._arrays import FloatArray, IntArray
from ..geometry.compiled import compiled
from .orientation_kernel import orientation


@compiled
def _boxes_meet(tree: FloatArray, i: int, j: int) -> bool:
    """Return whether two boxes (x0, y0, -x1, -y1) have inner points in common."""
    return (
        tree[i, 0] < -tree[j, 2]
        and tree[j, 0] < -tree[i, 2]
        and tree[i, 1] < -tree[j, 3]
        and tree[j, 1] < -tree[i, 3]
    )


@compiled
def _lies_outside(corners: FloatArray, one: int, two: int, parts: FloatArray) -> bool:
    """Return whether some side of triangle `one` has no corner of `two` to its left."""
    for i in range(0, 6, 2):
        px, py = corners[one, i], corners[one, i + 1]
        qx, qy = corners[one, (i + 2) % 6], corners[one, (i + 3) % 6]
        k = 0
        while k < 6 and orientation(px, py, qx, qy, corners[two, k], corners[two, k + 1], parts) <= 0:
            k += 2
        if k == 6:
            return True
    return False


@compiled
def join(
    tree: FloatArray, corners: FloatArray, parts: FloatArray, stack: IntArray, top: int, found: IntArray
) -> tuple[int, int]:
    """Fill in the pairs of triangles whose interiors meet, until there is no room left.

    Convex polygons have no inner point in common if and only if the line along a side of one of them has one on
    either side of it.

    Args:
        tree: (2 k - 1, 4) boxes: node i is above 2 i + 1 and 2 i + 2, the last k are the triangles' own.
        corners: (m, 6) of the triangles, counterclockwise.
        parts: (12,) room for exact sums.
        stack: (s, 2) pairs of nodes of one level, the lower first, to be searched yet: the first `top`.
        found: (p, 2) filled.

    Returns:
        The height of the stack, 0 at the end, and the number of pairs filled in.
    """
    first_leaf = len(tree) // 2
    count = 0
    while top > 0 and count < len(found):
        top -= 1
        i, j = stack[top]
        if i >= first_leaf:
            one, two = i - first_leaf, j - first_leaf
            if not _lies_outside(corners, one, two, parts) and not _lies_outside(corners, two, one, parts):
                found[count, 0] = one
                found[count, 1] = two
                count += 1
            continue
        for a in range(2 * i + 1, 2 * i + 3):
            for b in range(2 * j + 1, 2 * j + 3):
                if (a == b and a < first_leaf) or (a < b and _boxes_meet(tree, a, b)):
                    stack[top, 0] = a
                    stack[top, 1] = b
                    top += 1
    return top, count
