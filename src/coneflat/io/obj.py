"""Wavefront OBJ: a reader, and a writer that outputs the input's text with new texture coordinates.

This package has its own parser, because no library keeps all data that the output must reproduce: the numbering of
vertices, polygons, groups, materials and comments.
"""

from __future__ import annotations

import os
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..errors import ConeflatError, FaceIndexError, MeshFileError
from ..mesh.polygons import COLOURS, first_bad_corner
from ..result import Flattening
from .attributes import GROUPS, MATERIALS, OBJECTS, VERTEX_COLOURS, Attribute
from .colours import colour_shades
from .convex_pieces import find_pieces
from .files import inner_path, moved_path, read_bytes
from .mesh_file import MeshFile, check_filled, offsets_of
from .text import Growing, TextBlock, newline_of, text_blocks

#: Indices of corners without a UV point, from 0, and without a normal, from 1.
_NO_UV, _NO_NORMAL = -1, 0
_IGNORED, _VERTEX, _FACE, _TEXTURE, _NORMAL, _ELEMENT, _COMMENTED_FACE = range(7)
#: The kind of a line by its first two characters as a 16-bit number.
_KINDS = np.full(1 << 16, _IGNORED, np.uint8)
_HEADS = {b"v ": _VERTEX, b"f ": _FACE, b"l ": _ELEMENT, b"p ": _ELEMENT, b"vt": _TEXTURE, b"vn": _NORMAL}
_KINDS[[int.from_bytes(head, "big") for head in _HEADS]] = [*_HEADS.values()]
_TEXTURE_INDICES = re.compile(rb"(#[^\r\n]*)|/[-+0-9]*")
_MATERIALS = re.compile(rb"(?m)^([ \t]*mtllib[ \t]+)([^\r\n]*?)(?=[ \t]*\r?$)")
_TEXTURE_MAP = re.compile(rb"(?im)^[ \t]*(map_\w+|bump|norm|disp|decal)[ \t]")
_STATEMENT = re.compile(rb"(?m)^[ \t]*([A-Za-z_]+)(?![^ \t\r\n])")
#: Statements of the data that an OBJ has in addition to its mesh.
_STATEMENTS = {
    GROUPS: (b"g",),
    OBJECTS: (b"o",),
    MATERIALS: (b"usemtl", b"mtllib"),
    Attribute("lines and points"): (b"l", b"p"),
    Attribute("curves and surfaces"): (b"curv", b"curv2", b"surf", b"cstype", b"vp"),
}
#: Number of lines written at a time: their numbers take some MB as Python objects.
_LINES = 1 << 15


@dataclass(frozen=True)
class ObjText:
    """The content of an OBJ file in addition to its polygons.

    Attributes:
        gaps: the text before the line of polygon i, verbatim except for texture coordinates, which are left out; the
            text after the last polygon has the number of polygons as key.
        newline: the line ending of the file.
    """

    gaps: Mapping[int, bytes]
    newline: bytes

    def without_polygons(self, is_left_out: BoolArray) -> ObjText:
        """Return the text without some polygons, (p,); the text before them is kept."""
        number = np.append(0, np.cumsum(~is_left_out))
        gaps: defaultdict[int, bytes] = defaultdict(bytes)
        for polygon in sorted(self.gaps):
            gaps[int(number[polygon])] += self.gaps[polygon]
        return replace(self, gaps=dict(gaps))


def parse_obj(path: Path, content: bytes) -> MeshFile:
    """Return the mesh of an OBJ file.

    The weight w after the coordinates is ignored; it is kept in the text.

    Raises:
        EmptyMeshError: there is no vertex or no face.
        MeshFileError: a `v`, `vt` or `f` line is invalid.
        FaceIndexError: a face refers to vertex 0, or to a vertex or UV point that does not exist.
    """
    newline = newline_of(content)
    elements = _Elements(newline)
    for block in text_blocks(path, content, continued=True):
        elements.add(block)
    check_filled(path, len(elements.vertices), len(elements.sizes))
    mesh = elements.mesh(path)
    _check_corners(path, content, mesh)
    return mesh


class _Elements:
    """The elements of an OBJ file, which are added block after block of its text.

    Attributes:
        vertices, colours: (n, 3) positions, and the colours after them.
        uv, directions: (u, 2), (k, 3) UV points and normals.
        sizes: (p,) number of corners of each face.
        corners, textures, normals: (c,) index of the vertex, from 0, of the UV point, from 0 and -1 for none, and of
            the normal, from 1 and 0 for none, at each corner; the latter two end at the last face that has them.
        gaps: as in `ObjText`.
        lengths: the numbers of words of `v` lines.
    """

    def __init__(self, newline: bytes) -> None:
        self.vertices, self.colours, self.directions = (Growing(np.float64, 3) for _ in range(3))
        self.corners, self.textures, self.normals, self.sizes = (Growing(np.int64) for _ in range(4))
        self.uv = Growing(np.float64, 2)
        self.gaps: defaultdict[int, bytearray] = defaultdict(bytearray)
        self.lengths: set[int] = set()
        self._newline = newline

    def add(self, block: TextBlock) -> None:
        """Add the elements of a block of text."""
        kinds = _KINDS[block.heads()]
        points = block.words(np.flatnonzero(kinds == _VERTEX), first=1).points()
        for polygon, text in _texts(block, kinds, self._newline):
            self.gaps[len(self.sizes) + polygon] += text
        self._add_faces(block, kinds)
        self.vertices.add(points[:, :3])
        # Many programs write a colour after the position.
        if points.shape[1] in (6, 7):
            self.colours.add(points[:, 3:6])
        self.lengths.update(np.unique(block.counts[kinds == _VERTEX] - 1).tolist())
        self.uv.add(_uv_points(block, np.flatnonzero(kinds == _TEXTURE)))
        self.directions.add(_directions(block, np.flatnonzero(kinds == _NORMAL)))

    def _add_faces(self, block: TextBlock, kinds: NDArray[np.uint8]) -> None:
        """Add the faces of a block; a negative index counts back from the last element above the face."""
        rows = np.flatnonzero(kinds == _FACE)
        words = block.words(rows, first=1)
        counts = words.counts
        position, texture, normal = words.corners()

        def above(elements: Growing, kind: int) -> IntArray:
            return np.repeat(len(elements) + np.cumsum(kinds == kind)[rows], counts)

        if texture is not None:
            counted = above(self.uv, _TEXTURE) + texture
            # -1 means that there is no UV point; an index that counts back too far becomes -2, which is an error.
            texture = np.where(texture < 0, np.where(counted < 0, -2, counted), texture - 1)
            self._add_at_corners(self.textures, texture, _NO_UV)
        if normal is not None:
            normal = np.where(normal < 0, above(self.directions, _NORMAL) + normal + 1, normal)
            self._add_at_corners(self.normals, normal, _NO_NORMAL)
        self.sizes.add(counts)
        self.corners.add(np.where(position < 0, above(self.vertices, _VERTEX) + position, position - 1))

    def _add_at_corners(self, indices: Growing, added: IntArray, missing: int) -> None:
        """Add indices of the corners of a block, after corners before it that have none."""
        indices.add(np.full(len(self.corners) - len(indices), missing))
        indices.add(added)

    def mesh(self, path: Path) -> MeshFile:
        """Return the mesh of all elements."""
        for indices, missing in ((self.textures, _NO_UV), (self.normals, _NO_NORMAL)):
            if len(indices):
                indices.add(np.full(len(self.corners) - len(indices), missing))
        properties = {}
        if len(self.colours) == len(self.vertices):
            properties = dict(zip(COLOURS, colour_shades(self.colours.done()).T, strict=True))
        text = ObjText({polygon: bytes(self.gaps.pop(polygon)) for polygon in list(self.gaps)}, self._newline)
        return MeshFile(
            path,
            vertices=self.vertices.done(),
            corners=self.corners.done(),
            offsets=offsets_of(self.sizes.done()),
            obj=text,
            properties=properties,
            attributes=_attributes(text, self.lengths),
            texture=self.textures.done() if len(self.textures) else None,
            # Some programs write indices of UV points, but not the points.
            uv=self.uv.done() if len(self.textures) and len(self.uv) else None,
            normals=self.directions.done(),
            normal=self.normals.done() - 1 if len(self.normals) else None,
        )


def _attributes(text: ObjText, lengths: set[int]) -> tuple[Attribute, ...]:
    """Return the data of a file in addition to its mesh.

    lengths: the different numbers of words after `v`.
    """
    words = {word.lower() for gap in text.gaps.values() for word in _STATEMENT.findall(gap)}
    attributes = [attribute for attribute, names in _STATEMENTS.items() if not words.isdisjoint(names)]
    attributes += [VERTEX_COLOURS] if lengths & {6, 7} else []
    return (*attributes, *([Attribute("weights of vertices")] if lengths - {3, 6} else []))


def kept_in_obj(source: MeshFile) -> set[Attribute]:
    """Return the attributes of a source file that `write_obj` keeps: those of an OBJ."""
    return set() if source.obj is None else set(source.attributes)


def obj_has_textures(source: MeshFile) -> bool:
    """Return whether the materials of a source file have textures of its UVs, which `write_obj` keeps."""
    if source.obj is None or source.uv is None:
        return False
    folder = source.path.parent
    for gap in source.obj.gaps.values():
        for _, names in _MATERIALS.findall(gap) if b"mtllib" in gap else ():
            for name in _library_names(names, folder):
                with suppress(ConeflatError):
                    if _TEXTURE_MAP.search(read_bytes(inner_path(folder, os.fsdecode(name)))):
                        return True
    return False


def _library_names(names: bytes, folder: str | Path) -> list[bytes]:
    """Return the files of a line of material libraries: several names, or one with blanks if such a file exists."""
    return [names] if os.path.exists(os.path.join(os.fsencode(folder), names)) else names.split()


def _uv_points(block: TextBlock, rows: IntArray) -> FloatArray:
    """Return (k, 2) the points of `vt` lines; v is 0 if a line has only one number, and a third is ignored."""
    words = block.words(rows, first=1)
    if len(rows) and words.counts.min() < 1:
        block.fail(int(rows[np.argmin(words.counts)]), "a UV point needs at least 1 number, but has none")
    numbers, first = words.floats(), np.cumsum(words.counts) - words.counts
    second = np.where(words.counts > 1, np.append(numbers, 0)[first + 1], 0)
    return np.stack([numbers[first], second], axis=1)


def _directions(block: TextBlock, rows: IntArray) -> FloatArray:
    """Return (r, 3) the normals in some lines; all NaN if one is invalid, as normals are optional."""
    try:
        return block.words(rows, first=1).points()[:, :3]
    except MeshFileError:
        return np.full((len(rows), 3), np.nan)


def _texts(block: TextBlock, kinds: NDArray[np.uint8], newline: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield pieces of a block's text for `ObjText.gaps`, each with the number of polygons of the block before it."""
    polygons = np.cumsum(kinds == _FACE)
    kinds = np.where((kinds == _VERTEX) | (kinds == _NORMAL), _IGNORED, kinds)
    if b"#" in block.raw:
        marks = np.flatnonzero(np.frombuffer(block.raw, np.uint8) == ord("#"))
        rows = np.searchsorted(block.line_starts, marks, side="right") - 1
        kinds[rows[kinds[rows] == _FACE]] = _COMMENTED_FACE
    runs = np.flatnonzero((np.diff(kinds, prepend=-1) != 0) | (np.diff(polygons, prepend=-1) != 0))
    starts = block.line_starts[np.append(runs, len(kinds))]
    is_text = (kinds[runs] != _FACE) & (kinds[runs] != _TEXTURE)
    for i in np.flatnonzero(is_text).tolist():
        kind, text = kinds[runs[i]], block.raw[starts[i] : starts[i + 1]]
        if kind == _ELEMENT:
            # Indices of texture coordinates are removed, as the new ones differ.
            text = _TEXTURE_INDICES.sub(rb"\1", text)
        elif kind == _COMMENTED_FACE:
            text = text[text.index(b"#") :].rstrip(b"\r\n") + newline
        yield int(polygons[runs[i]]), text


def _check_corners(path: Path, content: bytes, mesh: MeshFile) -> None:
    """Raise FaceIndexError for the first corner with an invalid index of a vertex or UV point."""
    c = first_bad_corner(mesh.corners, len(mesh.vertices))
    if c is not None:
        line, index = _corner_line(path, content, c, 0)
        reason = "OBJ counts from 1" if index == 0 else f"there are {len(mesh.vertices)} vertices"
        raise FaceIndexError(f"{path}, line {line}: a face refers to vertex {index}, but {reason}")
    if mesh.texture is None or mesh.uv is None:
        return
    c = first_bad_corner(np.where(mesh.texture == -1, 0, mesh.texture), len(mesh.uv))
    if c is not None:
        line, index = _corner_line(path, content, c, 1)
        raise FaceIndexError(
            f"{path}, line {line}: a face refers to UV point {index}, but there are {len(mesh.uv)} (vt lines)"
        )


def _corner_line(path: Path, content: bytes, c: int, part: int) -> tuple[int, int]:
    """Return the line number of corner c, and the index there of its vertex (part 0) or UV point (part 1)."""
    for block in text_blocks(path, content, continued=True):
        rows = np.flatnonzero(_KINDS[block.heads()] == _FACE)
        words = block.words(rows, first=1)
        if c < words.counts.sum():
            numbers = words.corners()[part]
            row = int(rows[np.searchsorted(np.cumsum(words.counts), c, side="right")])
            return block.line_number(row), 0 if numbers is None else int(numbers[c])
        c -= int(words.counts.sum())
    raise AssertionError("there is no such corner")


def write_obj(result: Flattening, stream: IO[bytes], folder: Path) -> None:
    """Write a result as OBJ.

    If the mesh was read from an OBJ file, all lines of that file are kept in their order, except for old texture
    coordinates: the new ones are written before the first face, and each face line refers to them in addition to the
    file's vertex and normal indices. Polygons are kept; those with repaired orientation are reversed, and those that
    the repair dropped are left out. A polygon that is not convex in the plane, is cut by a seam, or was partly dropped,
    is written in convex pieces. For a mesh from another file, its vertices, polygons and normals are written. Paths of
    material libraries are rewritten relative to `folder`.

    Args:
        result: the result to write.
        stream: a binary file.
        folder: folder of the file, for paths of material libraries.
    """
    source, text, normals, normal = result.source, ObjText({}, b"\n"), None, None
    vertices, faces, face_corners = result.vertices, result.faces, result.face_corners
    if source is not None and face_corners is not None:
        vertices, offsets, numbers = source.vertices, source.offsets, source.corners + 1
        normals, normal = source.normals, source.normal
        if source.obj is not None:
            # The text contains the vertices of the file, including merged ones.
            numbers = numbers if source.unwelded is None else source.unwelded + 1
            text = relocated(source.obj, source.path.parent, folder)
    else:
        source, numbers = None, faces.reshape(-1) + 1
        offsets = np.arange(0, len(numbers) + 1, 3)
        face_corners = np.arange(len(numbers)).reshape(-1, 3)
    to_write = find_pieces(result, offsets, face_corners)
    columns = [numbers[to_write.corners], to_write.points + 1]
    if normal is not None:
        columns.append(normal[to_write.corners] + 1)
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
    """Yield text with a line for each of (r, k) rows, with the fewest digits from which the same numbers are read."""
    line = begin + " %r" * rows.shape[1] + newline.decode()
    for i in range(0, len(rows), _LINES):
        block = rows[i : i + _LINES]
        yield (line * len(block) % tuple(block.ravel().tolist())).encode()


def _face_lines(sizes: IntArray, rows: IntArray, newline: bytes) -> bytes:
    """Return the lines of faces, with one row of indices for each corner; a normal of 0 is left out."""
    corner, end = " " + "/".join(["%d"] * rows.shape[1]), newline.decode()
    lines = "".join(["f" + corner * size + end for size in sizes.tolist()])
    text = (lines % tuple(rows.ravel().tolist())).encode()
    return text.replace(b"/0 ", b" ").replace(b"/0" + newline, newline)


def _ended(text: bytes, newline: bytes, is_last: bool) -> bytes:
    """Return text that ends with a newline, unless it is empty or the last."""
    return text + newline if text and not is_last and not text.endswith((b"\n", b"\r")) else text


def relocated(text: ObjText, source_folder: Path, target_folder: Path) -> ObjText:
    """Return the text with paths of material libraries rewritten relative to another folder."""
    source, target = os.path.realpath(source_folder), os.path.realpath(target_folder)
    if source == target:
        return text

    def line(match: re.Match[bytes]) -> bytes:
        return match[1] + b" ".join(
            moved_path(name, source, target) for name in _library_names(match[2], source)
        )

    gaps = {i: _MATERIALS.sub(line, gap) if b"mtllib" in gap else gap for i, gap in text.gaps.items()}
    return replace(text, gaps=gaps)
