"""Polygons and their triangulations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.arrays import BoolArray, IntArray

#: Names of the properties that hold the colour of a vertex.
COLOURS = ("red", "green", "blue")


@dataclass(frozen=True, eq=False)
class Polygons:
    """Polygons that are split into triangles.

    Attributes:
        offsets: (p + 1,) the corners of polygon i have the numbers offsets[i] to offsets[i + 1] - 1.
        corners: (m, 3) the polygon corner at each triangle corner.
    """

    offsets: IntArray
    corners: IntArray

    @property
    def sizes(self) -> IntArray:
        """(p,) number of corners of each polygon."""
        return np.diff(self.offsets)

    @property
    def owner(self) -> IntArray:
        """(m,) the polygon of each triangle."""
        return polygon_of(self.corners, self.offsets)

    @property
    def is_reversed(self) -> BoolArray:
        """(p,) True for polygons whose triangles have the opposite orientation."""
        a, b, c = self.corners.T
        reversed_ = np.zeros(len(self.offsets) - 1, dtype=bool)
        # The corners of a triangle with the polygon's orientation ascend, except for one step back.
        reversed_[self.owner] = (b < a).astype(np.int8) + (c < b) + (a < c) == 2
        return reversed_

    def loops(self) -> IntArray:
        """Return (c,) the corners of each polygon, from its first, in the orientation of its triangles."""
        sizes = self.sizes
        start, size = np.repeat(self.offsets[:-1], sizes), np.repeat(sizes, sizes)
        step = np.arange(len(start)) - start
        return start + np.where(np.repeat(self.is_reversed, sizes), (size - step) % size, step)

    def points(self, uv_faces: IntArray) -> IntArray:
        """Return (c,) the point at each polygon corner; -1 if its triangles have several points there, or none.

        uv_faces: (m, 3) the point of each triangle corner.
        """
        points = np.full(int(self.offsets[-1]), -1, dtype=np.int64)
        points[self.corners] = uv_faces
        points[self.corners[points[self.corners] != uv_faces]] = -1
        return points

    def are_complete(self, points: IntArray) -> BoolArray:
        """Return (p,) whether a polygon has all its triangles, and no seam separates them in the plane.

        points: (c,) as returned by `points`.
        """
        counts = np.bincount(self.owner, minlength=len(self.sizes))
        is_whole = np.logical_and.reduceat(points >= 0, self.offsets[:-1])
        return np.asarray((counts == self.sizes - 2) & is_whole)

    def corner_triples(self, points: IntArray) -> tuple[IntArray, IntArray]:
        """Return (k, 3) the points before, at and after each corner of the complete polygons, and (k,) the polygon.

        Only polygons of four corners and more are included. Triples have the orientation of the triangles.

        points: (c,) as returned by `points`.
        """
        sizes, loops = self.sizes, self.loops()
        polygon = np.repeat(np.arange(len(sizes)), sizes)
        place = np.flatnonzero((self.are_complete(points) & (sizes > 3))[polygon])
        polygon = polygon[place]
        start, size = self.offsets[polygon], sizes[polygon]
        before, after = start + (place - start - 1) % size, start + (place - start + 1) % size
        return points[loops[np.stack([before, place, after], axis=1)]], polygon


def fan_corners(offsets: IntArray) -> IntArray:
    """Return (m, 3) the polygon corners of the triangles if each polygon is split into a fan around its first corner.

    offsets: (p + 1,) where the corners of each polygon start.
    """
    counts = np.diff(offsets) - 2
    first = np.repeat(offsets[:-1], counts)
    step = np.arange(len(first)) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.stack([first, first + step + 1, first + step + 2], axis=1)


def polygon_of(face_corners: IntArray, offsets: IntArray) -> IntArray:
    """Return (m,) the polygon that each triangle belongs to.

    Args:
        face_corners: (m, 3) polygon corner at each triangle corner.
        offsets: (p + 1,) where the corners of each polygon start.
    """
    return np.searchsorted(offsets, face_corners[:, 0], side="right") - 1


def first_bad_corner(corners: IntArray, vertex_count: int) -> int | None:
    """Return the index of the first of (c,) corners whose vertex does not exist, or None."""
    if corners.min(initial=0) >= 0 and corners.max(initial=-1) < vertex_count:
        return None
    return int(np.argmax((corners < 0) | (corners >= vertex_count)))
