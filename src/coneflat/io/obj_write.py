"""Writing Wavefront OBJ: the input's own text with new texture coordinates."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import IO, TYPE_CHECKING

import numpy as np

from ..base.arrays import FloatArray, IntArray
from .convex_pieces import find_pieces
from .obj import ObjText

if TYPE_CHECKING:
    from ..result import Flattening


_MATERIALS = re.compile(rb"(?m)^([ \t]*mtllib[ \t]+)([^\r\n]*?)(?=[ \t]*\r?$)")


#: Lines written at a time: their numbers take some MB as Python has them.
_LINES = 1 << 15


def write_obj(result: Flattening, stream: IO[bytes], folder: Path) -> None:
    """Write a result as OBJ.

    If the mesh was read from an OBJ file, every line of that file stands in its place, but for its old
    texture coordinates: the new ones are put before the first face, and each face line names them beside the
    file's own vertex and normal numbers. Polygons stay polygons, those whose orientation was repaired run the
    other way, and those that the repair dropped are left out. A polygon that is not convex in the plane, is cut
    by a seam, or was dropped in part, is written in convex pieces. Of another file, what is written are its
    vertices, polygons and normals. Paths of material libraries are made to fit `folder`.

    Args:
        result: what to write.
        stream: a binary file.
        folder: where the file will be, for paths of material libraries.
    """
    source, text = result.source, ObjText({}, None, b"\n")
    vertices, faces, face_corners = result.vertices, result.faces, result.face_corners
    normals = None
    if source is not None and face_corners is not None:
        vertices, offsets, numbers = source.vertices, source.offsets, source.corners + 1
        if source.obj is not None:
            # Its own vertices stand in the text, those that were merged as well.
            numbers = numbers if source.unwelded is None else source.unwelded + 1
            text = _relocated(source.obj, source.path.parent, folder)
        elif source.normals is not None and source.normal is not None:
            normals, text = source.normals, replace(text, normals=source.normal + 1)
    else:
        source, numbers = None, faces.reshape(-1) + 1
        offsets = np.arange(0, len(numbers) + 1, 3)
        face_corners = np.arange(len(numbers)).reshape(-1, 3)
    to_write = find_pieces(result.uv, result.uv_faces, offsets, face_corners)
    columns = [numbers[to_write.corners], to_write.points + 1]
    if text.normals is not None:
        columns.append(text.normals[to_write.corners])
    newline, last = text.newline, len(offsets) - 1
    if source is None or source.obj is None:
        stream.writelines(lines_of("v", vertices, newline))
    if normals is not None:
        stream.writelines(lines_of("vn", normals, newline))
    before = sorted({0, last, *text.gaps})
    begins = np.searchsorted(to_write.polygons, before).tolist()
    starts = np.concatenate(([0], np.cumsum(to_write.sizes)))
    for place, begin, end in zip(before, begins, [*begins[1:], len(to_write.sizes)], strict=True):
        stream.write(_ended(text.gaps.get(place, b""), newline, place == last))
        if place == 0:
            stream.writelines(lines_of("vt", result.uv, newline))
        for first in range(begin, end, _LINES):
            stop = min(first + _LINES, end)
            rows = np.stack([column[starts[first] : starts[stop]] for column in columns], axis=1)
            stream.write(_face_lines(to_write.sizes[first:stop], rows, newline))


def lines_of(begin: str, rows: FloatArray | IntArray, newline: bytes) -> Iterator[bytes]:
    """Yield a text with a line for each of (r, k) rows: the fewest digits from which the same numbers are read."""
    line = begin + " %r" * rows.shape[1] + newline.decode()
    for i in range(0, len(rows), _LINES):
        block = rows[i : i + _LINES]
        yield (line * len(block) % tuple(block.ravel().tolist())).encode()


def _face_lines(sizes: IntArray, rows: IntArray, newline: bytes) -> bytes:
    """Return the lines of faces, with one row of numbers for each corner; a normal of 0 is none."""
    corner, end = " " + "/".join(["%d"] * rows.shape[1]), newline.decode()
    lines = "".join(["f" + corner * size + end for size in sizes.tolist()])
    text = (lines % tuple(rows.ravel().tolist())).encode()
    return text.replace(b"/0 ", b" ").replace(b"/0" + newline, newline)


def _ended(text: bytes, newline: bytes, is_last: bool) -> bytes:
    """Return text that a line can follow."""
    return text + newline if text and not is_last and not text.endswith((b"\n", b"\r")) else text


def _relocated(text: ObjText, old: Path, new: Path) -> ObjText:
    """Return the text with its material libraries named relative to another folder."""
    here, there = os.path.realpath(old), os.path.realpath(new)
    if here == there:
        return text

    def line(match: re.Match[bytes]) -> bytes:
        names = match[2]
        # Several names may stand on a line, and so may one name with blanks; the folder tells.
        is_one = os.path.exists(os.path.join(os.fsencode(here), names))
        return match[1] + b" ".join(
            moved_path(name, here, there) for name in ([names] if is_one else names.split())
        )

    gaps = {i: _MATERIALS.sub(line, gap) if b"mtllib" in gap else gap for i, gap in text.gaps.items()}
    return replace(text, gaps=gaps)


def moved_path(name: bytes, here: str, there: str) -> bytes:
    """Return a path relative to another folder that leads where one relative to the first did; slashes part it."""
    if os.path.isabs(name):
        return name
    full = os.path.join(os.fsencode(here), name)
    try:
        relative = os.path.relpath(full, os.fsencode(there))
    except ValueError:
        # On another drive nothing but the full path leads there.
        relative = full
    return relative.replace(os.fsencode(os.sep), b"/")
