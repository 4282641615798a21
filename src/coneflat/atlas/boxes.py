"""Bounding boxes of triangles in the plane, and a tree of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .._arrays import FloatArray, IntArray

# By how much coordinates of up to 1 may be off once they are turned.
ROUNDED = 2.0**-48
# Boxes are turned if that leaves less than this part of their areas.
SNUG = 0.5


def bounding_boxes(corners: FloatArray) -> FloatArray:
    """Return (m, 4) x0, y0, -x1, -y1 of triangles (m, 3, 2): the box around several is their minimum."""
    one, two, three = corners[:, 0], corners[:, 1], corners[:, 2]
    low = np.minimum(np.minimum(one, two), three)
    high = np.maximum(np.maximum(one, two), three)
    return np.concatenate([low, -high], axis=1)


def snug_boxes(corners: FloatArray) -> FloatArray:
    """Return (m, 4) bounding boxes as above, along the axes or along the sides of long triangles askew to them.

    Boxes of the latter kind are larger by what rounding may have taken. corners: (m, 3, 2), none of them above 1.
    """
    straight = bounding_boxes(corners)
    places = corners @ np.array([1, 1j])
    sides = places[:, [1, 2, 0]] - places
    turned = places * np.exp(-0.5j * np.angle((sides**2).sum()))
    askew = bounding_boxes(np.stack([turned.real, turned.imag], axis=2)) - ROUNDED
    return askew if _areas(askew).sum() < SNUG * _areas(straight).sum() else straight


def _areas(boxes: FloatArray) -> FloatArray:
    areas: FloatArray = (boxes[:, 0] + boxes[:, 2]) * (boxes[:, 1] + boxes[:, 3])
    return areas


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
