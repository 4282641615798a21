"""Reading OFF, with its polygons."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NoReturn

import numpy as np

from ..errors import MeshFileError
from .raw import RawMesh
from .text import first_unreadable, parse_indices, parse_points, shown

# Texture coordinates, colours and normals follow the position, so that they can be passed over; "4" and
# "n" change what the position itself is.
_HEADER = re.compile(rb"(ST)?(C)?(N)?(4)?(n)?OFF\b", re.IGNORECASE)


def parse_off(path: Path, content: bytes) -> RawMesh:
    """Return the mesh of an OFF file: OFF, COFF, NOFF, STOFF and their combinations, in text.

    Raises:
        MeshFileError: the file is not OFF, is shorter than its header promises, or has text for a number.
    """
    numbered = [(i + 1, line.partition(b"#")[0].strip()) for i, line in enumerate(content.splitlines())]
    rows = [(i, line) for i, line in numbered if line]
    if not rows:
        raise MeshFileError(f"{path} is not an OFF file: it has nothing but comments")
    vertex_count, face_count, rows = _header(path, rows)

    if len(rows) < vertex_count:
        raise MeshFileError(f"{path} ends after {len(rows)} of the {vertex_count} vertices it promises")
    vertex_rows = rows[:vertex_count]
    face_rows = rows[vertex_count : vertex_count + face_count]
    if len(face_rows) < face_count:
        raise MeshFileError(f"{path} ends after {len(face_rows)} of the {face_count} faces it promises")

    def bad_vertex(i: int, reason: str) -> NoReturn:
        raise MeshFileError(f"{path}, line {vertex_rows[i][0]}: {reason}")

    def bad_face(i: int, reason: str) -> NoReturn:
        raise MeshFileError(f"{path}, line {face_rows[i][0]}: {reason}")

    vertices = np.ascontiguousarray(
        parse_points([line + b"\n" for _, line in vertex_rows], bad_vertex)[:, :3]
    )
    if not face_rows:
        return RawMesh(vertices, np.empty(0, np.int64), np.zeros(1, np.int64))

    lines = [line for _, line in face_rows]
    first_words = [line.split(None, 1)[0] for line in lines]
    try:
        sizes = np.array(first_words, dtype=np.int64)
    except (ValueError, OverflowError):
        i = first_unreadable(first_words, np.int64)
        bad_face(i, f"{shown(first_words[i])} is not a number of corners")
    # What follows the corners is a colour, which need not be of whole numbers.
    trimmed = [
        line if len(words) == size + 1 else b" ".join(words[: max(size, 0) + 1])
        for line, size, words in zip(lines, sizes.tolist(), map(bytes.split, lines), strict=True)
    ]
    if b"/" in b"".join(trimmed):
        bad_face(next(i for i, line in enumerate(trimmed) if b"/" in line), "'/' is not part of a number")
    counts, numbers, _ = parse_indices([line + b"\n" for line in trimmed], bad_face)
    short = (counts - 1 != sizes) | (sizes < 3)
    if short.any():
        i = int(np.argmax(short))
        if sizes[i] < 3:
            bad_face(i, f"a face needs at least 3 corners, but has {sizes[i]}")
        bad_face(i, f"a face of {sizes[i]} corners names {counts[i] - 1} vertices")
    starts = np.cumsum(counts) - counts
    return RawMesh(vertices, np.delete(numbers, starts), np.concatenate(([0], np.cumsum(sizes))))


def _header(path: Path, rows: list[tuple[int, bytes]]) -> tuple[int, int, list[tuple[int, bytes]]]:
    """Return the counts of vertices and faces, and the lines behind them."""
    number, first = rows[0]
    keyword = _HEADER.match(first)
    if keyword:
        if keyword.group(4) or keyword.group(5):
            raise MeshFileError(f"{path}: OFF with points of another dimension than 3 is not supported")
        first = first[keyword.end() :].strip()
        if first.upper().startswith(b"BINARY"):
            raise MeshFileError(f"{path} is a binary OFF file, which is not supported; convert it to text")
    rows = rows[1:]
    if not first and rows:
        number, first = rows[0]
        rows = rows[1:]
    words = first.split()
    try:
        vertex_count, face_count = int(words[0]), int(words[1])
    except (ValueError, IndexError):
        raise MeshFileError(
            f"{path}, line {number}: not an OFF file, the numbers of vertices and faces were expected"
        ) from None
    if vertex_count < 0 or face_count < 0:
        raise MeshFileError(f"{path}, line {number}: a number of vertices or faces is negative")
    return vertex_count, face_count, rows
