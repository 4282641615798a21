"""The polygons of a file as they can be written: whole where they are convex in the plane, in convex pieces else.

Readers split polygons into triangles by themselves, mostly into fans. Of a convex polygon every fan is upright.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..geometry.planar import heights, sides_between
from ..mesh.polygons import Polygons, fan_corners

# Height over longest side of the triangle at a corner from which on the corner is convex: above rounding, with which
# areas are off by some 1e-16.
CONVEX_HEIGHT = 1e-12

Node: TypeAlias = tuple[int, int]
Loop: TypeAlias = list[Node]


@dataclass(frozen=True, eq=False)
class Pieces:
    """Polygons to write, in the order of those of the source.

    Attributes:
        corners: (c,) corner of the source's polygons at each of theirs, one after the other.
        points: (c,) their points in the plane.
        sizes: (q,) how many corners each has.
        polygons: (q,) the polygon of the source that each is, or is a piece of.
        split: (s,) polygons of the source that are written in pieces since they are not convex in the plane.
    """

    corners: IntArray
    points: IntArray
    sizes: IntArray
    polygons: IntArray
    split: IntArray

    def fans(self) -> tuple[IntArray, IntArray]:
        """Return the triangles that others read: (t, 3) corners of the source, and (t, 3) points in the plane."""
        rows = fan_corners(np.concatenate([[0], np.cumsum(self.sizes)]))
        return self.corners[rows], self.points[rows]


def find_pieces(uv: FloatArray, uv_faces: IntArray, offsets: IntArray, face_corners: IntArray) -> Pieces:
    """Return the polygons to write; of those that have lost triangles, what is left.

    Args:
        uv: (u, 2) points of the plane.
        uv_faces: (m, 3) the point of each triangle corner.
        offsets: (p + 1,) where the corners of the source's polygons begin.
        face_corners: (m, 3) the source's corner at each triangle corner.
    """
    polygons = Polygons(offsets, face_corners)
    points, sizes, loops = polygons.points(uv_faces), polygons.sizes, polygons.loops()
    triples, at = polygons.corner_triples(points)
    whole = polygons.are_whole(points)
    height = heights(sides_between(uv[triples]))
    # What is flipped as a whole is so in fans, too, and no better in pieces.
    split = np.intersect1d(at[~(height > CONVEX_HEIGHT)], at[~(height < -CONVEX_HEIGHT)])
    whole[split] = False
    if whole.all():
        return Pieces(loops, points[loops], sizes, np.arange(len(sizes)), split)
    kept = np.repeat(whole, sizes)
    intact = (loops[kept], points[loops[kept]], sizes[whole], np.flatnonzero(whole))
    parts = _convex_parts(uv, uv_faces, face_corners, polygons.owner, ~whole)
    corners, flat, counts, names = map(np.concatenate, zip(intact, parts, strict=True))
    order = np.argsort(names, kind="stable")
    rows = np.argsort(np.repeat(names, counts), kind="stable")
    return Pieces(corners[rows], flat[rows], counts[order], names[order], split)


def _convex_parts(
    uv: FloatArray, uv_faces: IntArray, face_corners: IntArray, owner: IntArray, chosen: BoolArray
) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """Return what is left of the chosen polygons, in convex pieces: the first four attributes of `Pieces`."""
    faces = np.flatnonzero(chosen[owner])
    faces = faces[np.argsort(owner[faces], kind="stable")]
    names, first = np.unique(owner[faces], return_index=True)
    pieces, polygons = [], []
    # Of some polygons nothing may be left, and so of all of them.
    for name, members in zip(names.tolist(), np.split(faces, first)[1:], strict=True):
        corners = np.stack([face_corners[members], uv_faces[members]], axis=2).tolist()
        loops = merge_convex(uv, [[(c, p) for c, p in triangle] for triangle in corners])
        pieces += loops
        polygons += [name] * len(loops)
    rows = np.array([node for loop in pieces for node in loop], dtype=np.int64).reshape(-1, 2)
    sizes = np.array([len(loop) for loop in pieces], dtype=np.int64)
    return rows[:, 0], rows[:, 1], sizes, np.array(polygons, dtype=np.int64)


def merge_convex(uv: FloatArray, loops: list[Loop]) -> list[Loop]:
    """Return loops joined across sides that two of them share, in turn, where that leaves them convex.

    Hertel and Mehlhorn 1983: at most four times as many pieces as the fewest. Each begins with its smallest corner.

    Args:
        uv: (u, 2) points of the plane.
        loops: corners of the source with their points, as each triangle runs.
    """
    owner = {side: i for i, loop in enumerate(loops) for side in _sides(loop)}
    merged = dict(enumerate(loops))
    for a, b in [(a, b) for a, b in owner if a < b and (b, a) in owner]:
        here, there = owner[a, b], owner[b, a]
        if here == there:
            continue
        one, two = merged[here], merged[there]
        # The first runs from a to b along the side that they share, the second back.
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
