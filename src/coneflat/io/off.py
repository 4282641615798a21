"""Reader for OFF files, which keeps polygons."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..base.arrays import FloatArray, IntArray
from ..errors import MeshFileError
from ..mesh.polygons import COLOURS
from .attributes import ALPHA, VERTEX_COLOURS, Attribute, colour_shades
from .mesh_file import MeshFile, offsets_of
from .text import Growing, TextBlock, text_blocks

# Colours and texture coordinates follow the position and normal; "4" and "n" change the dimension of the position.
_HEADER = re.compile(rb"(ST)?(C)?(N)?(4)?(n)?OFF\b", re.IGNORECASE)
_LINE = re.compile(rb"([^\r\n]*)(?:\r\n|[\r\n]|\Z)")


def is_off(content: bytes) -> bool:
    """Return True if a file begins with the keyword of OFF."""
    return _HEADER.match(next((line for _, line, _ in _filled_lines(content[:4096])), b"")) is not None


def parse_off(path: Path, content: bytes) -> MeshFile:
    """Return the mesh of an OFF file: OFF, COFF, NOFF, STOFF and their combinations, in text.

    Raises:
        MeshFileError: the file is not OFF, has fewer elements than its header declares, or has text for a number.
    """
    vertex_count, face_count, begin, keyword = _header(path, content)
    has_normals = b"N" in keyword
    vertices, normals, colours = Growing(np.float64, 3), Growing(np.float64, 3), Growing(np.float64, 4)
    sizes, corners = Growing(np.int64), Growing(np.int64)
    lines, attributes = 0, dict[Attribute, None]()
    for block in text_blocks(path, content, begin):
        rows = np.flatnonzero(block.counts)
        ends = np.array([vertex_count, vertex_count + face_count]) - lines
        of_vertices, of_faces = np.clip(ends, 0, len(rows))
        points = block.words(rows[:of_vertices]).points()
        vertices.add(points[:, :3])
        if has_normals and points.shape[1] >= 6:
            normals.add(points[:, 3:6])
        shades = _shades(points[:, 3 + 3 * has_normals :], keyword)
        if shades is not None:
            colours.add(shades)
        columns_before_colours = 3 + 3 * has_normals + 2 * (b"S" in keyword)
        if (block.counts[rows[:of_vertices]] > columns_before_colours).any():
            attributes[VERTEX_COLOURS] = None
        counts, named = _polygons(block, rows[of_vertices:of_faces])
        if (block.counts[rows[of_vertices:of_faces]] > 1 + counts).any():
            attributes[Attribute("face colours")] = None
        sizes.add(counts)
        corners.add(named)
        lines += len(rows)
    if lines < vertex_count:
        raise MeshFileError(f"{path} ends after {lines} of the {vertex_count} vertices in its header")
    if (read_faces := lines - vertex_count) < face_count:
        raise MeshFileError(f"{path} ends after {read_faces} of the {face_count} faces in its header")
    properties: dict[str, FloatArray] = {}
    if len(colours) == vertex_count > 0:
        shades = colours.done()
        is_whole = ~np.isnan(shades[:, 3])
        shades = colour_shades(shades if is_whole.all() else shades[:, :3])
        properties = dict(zip((*COLOURS, ALPHA.name), shades.T, strict=False))
        attributes |= {ALPHA: None} if ALPHA.name in properties else {}
    mesh = MeshFile(
        path,
        vertices.done(),
        corners.done(),
        offsets_of(sizes.done()),
        properties=properties,
        attributes=tuple(attributes),
    )
    if len(normals) < vertex_count or not vertex_count:
        return mesh
    return replace(mesh, normals=normals.done(), normal=mesh.corners)


def _shades(columns: FloatArray, keyword: bytes) -> FloatArray | None:
    """Return (r, 4) the colours in the columns after positions and normals, alpha NaN without one; None if none."""
    count = columns.shape[1] - 2 * (b"S" in keyword)
    if b"C" not in keyword or count not in (3, 4):
        return None
    return np.pad(columns[:, :count], ((0, 0), (0, 4 - count)), constant_values=np.nan)


def _polygons(block: TextBlock, rows: IntArray) -> tuple[IntArray, IntArray]:
    """Return the sizes and the corners of the polygons in some lines."""
    sizes = block.words(rows, stop=1).integers("a number of corners")
    # A colour may follow the corners; its numbers need not be integers.
    words = block.words(rows, first=1, stop=1 + np.maximum(sizes, 0))
    corners = words.integers()
    short = words.counts != sizes
    if short.any():
        i = int(np.argmax(short))
        if sizes[i] < 0:
            block.fail(int(rows[i]), f"a face has {sizes[i]} corners")
        block.fail(int(rows[i]), f"a face of {sizes[i]} corners names {words.counts[i]} vertices")
    return sizes, corners


def _header(path: Path, content: bytes) -> tuple[int, int, int, bytes]:
    """Return the numbers of vertices and faces, the position after the header, and the keyword in capitals."""
    lines = _filled_lines(content)
    number, first, end = next(lines, (0, b"", 0))
    if not first:
        raise MeshFileError(f"{path} is not an OFF file: it contains only comments")
    keyword = _HEADER.match(first)
    if keyword:
        if keyword.group(4) or keyword.group(5):
            raise MeshFileError(f"{path}: OFF with points of a dimension other than 3 is not supported")
        first = first[keyword.end() :].strip()
        if first.upper().startswith(b"BINARY"):
            raise MeshFileError(f"{path} is a binary OFF file, which is not supported; convert it to text")
    if not first:
        number, first, end = next(lines, (number, first, end))
    words = first.split()
    try:
        vertex_count, face_count = int(words[0]), int(words[1])
    except (ValueError, IndexError):
        raise MeshFileError(
            f"{path}, line {number}: not an OFF file, expected the numbers of vertices and faces"
        ) from None
    if vertex_count < 0 or face_count < 0:
        raise MeshFileError(f"{path}, line {number}: the number of vertices or faces is negative")
    # The letters before "OFF" tell what lines of vertices have.
    return vertex_count, face_count, end, b"" if keyword is None else keyword[0].upper().removesuffix(b"OFF")


def _filled_lines(content: bytes) -> Iterator[tuple[int, bytes, int]]:
    """Yield the number, the text without comment and the end position of each line that is not blank."""
    for number, line in enumerate(_LINE.finditer(content), 1):
        text = line[1].partition(b"#")[0].strip()
        if text:
            yield number, text, line.end()
