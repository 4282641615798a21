"""Polygons, and the triangles that they fall into."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.arrays import BoolArray, IntArray

#: Names of the properties that are a vertex's colour.
COLOURS = ("red", "green", "blue")


@dataclass(frozen=True, eq=False)
class Polygons:
    """The polygons that triangles make up.

    Attributes:
        offsets: (p + 1,) the corners of polygon i are numbered from offsets[i] to offsets[i + 1].
        corners: (m, 3) the polygon's corner at each triangle corner.
    """

    offsets: IntArray
    corners: IntArray

    @property
    def sizes(self) -> IntArray:
        """(p,) corners of each polygon."""
        return np.diff(self.offsets)

    @property
    def owner(self) -> IntArray:
        """(m,) the polygon of each triangle."""
        return polygon_of(self.corners, self.offsets)

    @property
    def is_reversed(self) -> BoolArray:
        """(p,) True for polygons whose triangles run the other way."""
        a, b, c = self.corners.T
        reversed_ = np.zeros(len(self.offsets) - 1, dtype=bool)
        # Corners of a triangle that runs the polygon's way ascend but for one step back.
        reversed_[self.owner] = (b < a).astype(np.int8) + (c < b) + (a < c) == 2
        return reversed_

    def loops(self) -> IntArray:
        """Return (c,) the corners of each polygon, from its first on, in the order in which its triangles run."""
        sizes = self.sizes
        start, size = np.repeat(self.offsets[:-1], sizes), np.repeat(sizes, sizes)
        step = np.arange(len(start)) - start
        loops: IntArray = start + np.where(np.repeat(self.is_reversed, sizes), (size - step) % size, step)
        return loops

    def points(self, uv_faces: IntArray) -> IntArray:
        """Return (c,) the point at each polygon corner; -1 where triangles have several there, or where there is none.

        uv_faces: (m, 3) the point of each triangle corner.
        """
        points = np.full(int(self.offsets[-1]), -1, dtype=np.int64)
        points[self.corners] = uv_faces
        points[self.corners[points[self.corners] != uv_faces]] = -1
        return points

    def are_whole(self, points: IntArray) -> BoolArray:
        """Return (p,) whether all triangles of a polygon are there, and none is cut off in the plane.

        points: (c,) what `points` returns.
        """
        counts = np.bincount(self.owner, minlength=len(self.sizes))
        complete: BoolArray = (counts == self.sizes - 2) & np.logical_and.reduceat(
            points >= 0, self.offsets[:-1]
        )
        return complete

    def corner_triples(self, points: IntArray) -> tuple[IntArray, IntArray]:
        """Return (k, 3) the points before, at and after each corner of whole polygons of four corners and more.

        Triples run as the triangles do. Also (k,) the polygon of each.

        points: (c,) what `points` returns.
        """
        sizes, loops = self.sizes, self.loops()
        polygon = np.repeat(np.arange(len(sizes)), sizes)
        place = np.flatnonzero((self.are_whole(points) & (sizes > 3))[polygon])
        polygon = polygon[place]
        start, size = self.offsets[polygon], sizes[polygon]
        before, after = start + (place - start - 1) % size, start + (place - start + 1) % size
        return points[loops[np.stack([before, place, after], axis=1)]], polygon


def fan_corners(offsets: IntArray) -> IntArray:
    """Return (m, 3) the corners of the triangles that polygons fall into, all from the first corner of each.

    offsets: (p + 1,) where the corners of each polygon begin.
    """
    counts = np.diff(offsets) - 2
    first = np.repeat(offsets[:-1], counts)
    step = np.arange(len(first)) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.stack([first, first + step + 1, first + step + 2], axis=1)


def polygon_of(face_corners: IntArray, offsets: IntArray) -> IntArray:
    """Return (m,) the polygon that each triangle is a part of.

    Args:
        face_corners: (m, 3) polygon corner at each triangle corner.
        offsets: (p + 1,) where the corners of each polygon begin.
    """
    polygon: IntArray = np.searchsorted(offsets, face_corners[:, 0], side="right") - 1
    return polygon


def first_bad_corner(corners: IntArray, vertex_count: int) -> int | None:
    """Return the first of (c,) corners that names no vertex, if any does."""
    if corners.min(initial=0) >= 0 and corners.max(initial=-1) < vertex_count:
        return None
    return int(np.argmax((corners < 0) | (corners >= vertex_count)))
