"""Writing Wavefront OBJ: the input's own text with new texture coordinates."""

from __future__ import annotations

import os
import re
from dataclasses import replace
from pathlib import Path
from typing import IO, TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .._arrays import IntArray
from ..compiled import compiled
from .decimals import BLANK, lines_of, put_integer
from .obj import ObjText
from .polygons import find_pieces

if TYPE_CHECKING:
    from ..result.flattening import Flattening


_MATERIALS = re.compile(rb"(?m)^([ \t]*mtllib[ \t]+)([^\r\n]*?)(?=[ \t]*\r?$)")


#: Faces written at a time.
_FACES = 1 << 15


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
        stream.writelines(lines_of(b"v", vertices, newline))
    if normals is not None:
        stream.writelines(lines_of(b"vn", normals, newline))
    before = sorted({0, last, *text.gaps})
    begins = np.searchsorted(to_write.polygons, before).tolist()
    starts = np.concatenate(([0], np.cumsum(to_write.sizes)))
    for place, begin, end in zip(before, begins, [*begins[1:], len(to_write.sizes)], strict=True):
        stream.write(_ended(text.gaps.get(place, b""), newline, place == last))
        if place == 0:
            stream.writelines(lines_of(b"vt", result.uv, newline))
        for first in range(begin, end, _FACES):
            stop = min(first + _FACES, end)
            rows = np.stack([column[starts[first] : starts[stop]] for column in columns], axis=1)
            stream.write(_face_lines(to_write.sizes[first:stop], rows, newline))


def _face_lines(sizes: IntArray, rows: IntArray, newline: bytes) -> bytes:
    """Return the lines of faces, with one row of numbers for each corner; a normal of 0 is none."""

    letters = len(str(int(np.abs(rows).max(initial=0)))) + 2  # with a sign, and what stands before the number
    out = np.empty(rows.size * letters + len(sizes) * (1 + len(newline)), np.uint8)
    return out[: put_faces(sizes, rows, np.frombuffer(newline, np.uint8), out)].tobytes()


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


LETTER_F, SLASH = ord("f"), ord("/")


@compiled
def put_faces(sizes: IntArray, rows: IntArray, end: NDArray[np.uint8], out: NDArray[np.uint8]) -> int:
    """Write a line for each face, and return the length of the text.

    Args:
        sizes: (p,) the number of corners of each face.
        rows: (c, k) numbers of each corner, to stand between slashes; a 0 at the end is left out.
        end: how a line ends.
        out: where the text goes, large enough.
    """
    i, corner = 0, 0
    for size in sizes:
        out[i] = LETTER_F
        i += 1
        for _ in range(size):
            out[i] = BLANK
            i = put_integer(out, i + 1, rows[corner, 0])
            for number in rows[corner, 1:]:
                if number != 0:
                    out[i] = SLASH
                    i = put_integer(out, i + 1, number)
            corner += 1
        for code in end:
            out[i] = code
            i += 1
    return i
