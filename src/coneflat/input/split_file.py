"""A mesh's file as if it had had triangles that were cut after reading."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

import numpy as np

from .._arrays import FloatArray, IntArray
from .mesh_file import MeshFile
from .polygons import polygon_of

_POSITION = re.compile(rb"(?m)^[ \t]*v[ \t]")


@dataclass(frozen=True, eq=False)
class CutTriangles:
    """Triangles of a file's mesh, some of them pieces of the file's own.

    Attributes:
        faces: (m, 3) vertices of the result.
        origin: (m,) the triangle that each is, or is a piece of.
        origin_faces: (m, 3) the vertices of that.
        origin_corners: (m, 3) the polygon corners of that.
        added: (x,) vertices of the result that lie on edges.
        ends: (x, 2) vertices of the result between which they lie.
        weights: (x, 2) barycentric coordinates between these.
        positions: (x, 3) where they are.
    """

    faces: IntArray
    origin: IntArray
    origin_faces: IntArray
    origin_corners: IntArray
    added: IntArray
    ends: IntArray
    weights: FloatArray
    positions: FloatArray


def cut_file(source: MeshFile, cut: CutTriangles, vertex_origin: IntArray) -> tuple[MeshFile, IntArray]:
    """Return a file with the pieces of polygons of which a triangle was cut in their place, and the rest as it was.

    New corners have the normals and texture points of the nearer of the two corners that they lie between.

    Args:
        source: the file.
        cut: the triangles.
        vertex_origin: (n,) the vertex of the file that each vertex of the result is, -1 for those that are new.

    Returns:
        The file, and (m, 3) its polygon corner at each triangle corner.
    """
    count, polygons = len(source.vertices), len(source.offsets) - 1
    owner = polygon_of(cut.origin_corners, source.offsets)
    is_split = np.zeros(polygons, dtype=bool)
    is_split[owner[np.bincount(cut.origin)[cut.origin] > 1]] = True
    split = np.flatnonzero(is_split[owner])
    whole = np.flatnonzero(~is_split)
    number = vertex_origin.copy()
    number[cut.added] = count + np.arange(len(cut.added))
    nearest = np.arange(len(vertex_origin))
    nearest[cut.added] = cut.ends[np.arange(len(cut.added)), cut.weights.argmax(axis=1)]
    at = (cut.origin_faces[split][:, None, :] == nearest[cut.faces[split]][:, :, None]).argmax(axis=2)
    inherited = np.take_along_axis(cut.origin_corners[split], at, axis=1)

    # Polygons, and triangles in place of those that were split, in the order of the file.
    place = np.concatenate([whole, owner[split]])
    order = np.argsort(place, kind="stable")
    sizes = np.concatenate([np.diff(source.offsets)[whole], np.full(len(split), 3)])
    offsets = np.concatenate([[0], np.cumsum(sizes[order])])
    start = np.empty(len(sizes), dtype=np.int64)
    start[order] = offsets[:-1]
    is_kept = ~is_split[np.repeat(np.arange(polygons), np.diff(source.offsets))]
    moved = np.full(len(source.corners), -1)
    moved[is_kept] = np.arange(is_kept.sum()) - np.repeat(
        np.cumsum(sizes[: len(whole)]) - sizes[: len(whole)] - start[: len(whole)], sizes[: len(whole)]
    )
    new = start[len(whole) :, None] + np.arange(3)
    corner = np.empty(int(offsets[-1]), dtype=np.int64)
    corner[moved[is_kept]] = np.flatnonzero(is_kept)
    corner[new] = inherited
    vertices = source.corners[corner]
    vertices[new] = number[cut.faces[split]]
    face_corners = moved[cut.origin_corners]
    face_corners[split] = new
    return _with_corners(source, cut, number, corner, vertices, offsets, np.sort(place)), face_corners


def _with_corners(
    source: MeshFile,
    cut: CutTriangles,
    number: IntArray,
    corner: IntArray,
    vertices: IntArray,
    offsets: IntArray,
    place: IntArray,
) -> MeshFile:
    """Return the file with new polygons: (c,) corners that inherit from those of the file, (p,) of its polygons."""

    def taken(values: IntArray | None) -> IntArray | None:
        return None if values is None else values[corner]

    def between(values: FloatArray) -> FloatArray:
        ends = values[number[cut.ends]]
        weights = cut.weights.reshape(cut.weights.shape + (1,) * (values.ndim - 1))
        return np.concatenate([values, (weights * ends).sum(axis=1)])

    text = source.obj
    if text is not None:
        gaps: dict[int, bytes] = {}
        for key, gap in text.gaps.items():
            gaps[int(np.searchsorted(place, key))] = gap
        text = replace(
            text, gaps=_with_positions(gaps, cut.positions, text.newline), normals=taken(text.normals)
        )
    unwelded = None
    if source.unwelded is not None:
        unwelded = np.where(vertices < len(source.vertices), source.unwelded[corner], vertices)
    return replace(
        source,
        vertices=np.concatenate([source.vertices, cut.positions]),
        corners=vertices,
        offsets=offsets,
        unwelded=unwelded,
        obj=text,
        properties={name: between(values) for name, values in source.properties.items()},
        texture=taken(source.texture),
        normal=taken(source.normal),
    )


def _with_positions(gaps: dict[int, bytes], positions: FloatArray, newline: bytes) -> dict[int, bytes]:
    """Return the text of an OBJ file with more positions behind its last one."""
    lines = b"".join(b"v %r %r %r" % tuple(row) + newline for row in positions.tolist())
    last = max(key for key, gap in gaps.items() if _POSITION.search(gap))
    gap = gaps[last]
    if not gap.endswith((b"\n", b"\r")):
        gap += newline
    return {**gaps, last: gap + lines}
