"""Polygons to write to a file: unchanged if they are convex in the plane, otherwise split into convex pieces.

Readers split polygons into triangles, mostly into fans. For a convex polygon, the triangles of every fan are positively
oriented. A fan may have triangles without area on the model, where three corners are on a line, but with area in the
plane: such a polygon begins with another corner, or is written in triangles.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..geometry.opening import thickness
from ..geometry.planar import heights, sides_between
from ..mesh.connectivity import NEXT, PREVIOUS
from ..mesh.polygons import Polygons, fan_corners
from ..result import Flattening

# Minimum ratio of height to longest side of the triangle at a convex corner. It is above the rounding errors of areas,
# which are about 1e-16.
CONVEX_HEIGHT = 1e-12

# Factor by which the triangles of a fan may be thicker in the plane than on the model, as of `measure.NEEDLE_QC`, and
# the thickness of triangles on the model that is attributed to rounding.
MAX_THICKENING, ROUNDED_HEIGHT = 1e3, 1e-12

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


def find_pieces(result: Flattening, offsets: IntArray, face_corners: IntArray) -> Pieces:
    """Return the polygons to write; of polygons with removed triangles, the remaining pieces.

    Args:
        result: the flattening.
        offsets: (p + 1,) start of the corners of the source's polygons.
        face_corners: (m, 3) the source's corner at each triangle corner.
    """
    uv, uv_faces = result.uv, result.uv_faces
    pieces = _convex_pieces(uv, uv_faces, offsets, face_corners, np.empty(0, dtype=np.int64))
    if not (pieces.sizes > 3).any():
        return pieces
    positions = np.zeros((int(offsets[-1]), 3))
    positions[face_corners] = result.vertices[result.faces]
    turned, bad = _with_good_fans(pieces, uv, positions)
    return turned if not len(bad) else _convex_pieces(uv, uv_faces, offsets, face_corners, bad)


def _with_good_fans(pieces: Pieces, uv: FloatArray, positions: FloatArray) -> tuple[Pieces, IntArray]:
    """Return pieces that begin with the first corner whose fan is good, and the source's polygons without one.

    A fan is good if its triangles are not much thicker in the plane than on the model.

    Args:
        pieces: convex pieces.
        uv: (u, 2) points in the plane.
        positions: (c, 3) positions of the source's corners.
    """
    starts = np.concatenate([[0], np.cumsum(pieces.sizes)])
    order, bad = np.arange(len(pieces.corners)), np.zeros(len(pieces.sizes), dtype=bool)
    for size in np.unique(pieces.sizes[pieces.sizes > 3]).tolist():
        rows = np.flatnonzero(pieces.sizes == size)
        for turn in range(size):
            loops = starts[rows, None] + (np.arange(size) + turn) % size
            order[starts[rows, None] + np.arange(size)] = loops
            rows = rows[_is_bad_fan(loops, pieces, uv, positions)]
            if not len(rows):
                break
        order[starts[rows, None] + np.arange(size)] = starts[rows, None] + np.arange(size)
        bad[rows] = True
    turned = replace(pieces, corners=pieces.corners[order], points=pieces.points[order])
    return turned, np.unique(pieces.polygons[bad])


def _is_bad_fan(loops: IntArray, pieces: Pieces, uv: FloatArray, positions: FloatArray) -> BoolArray:
    """Return (q,) whether the fan around the first corner of polygons (q, k) has triangles that the plane thickens."""
    size = loops.shape[1]
    fans = loops[:, fan_corners(np.array([0, size]))].reshape(-1, 3)
    ends = positions[pieces.corners[fans]]
    on_model = thickness(np.linalg.norm(ends[:, PREVIOUS] - ends[:, NEXT], axis=2))
    in_plane = heights(sides_between(uv[pieces.points[fans]]))
    is_bad: BoolArray = in_plane > MAX_THICKENING * np.maximum(on_model, ROUNDED_HEIGHT)
    return np.asarray(is_bad.reshape(len(loops), -1).any(axis=1))


def _convex_pieces(
    uv: FloatArray, uv_faces: IntArray, offsets: IntArray, face_corners: IntArray, in_triangles: IntArray
) -> Pieces:
    """Return the polygons to write, in convex pieces where needed.

    Args:
        uv, uv_faces, offsets, face_corners: as of `find_pieces`.
        in_triangles: (t,) polygons that are written in triangles.
    """
    polygons = Polygons(offsets, face_corners)
    points, sizes, loops = polygons.points(uv_faces), polygons.sizes, polygons.loops()
    triples, at = polygons.corner_triples(points)
    complete = polygons.are_complete(points)
    height = heights(sides_between(uv[triples]))
    # A polygon that is flipped as a whole stays flipped in fans and in pieces, so it is not split.
    split = np.intersect1d(at[~(height > CONVEX_HEIGHT)], at[~(height < -CONVEX_HEIGHT)])
    split = np.union1d(split, in_triangles)
    complete[split] = False
    if complete.all():
        return Pieces(loops, points[loops], sizes, np.arange(len(sizes)), split)
    is_complete = np.repeat(complete, sizes)
    intact = (loops[is_complete], points[loops[is_complete]], sizes[complete], np.flatnonzero(complete))
    parts = _convex_parts(uv, uv_faces, face_corners, polygons.owner, ~complete, in_triangles)
    corners, flat, counts, names = map(np.concatenate, zip(intact, parts, strict=True))
    order = np.argsort(names, kind="stable")
    rows = np.argsort(np.repeat(names, counts), kind="stable")
    return Pieces(corners[rows], flat[rows], counts[order], names[order], split)


def _convex_parts(
    uv: FloatArray,
    uv_faces: IntArray,
    face_corners: IntArray,
    owner: IntArray,
    chosen: BoolArray,
    in_triangles: IntArray,
) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """Return the remaining triangles of the chosen polygons as convex pieces: the first four attributes of `Pieces`."""
    faces = np.flatnonzero(chosen[owner])
    faces = faces[np.argsort(owner[faces], kind="stable")]
    names, first = np.unique(owner[faces], return_index=True)
    pieces: list[Loop] = []
    polygons: list[int] = []
    triangulated = set(in_triangles.tolist())
    # Some of the polygons, or all of them, may have no remaining triangles.
    for name, members in zip(names.tolist(), np.split(faces, first)[1:], strict=True):
        corners = np.stack([face_corners[members], uv_faces[members]], axis=2).tolist()
        loops = [[(c, p) for c, p in triangle] for triangle in corners]
        loops = loops if name in triangulated else merge_convex(uv, loops)
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
        piece, neighbour = owner[a, b], owner[b, a]
        if piece == neighbour:
            continue
        first_loop, next_loop = merged[piece], merged[neighbour]
        # The first loop traverses the common side from a to b, the second from b to a.
        i, j = first_loop.index(b), next_loop.index(a)
        joined = (first_loop[i:] + first_loop[:i]) + (next_loop[j:] + next_loop[:j])[1:-1]
        if _is_convex(uv, joined):
            merged[piece] = joined
            del merged[neighbour]
            for side in _sides(joined):
                owner[side] = piece
    return sorted(loop[k:] + loop[:k] for loop in merged.values() for k in [loop.index(min(loop))])


def _sides(loop: Loop) -> list[tuple[Node, Node]]:
    return list(zip(loop, loop[1:] + loop[:1], strict=True))


def _is_convex(uv: FloatArray, loop: Loop) -> bool:
    points = np.array([point for _, point in loop])
    triples = np.stack([np.roll(points, 1), points, np.roll(points, -1)], axis=1)
    return bool((heights(sides_between(uv[triples])) > CONVEX_HEIGHT).all())
