"""Writing Wavefront OBJ: the input's own text with new texture coordinates."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import IO, TYPE_CHECKING, NamedTuple

import numpy as np

from .._arrays import FloatArray, IntArray
from .obj import ObjText

if TYPE_CHECKING:
    from ..result import Flattening

_MATERIALS = re.compile(rb"(?m)^([ \t]*mtllib[ \t]+)([^\r\n]*?)(?=[ \t]*\r?$)")


class _Faces(NamedTuple):
    """The faces to write: `corners` of the source, `sizes` of them to a face, and the polygon each is of."""

    corners: IntArray
    sizes: IntArray
    polygons: IntArray


def write_obj(result: Flattening, stream: IO[bytes], folder: Path) -> None:
    """Write a result as OBJ.

    If the mesh was read from an OBJ file, every line of that file stands in its place, but for its old
    texture coordinates: the new ones are put before the first face, and each face line names them beside the
    file's own vertex and normal numbers. Polygons stay polygons, those whose orientation was repaired run the
    other way, and those that the repair dropped are left out; of a polygon that it dropped in part, the
    remaining triangles are written. Paths of material libraries are made to fit `folder`.

    Args:
        result: what to write.
        stream: a binary file.
        folder: where the file will be, for paths of material libraries.
    """
    source = result.source
    if source is not None and result.face_corners is not None:
        offsets, face_corners = source.offsets, result.face_corners
        text = source.obj or _plain_text(source.vertices, source.corners, len(offsets) - 1)
        text = text if source.obj is None else _relocated(text, source.path.parent, folder)
    else:
        count = len(result.faces)
        offsets = np.arange(0, 3 * count + 1, 3)
        face_corners = np.arange(3 * count).reshape(-1, 3)
        text = _plain_text(result.vertices, result.faces.reshape(-1), count)

    uv_number = np.zeros(len(text.numbers), dtype=np.int64)
    uv_number[face_corners] = result.uv_faces + 1
    faces = _faces_to_write(offsets, face_corners, uv_number)
    newline = text.newline.decode()
    gaps = {int(i): gap for i, gap in text.gaps.items()}
    last = len(offsets) - 1
    before = sorted({0, last, *gaps})
    begins = np.searchsorted(faces.polygons, before).tolist()
    columns = [text.numbers[faces.corners], uv_number[faces.corners]]
    if text.normals is not None:
        columns.append(text.normals[faces.corners])
    lines = _FaceLines(faces.sizes, columns, newline)
    for place, begin, end in zip(before, begins, [*begins[1:], len(faces.sizes)], strict=True):
        stream.write(_ended(gaps.get(place, b""), text.newline, place == last))
        if place == 0:
            stream.write(_uv_lines(result.uv, newline))
        stream.write(lines.text(begin, end))


class _FaceLines:
    """Face lines, formatted many at once."""

    def __init__(self, sizes: IntArray, columns: list[IntArray], newline: str) -> None:
        width = len(columns)
        corner = "/".join(["%d"] * width)
        self._starts = np.concatenate(([0], np.cumsum(sizes))).tolist()
        self._sizes: list[int] = sizes.tolist()
        self._lines = {size: "f " + " ".join([corner] * size) + newline for size in np.unique(sizes).tolist()}
        self._numbers: list[int] = np.stack(columns, axis=1).reshape(-1).tolist()
        self._width = width
        self._lacks_normals = width == 3 and bool(np.any(columns[2] == 0))

    def text(self, begin: int, end: int) -> bytes:
        """Return the lines of faces `begin` to `end`."""
        pattern = "".join(map(self._lines.__getitem__, self._sizes[begin:end]))
        first, stop = self._width * self._starts[begin], self._width * self._starts[end]
        text = pattern % tuple(self._numbers[first:stop])
        # 0 stands for no normal.
        return (re.sub(r"/0(?=\s)", "", text) if self._lacks_normals else text).encode("ascii")


def _faces_to_write(offsets: IntArray, face_corners: IntArray, uv_number: IntArray) -> _Faces:
    """Return the polygons that have UVs at all corners, oriented as their triangles, and else triangles."""
    sizes = np.diff(offsets)
    polygon_of_corner = np.repeat(np.arange(len(sizes)), sizes)
    polygon_of_face = polygon_of_corner[face_corners[:, 0]]

    # Corner positions of a triangle that runs the polygon's way ascend but for one step back.
    steps_back = np.count_nonzero(np.roll(face_corners, -1, axis=1) < face_corners, axis=1)
    is_reversed = np.zeros(len(sizes), dtype=bool)
    is_reversed[polygon_of_face] = steps_back == 2

    start, size = np.repeat(offsets[:-1], sizes), np.repeat(sizes, sizes)
    corners = np.arange(len(uv_number))
    corners = np.where(is_reversed[polygon_of_corner], start + (size - (corners - start)) % size, corners)

    has_uv = np.bincount(polygon_of_corner, weights=uv_number > 0, minlength=len(sizes))
    complete = has_uv == sizes
    if complete.all():
        return _Faces(corners, sizes, np.arange(len(sizes)))
    loose = ~complete[polygon_of_face]
    owners = np.concatenate((np.flatnonzero(complete), polygon_of_face[loose]))
    order = np.argsort(owners, kind="stable")
    kept = complete[polygon_of_corner]
    corner_owners = np.concatenate((polygon_of_corner[kept], np.repeat(polygon_of_face[loose], 3)))
    corners = np.concatenate((corners[kept], face_corners[loose].reshape(-1)))
    return _Faces(
        corners=corners[np.argsort(corner_owners, kind="stable")],
        sizes=np.concatenate((sizes[complete], np.full(np.count_nonzero(loose), 3)))[order],
        polygons=owners[order],
    )


def _plain_text(vertices: FloatArray, corners: IntArray, count: int) -> ObjText:
    """Return the text of an OBJ file that has vertices only."""
    # repr gives the shortest text from which the same number is read.
    positions = ("v %r %r %r\n" * len(vertices)) % tuple(vertices.reshape(-1).tolist())
    return ObjText({0: positions.encode("ascii"), count: b""}, corners + 1, None, b"\n")


def _uv_lines(uv: FloatArray, newline: str) -> bytes:
    return ((f"vt %r %r{newline}" * len(uv)) % tuple(uv.reshape(-1).tolist())).encode("ascii")


def _ended(text: bytes, newline: bytes, is_last: bool) -> bytes:
    """Return text that a line can follow."""
    return text + newline if text and not is_last and not text.endswith((b"\n", b"\r")) else text


def _relocated(text: ObjText, old: Path, new: Path) -> ObjText:
    """Return the text with its material libraries named relative to another folder."""
    here, there = os.path.realpath(old), os.path.realpath(new)
    if here == there:
        return text

    def moved(name: bytes) -> bytes:
        if os.path.isabs(name):
            return name
        full = os.path.join(os.fsencode(here), name)
        try:
            relative = os.path.relpath(full, os.fsencode(there))
        except ValueError:
            # On another drive nothing but the full path leads there.
            relative = full
        return relative.replace(os.fsencode(os.sep), b"/")

    def line(match: re.Match[bytes]) -> bytes:
        names = match[2]
        # Several names may stand on a line, and so may one name with blanks; the folder tells.
        is_one = os.path.exists(os.path.join(os.fsencode(here), names))
        return match[1] + b" ".join(map(moved, [names] if is_one else names.split()))

    gaps = {i: _MATERIALS.sub(line, gap) if b"mtllib" in gap else gap for i, gap in text.gaps.items()}
    return ObjText(gaps, text.numbers, text.normals, text.newline)
