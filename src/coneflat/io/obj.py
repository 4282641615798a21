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
from .attributes import GROUPS, MATERIALS, OBJECTS, VERTEX_COLOURS, Attribute, colour_shades
from .convex_pieces import find_pieces
from .files import inner_path, moved_path, read_bytes
from .mesh_file import MeshFile, check_filled, offsets_of
from .text import Growing, TextBlock, newline_of, text_blocks

_OTHER, _VERTEX, _FACE, _TEXTURE, _NORMAL, _ELEMENT, _COMMENTED_FACE = range(7)
#: The kind of a line by its first two characters as a 16-bit number.
_KINDS = np.full(1 << 16, _OTHER, np.uint8)
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
    vertices, colours, directions = (Growing(np.float64, 3) for _ in range(3))
    corners, textures, normals, sizes = (Growing(np.int64) for _ in range(4))
    uv = Growing(np.float64, 2)
    gaps: defaultdict[int, bytearray] = defaultdict(bytearray)
    lengths: set[int] = set()
    for block in text_blocks(path, content, continued=True):
        kinds = _KINDS[block.heads()]
        points = block.words(np.flatnonzero(kinds == _VERTEX), first=1).points()
        rows = np.flatnonzero(kinds == _FACE)
        words = block.words(rows, first=1)
        counts = words.counts
        position, texture, normal = words.corners()
        del words  # free its text before the next block is read
        above = len(vertices) + np.cumsum(kinds == _VERTEX)[rows]
        for polygon, text in _texts(block, kinds, newline):
            gaps[len(sizes) + polygon] += text
        vertices.add(points[:, :3])
        # Many programs write a colour after the position.
        if points.shape[1] in (6, 7):
            colours.add(points[:, 3:6])
        lengths.update(np.unique(block.counts[kinds == _VERTEX] - 1).tolist())
        sizes.add(counts)
        if texture is not None:
            beyond = len(uv) + np.cumsum(kinds == _TEXTURE)[rows]
            counted = np.repeat(beyond, counts) + texture
            # -1 means that there is no UV point; an index that counts back too far becomes -2, which is an error.
            texture = np.where(texture < 0, np.where(counted < 0, -2, counted), texture - 1)
        uv.add(_uv_points(block, np.flatnonzero(kinds == _TEXTURE)))
        if normal is not None:
            beyond = len(directions) + np.cumsum(kinds == _NORMAL)[rows]
            normal = np.where(normal < 0, np.repeat(beyond, counts) + normal + 1, normal)
        directions.add(_directions(block, np.flatnonzero(kinds == _NORMAL)))
        for indices, block_indices, none in ((textures, texture, -1), (normals, normal, 0)):
            if block_indices is not None:
                indices.add(np.full(len(corners) - len(indices), none))
                indices.add(block_indices)
        # A negative index counts back from the last vertex above the face.
        corners.add(np.where(position < 0, np.repeat(above, counts) + position, position - 1))
    check_filled(path, len(vertices), len(sizes))
    for indices, none in ((textures, -1), (normals, 0)):
        if len(indices):
            indices.add(np.full(len(corners) - len(indices), none))
    has_colours = len(colours) == len(vertices)
    obj_text = ObjText({polygon: bytes(gaps.pop(polygon)) for polygon in list(gaps)}, newline)
    mesh = MeshFile(
        path,
        vertices=vertices.done(),
        corners=corners.done(),
        offsets=offsets_of(sizes.done()),
        obj=obj_text,
        properties=dict(zip(COLOURS, colour_shades(colours.done()).T, strict=True)) if has_colours else {},
        attributes=_attributes(obj_text, lengths),
        texture=textures.done() if len(textures) else None,
        # Some programs write indices of UV points, but not the points.
        uv=uv.done() if len(textures) and len(uv) else None,
        normals=directions.done(),
        normal=normals.done() - 1 if len(normals) else None,
    )
    _check_corners(path, content, mesh)
    return mesh


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
    kinds = np.where((kinds == _VERTEX) | (kinds == _NORMAL), _OTHER, kinds)
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
