"""Polygons to write to a file: unchanged if they are convex in the plane, otherwise split into convex pieces.

Readers split polygons into triangles, mostly into fans. For a convex polygon, the triangles of every fan are positively
oriented.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..geometry.planar import heights, sides_between
from ..mesh.polygons import Polygons, fan_corners

# Minimum ratio of height to longest side of the triangle at a convex corner. It is above the rounding errors of areas,
# which are about 1e-16.
CONVEX_HEIGHT = 1e-12

Node: TypeAlias = tuple[int, int]
Loop: TypeAlias = list[Node]


@dataclass(frozen=True, eq=False)
class Pieces:
    """Polygons to write, in the order of those of the source.

    Attributes:
        corners: (c,) corner of the source for each corner to write, polygon after polygon.
        points: (c,) point in the plane of each corner.
        sizes: (q,) number of corners of each polygon to write.
        polygons: (q,) the polygon of the source that each is, or is a piece of.
        split: (s,) polygons of the source that are written in pieces since they are not convex in the plane.
    """

    corners: IntArray
    points: IntArray
    sizes: IntArray
    polygons: IntArray
    split: IntArray

    def fans(self) -> tuple[IntArray, IntArray]:
        """Return the fan triangles of the polygons: (t, 3) corners of the source, and (t, 3) points in the plane."""
        rows = fan_corners(np.concatenate([[0], np.cumsum(self.sizes)]))
        return self.corners[rows], self.points[rows]


def find_pieces(uv: FloatArray, uv_faces: IntArray, offsets: IntArray, face_corners: IntArray) -> Pieces:
    """Return the polygons to write; of polygons with removed triangles, the remaining pieces.

    Args:
        uv: (u, 2) points in the plane.
        uv_faces: (m, 3) the point of each triangle corner.
        offsets: (p + 1,) start of the corners of the source's polygons.
        face_corners: (m, 3) the source's corner at each triangle corner.
    """
    polygons = Polygons(offsets, face_corners)
    points, sizes, loops = polygons.points(uv_faces), polygons.sizes, polygons.loops()
    triples, at = polygons.corner_triples(points)
    complete = polygons.are_complete(points)
    height = heights(sides_between(uv[triples]))
    # A polygon that is flipped as a whole stays flipped in fans and in pieces, so it is not split.
    split = np.intersect1d(at[~(height > CONVEX_HEIGHT)], at[~(height < -CONVEX_HEIGHT)])
    complete[split] = False
    if complete.all():
        return Pieces(loops, points[loops], sizes, np.arange(len(sizes)), split)
    kept = np.repeat(complete, sizes)
    intact = (loops[kept], points[loops[kept]], sizes[complete], np.flatnonzero(complete))
    parts = _convex_parts(uv, uv_faces, face_corners, polygons.owner, ~complete)
    corners, flat, counts, names = map(np.concatenate, zip(intact, parts, strict=True))
    order = np.argsort(names, kind="stable")
    rows = np.argsort(np.repeat(names, counts), kind="stable")
    return Pieces(corners[rows], flat[rows], counts[order], names[order], split)


def _convex_parts(
    uv: FloatArray, uv_faces: IntArray, face_corners: IntArray, owner: IntArray, chosen: BoolArray
) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """Return the remaining triangles of the chosen polygons as convex pieces: the first four attributes of `Pieces`."""
    faces = np.flatnonzero(chosen[owner])
    faces = faces[np.argsort(owner[faces], kind="stable")]
    names, first = np.unique(owner[faces], return_index=True)
    pieces, polygons = [], []
    # Some of the polygons, or all of them, may have no remaining triangles.
    for name, members in zip(names.tolist(), np.split(faces, first)[1:], strict=True):
        corners = np.stack([face_corners[members], uv_faces[members]], axis=2).tolist()
        loops = merge_convex(uv, [[(c, p) for c, p in triangle] for triangle in corners])
        pieces += loops
        polygons += [name] * len(loops)
    rows = np.array([node for loop in pieces for node in loop], dtype=np.int64).reshape(-1, 2)
    sizes = np.array([len(loop) for loop in pieces], dtype=np.int64)
    return rows[:, 0], rows[:, 1], sizes, np.array(polygons, dtype=np.int64)


def merge_convex(uv: FloatArray, loops: list[Loop]) -> list[Loop]:
    """Return loops merged across their common sides, one after the other, where the result is convex.

    The number of pieces is at most four times the minimum (Hertel and Mehlhorn 1983). Each begins with its smallest
    corner.

    Args:
        uv: (u, 2) points in the plane.
        loops: for each triangle the corners of the source with their points, in its orientation.
    """
    owner = {side: i for i, loop in enumerate(loops) for side in _sides(loop)}
    merged = dict(enumerate(loops))
    for a, b in [(a, b) for a, b in owner if a < b and (b, a) in owner]:
        here, there = owner[a, b], owner[b, a]
        if here == there:
            continue
        one, two = merged[here], merged[there]
        # The first loop traverses the common side from a to b, the second from b to a.
        i, j = one.index(b), two.index(a)
        joined = (one[i:] + one[:i]) + (two[j:] + two[:j])[1:-1]
        if _is_convex(uv, joined):
            merged[here] = joined
            del merged[there]
            for side in _sides(joined):
                owner[side] = here
    return sorted(loop[k:] + loop[:k] for loop in merged.values() for k in [loop.index(min(loop))])


def _sides(loop: Loop) -> list[tuple[Node, Node]]:
    return list(zip(loop, loop[1:] + loop[:1], strict=True))


def _is_convex(uv: FloatArray, loop: Loop) -> bool:
    points = np.array([point for _, point in loop])
    triples = np.stack([np.roll(points, 1), points, np.roll(points, -1)], axis=1)
    return bool((heights(sides_between(uv[triples])) > CONVEX_HEIGHT).all())
