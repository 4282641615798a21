"""Rasterisation of triangles: which face, at which depth, covers the centre of every pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import BoolArray, FloatArray, IntArray


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
    from ...geometry.raster import fill_nearest

    face = np.full((height, width), -1, dtype=np.int64)
    depth = np.full((height, width), np.inf)
    points, faces = np.ascontiguousarray(points, np.float64), np.ascontiguousarray(faces, np.int64)
    fill_nearest(points, faces, depth, face)
    return Coverage(face, depth)


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
