"""Reading Wavefront OBJ.

An own parser, because no library keeps all of what the output has to reproduce: the file's numbering of
vertices, its polygons, groups, materials and comments.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from .._arrays import BoolArray, IntArray
from ..errors import EmptyMeshError, FaceIndexError, MeshFileError
from .raw import COLOURS, RawMesh
from .text import parse_indices, parse_points

_VERTEX, _FACE, _TEXTURE, _ELEMENT = 1, 2, 3, 4
#: By the first two characters of a line, as a 16-bit number, what it is.
_KINDS = np.zeros(1 << 16, np.uint8)
for _letters, _kind in ((b"v", _VERTEX), (b"f", _FACE), (b"l", _ELEMENT), (b"p", _ELEMENT)):
    for _blank in b" \t\r\n\\":
        _KINDS[_letters[0] << 8 | _blank] = _kind
_KINDS[int.from_bytes(b"vt", "big")] = _TEXTURE
_INDENTS = (b"\n ", b"\n\t", b"\r ", b"\r\t")
_BOM = b"\xef\xbb\xbf"


@dataclass(frozen=True)
class ObjText:
    """What an OBJ file holds besides its polygons.

    Attributes:
        gaps: the text that stands before the line of polygon i, verbatim but for the texture coordinates,
            which are left out; the number of polygons is the key of what follows the last.
        numbers: (c,) the file's own number of the vertex at every polygon corner, from 1.
        normals: (c,) the number of the normal at every polygon corner as the file gives it (it may count
            backwards), 0 where there is none; None where no corner has one.
        newline: how the file ends its lines.
    """

    gaps: Mapping[int, bytes]
    numbers: IntArray
    normals: IntArray | None
    newline: bytes


def parse_obj(path: Path, content: bytes) -> RawMesh:
    """Return the mesh of an OBJ file.

    The weight w behind the coordinates is not used; it survives in the text.

    Raises:
        EmptyMeshError: there is no vertex or no face.
        MeshFileError: a `v` or `f` line is not what it should be.
        FaceIndexError: a face names vertex 0 or one that does not exist.
    """
    lines = _logical_lines(content)
    plain = lines
    if content.startswith((b" ", b"\t", _BOM)) or any(start in content for start in _INDENTS):
        plain = [line.lstrip(b" \t") for line in lines]
        plain[0] = plain[0].removeprefix(_BOM).lstrip(b" \t")
    kinds = _kinds(plain)
    vertex_rows = np.flatnonzero(kinds == _VERTEX)
    face_rows = np.flatnonzero(kinds == _FACE)

    def line_number(row: int) -> int:
        return 1 + sum(len(line.splitlines()) for line in lines[:row])

    def bad_vertex(i: int, reason: str) -> NoReturn:
        raise MeshFileError(f"{path}, line {line_number(int(vertex_rows[i]))}: {reason}")

    def bad_face(i: int, reason: str) -> NoReturn:
        raise MeshFileError(f"{path}, line {line_number(int(face_rows[i]))}: {reason}")

    points = parse_points([plain[row][1:] for row in vertex_rows.tolist()], bad_vertex)
    vertices = np.ascontiguousarray(points[:, :3])
    # Many programs write a colour behind the position.
    colours = zip(COLOURS, points[:, 3:6].T, strict=True) if points.shape[1] in (6, 7) else ()
    if not len(vertices):
        raise EmptyMeshError(f"{path} has no vertices")
    if not len(face_rows):
        raise EmptyMeshError(f"{path} has no faces")
    face_lines = [plain[row][1:] for row in face_rows.tolist()]
    sizes, given, normals = parse_indices(face_lines, bad_face)
    if sizes.min() < 3:
        i = int(np.argmax(sizes < 3))
        bad_face(i, f"a face needs at least 3 corners, but has {sizes[i]}")
    offsets = np.concatenate(([0], np.cumsum(sizes)))

    # A negative number counts back from the vertices that stand above the face.
    above = np.repeat(np.searchsorted(vertex_rows, face_rows), sizes)
    corners = np.where(given < 0, above + given, given - 1)
    bad = (given == 0) | (corners < 0) | (corners >= len(vertices))
    if bad.any():
        c = int(np.argmax(bad))
        i = int(np.searchsorted(offsets, c, side="right")) - 1
        known = "OBJ counts from 1" if given[c] == 0 else f"there are {len(vertices)} vertices"
        raise FaceIndexError(
            f"{path}, line {line_number(int(face_rows[i]))}: a face names vertex {given[c]}, but {known}"
        )
    text = ObjText(
        gaps=_gaps(lines, kinds, face_rows, face_lines),
        numbers=corners + 1,
        normals=normals,
        newline=_newline(lines),
    )
    return RawMesh(vertices, corners, offsets, text, dict(colours))


def _logical_lines(content: bytes) -> list[bytes]:
    """Return the lines with their ends; a line that ends with a backslash takes the next one along."""
    lines = content.splitlines(keepends=True)
    if b"\\\n" not in content and b"\\\r" not in content:
        return lines
    logical: list[bytes] = []
    open_line = False
    for line in lines:
        if open_line:
            logical[-1] += line
        else:
            logical.append(line)
        # The backslash at the end of a comment is text, often that of a Windows path.
        is_comment = not open_line and line.lstrip().startswith(b"#")
        open_line = line.rstrip(b"\r\n").endswith(b"\\") and not is_comment
    return logical


def _kinds(lines: Sequence[bytes]) -> NDArray[np.uint8]:
    """Return what each line is; 0 is nothing that matters here."""
    codes = np.frombuffer(b"".join(lines) + b"\n\n", np.uint8).astype(np.uint16)
    lengths = np.fromiter(map(len, lines), np.int64, len(lines))
    starts = np.cumsum(lengths) - lengths
    return np.asarray(_KINDS[codes[starts] << 8 | codes[starts + 1]])


def _newline(lines: Sequence[bytes]) -> bytes:
    """Return how the first line ends."""
    return next((end for end in (b"\r\n", b"\n", b"\r") if lines[0].endswith(end)), b"\n")


def _gaps(
    lines: list[bytes], kinds: NDArray[np.uint8], rows: IntArray, faces: list[bytes]
) -> dict[int, bytes]:
    """Return the text before each polygon that has any, see `ObjText.gaps`."""
    kept = lines
    if np.any(kinds > _FACE):
        kept = list(lines)
        for row in np.flatnonzero(kinds == _TEXTURE).tolist():
            kept[row] = b""
        for row in np.flatnonzero(kinds == _ELEMENT).tolist():
            kept[row] = _without_texture(lines[row])
    starts = np.concatenate(([0], rows + 1))
    stops = np.concatenate((rows, [len(lines)]))
    gaps = {
        i: b"".join(kept[starts[i] : stops[i]]) for i in np.flatnonzero(_nonempty(starts, stops)).tolist()
    }
    newline = _newline(lines)
    if b"#" in b"".join(faces):
        for i, line in enumerate(faces):
            _, mark, comment = line.partition(b"#")
            if mark:
                gaps[i + 1] = mark + comment.rstrip(b"\r\n") + newline + gaps.get(i + 1, b"")
    return gaps


def _nonempty(starts: IntArray, stops: IntArray) -> BoolArray:
    return np.asarray(stops > starts)


def _without_texture(line: bytes) -> bytes:
    """Return a line or point element without its texture indices, which the new `vt` lines do not have."""
    element, mark, comment = line.partition(b"#")
    return re.sub(rb"/[-+0-9]*", b"", element) + mark + comment
