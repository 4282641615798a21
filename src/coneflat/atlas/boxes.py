"""Bounding boxes of triangles in the plane, and a tree of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .._arrays import FloatArray, IntArray


def bounding_boxes(corners: FloatArray) -> FloatArray:
    """Return (m, 4) x0, y0, -x1, -y1 of triangles (m, 3, 2): the box around several is their minimum."""
    one, two, three = corners[:, 0], corners[:, 1], corners[:, 2]
    low = np.minimum(np.minimum(one, two), three)
    high = np.maximum(np.maximum(one, two), three)
    return np.concatenate([low, -high], axis=1)


def z_order(boxes: FloatArray) -> IntArray:
    """Return the order of boxes along a Z-shaped curve through their centres (Morton 1966), so near ones are close.

    The cells of the curve are 2^-32 of the extent wide, so charts whose scale varies by e^8 and more are resolved.
    """
    centres = boxes[:, :2] - boxes[:, 2:]
    centres -= centres.min(axis=0)
    extent = centres.max()
    cells = (centres * ((2**32 - 1) / extent if extent > 0 else 0.0)).astype(np.uint64)
    order: IntArray = np.argsort(_spread(cells[:, 0]) | _spread(cells[:, 1]) << np.uint64(1), kind="stable")
    return order


def _spread(cells: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Put a zero bit before each of 32 bits."""
    for shift in (16, 8, 4, 2, 1):
        kept = np.uint64((2**64 - 1) // (2**shift + 1))  # runs of `shift` ones and as many zeros
        cells = (cells | cells << np.uint64(shift)) & kept
    return cells


def box_tree(boxes: FloatArray) -> FloatArray:
    """Return (2 k - 1, 4) the boxes, last, and those around them: node i has 2 i + 1 and 2 i + 2 below it.

    k is a power of two, and at least 2; the boxes that are missing are empty.
    """
    leaves = 2 ** max(1, (len(boxes) - 1).bit_length())
    tree = np.full((2 * leaves - 1, 4), np.inf)
    tree[leaves - 1 : leaves - 1 + len(boxes)] = boxes
    while leaves > 1:
        below = tree[leaves - 1 : 2 * leaves - 1]
        leaves //= 2
        np.minimum(below[::2], below[1::2], out=tree[leaves - 1 : 2 * leaves - 1])
    return tree
