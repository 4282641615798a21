"""Reader for OFF files, which keeps polygons."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..base.arrays import FloatArray, IntArray
from ..errors import MeshFileError
from ..mesh.polygons import COLOURS
from .attributes import ALPHA, VERTEX_COLOURS, Attribute
from .colours import colour_shades
from .mesh_file import MeshFile, offsets_of
from .text import Growing, TextBlock, text_blocks

# Colours and texture coordinates follow the position and normal; "4" and "n" change the dimension of the position.
_HEADER = re.compile(rb"(ST)?(C)?(N)?(4)?(n)?OFF\b", re.IGNORECASE)
_LINE = re.compile(rb"([^\r\n]*)(?:\r\n|[\r\n]|\Z)")


class _Header(NamedTuple):
    """The header of an OFF file.

    Attributes:
        vertices, faces: their numbers.
        end: the position after it.
        letters: those before "OFF", in capitals: what lines of vertices have after the position.
    """

    vertices: int
    faces: int
    end: int
    letters: bytes

    @property
    def has_normals(self) -> bool:
        return b"N" in self.letters

    @property
    def has_colours(self) -> bool:
        return b"C" in self.letters

    @property
    def has_uv(self) -> bool:
        return b"S" in self.letters


def is_off(content: bytes) -> bool:
    """Return True if a file begins with the keyword of OFF."""
    return _HEADER.match(next((line for _, line, _ in _filled_lines(content[:4096])), b"")) is not None


def parse_off(path: Path, content: bytes) -> MeshFile:
    """Return the mesh of an OFF file: OFF, COFF, NOFF, STOFF and their combinations, in text.

    Raises:
        MeshFileError: the file is not OFF, has fewer elements than its header declares, or has text for a number.
    """
    header = _header(path, content)
    elements = _Elements(header)
    for block in text_blocks(path, content, header.end):
        elements.add(block)
    return elements.mesh(path)


class _Elements:
    """The elements of an OFF file, which are added block after block of its text."""

    def __init__(self, header: _Header) -> None:
        self._header = header
        self._vertices, self._normals, self._colours = (Growing(np.float64, k) for k in (3, 3, 4))
        self._sizes, self._corners = Growing(np.int64), Growing(np.int64)
        self._lines = 0
        self._attributes = dict[Attribute, None]()

    def add(self, block: TextBlock) -> None:
        """Add the elements of a block of text."""
        rows = np.flatnonzero(block.counts)
        ends = np.array([self._header.vertices, self._header.vertices + self._header.faces]) - self._lines
        of_vertices, of_faces = np.clip(ends, 0, len(rows))
        self._add_vertices(block, rows[:of_vertices])
        self._add_faces(block, rows[of_vertices:of_faces])
        self._lines += len(rows)

    def _add_vertices(self, block: TextBlock, rows: IntArray) -> None:
        """Add the vertices in some lines of a block, with their normals and colours."""
        header, points = self._header, block.words(rows).points()
        self._vertices.add(points[:, :3])
        if header.has_normals and points.shape[1] >= 6:
            self._normals.add(points[:, 3:6])
        shades = _shades(points[:, 3 + 3 * header.has_normals :], header)
        if shades is not None:
            self._colours.add(shades)
        columns_before_colours = 3 + 3 * header.has_normals + 2 * header.has_uv
        if (block.counts[rows] > columns_before_colours).any():
            self._attributes[VERTEX_COLOURS] = None

    def _add_faces(self, block: TextBlock, rows: IntArray) -> None:
        """Add the faces in some lines of a block."""
        sizes, corners = _polygons(block, rows)
        if (block.counts[rows] > 1 + sizes).any():
            self._attributes[Attribute("face colours")] = None
        self._sizes.add(sizes)
        self._corners.add(corners)

    def mesh(self, path: Path) -> MeshFile:
        """Return the mesh of all elements.

        Raises:
            MeshFileError: there are fewer than the header declares.
        """
        vertex_count, face_count = self._header.vertices, self._header.faces
        read_faces = self._lines - vertex_count
        if read_faces < 0:
            raise MeshFileError(
                f"{path} ends after {self._lines} of the {vertex_count} vertices in its header"
            )
        if read_faces < face_count:
            raise MeshFileError(f"{path} ends after {read_faces} of the {face_count} faces in its header")
        properties: dict[str, FloatArray] = {}
        if len(self._colours) == vertex_count > 0:
            properties = _colours_by_name(self._colours.done())
        alpha = {ALPHA: None} if ALPHA.name in properties else {}
        mesh = MeshFile(
            path,
            self._vertices.done(),
            self._corners.done(),
            offsets_of(self._sizes.done()),
            properties=properties,
            attributes=tuple(self._attributes | alpha),
        )
        if len(self._normals) < vertex_count or not vertex_count:
            return mesh
        return replace(mesh, normals=self._normals.done(), normal=mesh.corners)


def _colours_by_name(shades: FloatArray) -> dict[str, FloatArray]:
    """Return (n, 4) colours as vertex properties from 0 to 1; without alpha if a vertex has none, which is NaN."""
    has_alpha = not np.isnan(shades[:, 3]).any()
    shades = colour_shades(shades if has_alpha else shades[:, :3])
    return dict(zip((*COLOURS, ALPHA.name), shades.T, strict=False))


def _shades(columns: FloatArray, header: _Header) -> FloatArray | None:
    """Return (r, 4) the colours in the columns after positions and normals, alpha NaN without one; None if none."""
    count = columns.shape[1] - 2 * header.has_uv
    if not header.has_colours or count not in (3, 4):
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


def _header(path: Path, content: bytes) -> _Header:
    """Return the header of a file.

    Raises:
        MeshFileError: it is not one of an OFF file in text with points in three dimensions.
    """
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
    letters = b"" if keyword is None else keyword[0].upper().removesuffix(b"OFF")
    return _Header(vertex_count, face_count, end, letters)


def _filled_lines(content: bytes) -> Iterator[tuple[int, bytes, int]]:
    """Yield the number, the text without comment and the end position of each line that is not blank."""
    for number, line in enumerate(_LINE.finditer(content), 1):
        text = line[1].partition(b"#")[0].strip()
        if text:
            yield number, text, line.end()
