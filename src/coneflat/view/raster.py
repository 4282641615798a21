"""Rasterisation of triangles: which face, at which depth, covers the centre of every pixel."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import BoolArray, FloatArray, IntArray

FRAGMENTS_PER_CHUNK = 200_000
"""About how many covered pixels are held at once: what caches hold. It does not change the result."""


@dataclass(frozen=True, eq=False)
class Coverage:
    """What a picture of h by w pixels sees; row 0 is at the top.

    Attributes:
        face: (h, w) the nearest face at the pixel's centre, -1 for the background.
        depth: (h, w) its depth there, infinite for the background.
    """

    face: IntArray
    depth: FloatArray

    @property
    def covered(self) -> BoolArray:
        """(h, w) whether the pixel shows a face."""
        return self.face >= 0


def rasterise(points: ArrayLike, faces: ArrayLike, width: int, height: int) -> Coverage:
    """Return the nearest face at every pixel centre.

    The spans of pixels are half open, so two triangles that share an edge leave neither a gap nor an
    overlap between them: the pixels of a tiled region are each counted once.

    Args:
        points: (n, 3) pixel x to the right, pixel y downwards, and depth away from the eye. The
            centre of pixel (row j, column i) lies at (i + 0.5, j + 0.5).
        faces: (m, 3) vertex indices, of either orientation.
        width, height: size of the picture in pixels.
    """
    points = np.asarray(points, dtype=np.float64)
    faces = np.asarray(faces, dtype=np.int64)
    face = np.full(width * height, -1, dtype=np.int64)
    depth = np.full(width * height, np.inf)
    corners = points[faces]
    gradient = _depth_gradient(corners)
    nearest, farthest = corners[:, :, 2].min(axis=1), corners[:, :, 2].max(axis=1)
    for chunk in _chunks(corners, height):
        pixel, owner = _fragments(corners[chunk], width, height)
        owner += chunk.start
        x, y = pixel % width + 0.5, pixel // width + 0.5
        first = corners[owner, 0]
        z = first[:, 2] + gradient[owner, 0] * (x - first[:, 0]) + gradient[owner, 1] * (y - first[:, 1])
        # In a triangle seen nearly edge on the gradient is mostly rounding error.
        z = np.clip(z, nearest[owner], farthest[owner])
        # Of faces at one depth the first counts, as it does from chunk to chunk.
        nearer = np.flatnonzero(z < depth[pixel])[::-1]
        pixel, owner, z = pixel[nearer], owner[nearer], z[nearer]
        # Of repeated indices an assignment keeps the last, so the nearest must come last.
        order = np.argsort(-z, kind="stable")
        depth[pixel[order]] = z[order]
        face[pixel[order]] = owner[order]
    return Coverage(face.reshape(height, width), depth.reshape(height, width))


class Barycentrics:
    """Barycentric coordinates in projected triangles."""

    def __init__(self, points: FloatArray, faces: IntArray) -> None:
        """Take points (n, 2 or 3) of the picture and faces (m, 3)."""
        p, q, r = np.moveaxis(points[faces, :2], 1, 0)
        total = _cross(q - p, r - p)
        total = np.where(total == 0.0, np.inf, total)[:, None]  # edge on, covered by rounding only
        # Per face once, per pixel a few products: pixels outnumber faces.
        turn = np.array([1.0, -1.0])
        self._slopes = np.hstack([(r - p)[:, ::-1] * turn, (p - q)[:, ::-1] * turn]) / total
        self._first = p

    def of(self, face: IntArray, column: IntArray, row: IntArray) -> FloatArray:
        """Return the (k, 3) coordinates of the centres of pixels (k,) in faces (k,)."""
        slopes, first = self._slopes[face], self._first[face]
        x, y = column + 0.5 - first[:, 0], row + 0.5 - first[:, 1]
        weights = np.empty((len(face), 3))
        weights[:, 1] = slopes[:, 0] * x + slopes[:, 1] * y
        weights[:, 2] = slopes[:, 2] * x + slopes[:, 3] * y
        weights[:, 0] = 1.0 - weights[:, 1] - weights[:, 2]
        return weights


def _cross(p: FloatArray, q: FloatArray) -> FloatArray:
    return np.asarray(p[..., 0] * q[..., 1] - p[..., 1] * q[..., 0])


def _depth_gradient(corners: FloatArray) -> FloatArray:
    """Return the (m, 2) change of depth per pixel to the right and downwards; 0 seen edge on."""
    p, q = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    total = _cross(p, q)
    total = np.where(total == 0.0, np.inf, total)
    right = (p[:, 2] * q[:, 1] - q[:, 2] * p[:, 1]) / total
    down = (q[:, 2] * p[:, 0] - p[:, 2] * q[:, 0]) / total
    return np.column_stack([right, down])


def _chunks(corners: FloatArray, height: int) -> Iterator[slice]:
    """Yield runs of faces whose bounding boxes hold about `FRAGMENTS_PER_CHUNK` pixels."""
    if not len(corners):
        return
    low, high = corners.min(axis=1), corners.max(axis=1)
    extent = np.ceil(high[:, :2] - low[:, :2]) + 1.0
    filled = np.cumsum(extent[:, 0] * np.minimum(extent[:, 1], height))
    bounds = np.flatnonzero(np.diff(filled // FRAGMENTS_PER_CHUNK)) + 1
    starts = [0, *bounds.tolist(), len(corners)]
    for start, stop in pairwise(starts):
        yield slice(start, stop)


def _fragments(corners: FloatArray, width: int, height: int) -> tuple[IntArray, IntArray]:
    """Return the pixels that the triangles cover, and for each the triangle (row in `corners`)."""
    first = _first_centre(corners[:, :, 1].min(axis=1), height)
    stop = _first_centre(corners[:, :, 1].max(axis=1), height)
    owner, row = _expand(first, stop)
    left, right = _crossings(corners[owner, :, :2], row.astype(np.float64) + 0.5)
    span, column = _expand(_first_centre(left, width), _first_centre(right, width))
    return row[span] * width + column, owner[span]


def _crossings(corners: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the least and greatest x at which each triangle's outline crosses its scan line y."""
    left = np.full(len(y), np.inf)
    right = np.full(len(y), -np.inf)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        p, q = corners[:, i], corners[:, j]
        # From the upper end to the lower in every triangle: both faces of an edge then round alike.
        down = (p[:, 1] <= q[:, 1])[:, None]
        upper, lower = np.where(down, p, q), np.where(down, q, p)
        crosses = (upper[:, 1] <= y) & (y < lower[:, 1])
        drop = np.where(crosses, lower[:, 1] - upper[:, 1], 1.0)
        x = upper[:, 0] + (y - upper[:, 1]) / drop * (lower[:, 0] - upper[:, 0])
        left = np.where(crosses, np.minimum(left, x), left)
        right = np.where(crosses, np.maximum(right, x), right)
    return left, right


def _first_centre(position: FloatArray, size: int) -> IntArray:
    """Return the first pixel whose centre is at `position` or beyond, within [0, size]."""
    return np.clip(np.ceil(position - 0.5), 0, size).astype(np.int64)


def _expand(start: IntArray, stop: IntArray) -> tuple[IntArray, IntArray]:
    """Return (i, k) for every i and every k in [start[i], stop[i])."""
    count = np.maximum(stop - start, 0)
    index = np.repeat(np.arange(len(start)), count)
    offset = np.arange(len(index)) - np.repeat(np.cumsum(count) - count, count)
    return index, start[index] + offset
