"""Reading Wavefront OBJ.

An own parser, because no library keeps all of what the output has to reproduce: the file's numbering of
vertices, its polygons, groups, materials and comments.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import FloatArray, IntArray
from ..errors import EmptyMeshError, FaceIndexError, MeshFileError
from ..mesh.polygons import COLOURS, first_bad_corner
from .mesh_file import MeshFile
from .raw import NO_UV, offsets_of
from .text import Growing, TextBlock, newline_of, text_blocks

_OTHER, _VERTEX, _FACE, _TEXTURE, _NORMAL, _ELEMENT, _COMMENTED_FACE = range(7)
#: By the first two characters of a line, as a 16-bit number, what it is.
_KINDS = np.full(1 << 16, _OTHER, np.uint8)
for _head, _kind in (
    (b"v ", _VERTEX),
    (b"f ", _FACE),
    (b"l ", _ELEMENT),
    (b"p ", _ELEMENT),
    (b"vt", _TEXTURE),
    (b"vn", _NORMAL),
):
    _KINDS[int.from_bytes(_head, "big")] = _kind
#: Instead of the number of a UV point that counts back beyond the first.
_NO_SUCH_UV = -2
_TEXTURE_INDICES = re.compile(rb"(#[^\r\n]*)|/[-+0-9]*")


@dataclass(frozen=True)
class ObjText:
    """What an OBJ file holds besides its polygons.

    Attributes:
        gaps: the text that stands before the line of polygon i, verbatim but for the texture coordinates,
            which are left out; the number of polygons is the key of what follows the last.
        normals: (c,) the number of the normal at every polygon corner as the file gives it (it may count
            backwards), 0 where there is none; None where no corner has one.
        newline: how the file ends its lines.
    """

    gaps: Mapping[int, bytes]
    normals: IntArray | None
    newline: bytes


def parse_obj(path: Path, content: bytes) -> MeshFile:
    """Return the mesh of an OBJ file.

    The weight w behind the coordinates is not used; it survives in the text.

    Raises:
        EmptyMeshError: there is no vertex or no face.
        MeshFileError: a `v`, `vt` or `f` line is not what it should be.
        FaceIndexError: a face names vertex 0, or a vertex or UV point that does not exist.
    """
    newline = newline_of(content)
    vertices, colours, directions = (Growing(np.float64, 3) for _ in range(3))
    corners, textures, normals, shading, sizes = (Growing(np.int64) for _ in range(5))
    uv = Growing(np.float64, 2)
    gaps: defaultdict[int, bytearray] = defaultdict(bytearray)
    for block in text_blocks(path, content, continued=True):
        kinds = _KINDS[block.heads()]
        points = block.words(np.flatnonzero(kinds == _VERTEX), first=1).points()
        counts, given, texture, normal = _faces(block, kinds)
        above = len(vertices) + np.cumsum(kinds == _VERTEX)[kinds == _FACE]
        for polygon, text in _texts(block, kinds, newline):
            gaps[len(sizes) + polygon] += text
        vertices.add(points[:, :3])
        # Many programs write a colour behind the position.
        if points.shape[1] in (6, 7):
            colours.add(points[:, 3:6])
        sizes.add(counts)
        if texture is not None:
            beyond = len(uv) + np.cumsum(kinds == _TEXTURE)[kinds == _FACE]
            counted = np.repeat(beyond, counts) + texture
            # A number that counts back beyond the first is no sign that there is none.
            texture = np.where(texture < 0, np.where(counted < 0, _NO_SUCH_UV, counted), texture - 1)
        uv.add(_uv_points(block, np.flatnonzero(kinds == _TEXTURE)))
        shade = normal
        if normal is not None:
            beyond = len(directions) + np.cumsum(kinds == _NORMAL)[kinds == _FACE]
            shade = np.where(normal < 0, np.repeat(beyond, counts) + normal + 1, normal)
        directions.add(_directions(block, np.flatnonzero(kinds == _NORMAL)))
        for known, found, none in ((textures, texture, NO_UV), (normals, normal, 0), (shading, shade, 0)):
            if found is not None:
                known.add(np.full(len(corners) - len(known), none))
                known.add(found)
        # A negative number counts back from the vertices that stand above the face.
        corners.add(np.where(given < 0, np.repeat(above, counts) + given, given - 1))
    if not len(vertices):
        raise EmptyMeshError(f"{path} has no vertices")
    if not len(sizes):
        raise EmptyMeshError(f"{path} has no faces")
    for known, none in ((textures, NO_UV), (normals, 0), (shading, 0)):
        if len(known):
            known.add(np.full(len(corners) - len(known), none))
    has_colours = len(colours) == len(vertices)
    mesh = MeshFile(
        path,
        vertices=vertices.done(),
        corners=corners.done(),
        offsets=offsets_of(sizes.done()),
        obj=ObjText(
            gaps={polygon: bytes(gaps.pop(polygon)) for polygon in list(gaps)},
            normals=normals.done() if len(normals) else None,
            newline=newline,
        ),
        properties=dict(zip(COLOURS, colours.done().T, strict=True)) if has_colours else {},
        texture=textures.done() if len(textures) else None,
        # Some programs number UV points that they do not write.
        uv=uv.done() if len(textures) and len(uv) else None,
        normals=directions.done(),
        normal=shading.done() - 1 if len(shading) else None,
    )
    _check_corners(path, content, mesh)
    return mesh


def _uv_points(block: TextBlock, rows: IntArray) -> FloatArray:
    """Return (k, 2) the points of `vt` lines; v is 0 where a line has but one number, and a third is left out."""
    words = block.words(rows, first=1)
    if len(rows) and words.counts.min() < 1:
        block.fail(int(rows[np.argmin(words.counts)]), "a UV point needs at least 1 number, but has none")
    numbers, first = words.floats(), np.cumsum(words.counts) - words.counts
    points = np.zeros((len(rows), 2))
    points[:, 0] = numbers[first]
    has_v = words.counts > 1
    points[has_v, 1] = numbers[first[has_v] + 1]
    return points


def _faces(
    block: TextBlock, kinds: NDArray[np.uint8]
) -> tuple[IntArray, IntArray, IntArray | None, IntArray | None]:
    """Return (p,) sizes of a block's polygons, (c,) vertex numbers, UVs and normals of their corners."""
    rows = np.flatnonzero(kinds == _FACE)
    words = block.words(rows, first=1)
    if len(rows) and words.counts.min() < 3:
        i = int(np.argmax(words.counts < 3))
        block.fail(int(rows[i]), f"a face needs at least 3 corners, but has {words.counts[i]}")
    return words.counts, *words.corners()


def _directions(block: TextBlock, rows: IntArray) -> FloatArray:
    """Return (r, 3) the normals in some lines; NaN if one of them is not of three numbers, which nothing hangs on."""
    try:
        return block.words(rows, first=1).points()[:, :3]
    except MeshFileError:
        return np.full((len(rows), 3), np.nan)


def _texts(block: TextBlock, kinds: NDArray[np.uint8], newline: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield what `ObjText.gaps` keeps of a block, in pieces, each with the polygons of the block before it."""
    polygons = np.cumsum(kinds == _FACE)
    kinds = np.where((kinds == _VERTEX) | (kinds == _NORMAL), _OTHER, kinds)
    if b"#" in block.raw:
        marks = np.flatnonzero(np.frombuffer(block.raw, np.uint8) == ord("#"))
        rows = np.searchsorted(block.line_starts, marks, side="right") - 1
        kinds[rows[kinds[rows] == _FACE]] = _COMMENTED_FACE
    runs = np.flatnonzero((np.diff(kinds, prepend=-1) != 0) | (np.diff(polygons, prepend=-1) != 0))
    starts = block.line_starts[np.append(runs, len(kinds))]
    kept = (kinds[runs] != _FACE) & (kinds[runs] != _TEXTURE)
    for i in np.flatnonzero(kept).tolist():
        kind, text = kinds[runs[i]], block.raw[starts[i] : starts[i + 1]]
        if kind == _ELEMENT:
            # The new texture coordinates have other numbers.
            text = _TEXTURE_INDICES.sub(rb"\1", text)
        elif kind == _COMMENTED_FACE:
            text = text[text.index(b"#") :].rstrip(b"\r\n") + newline
        yield int(polygons[runs[i]]), text


def _check_corners(path: Path, content: bytes, mesh: MeshFile) -> None:
    """Raise FaceIndexError for the first corner that names no vertex, or no UV point."""
    c = first_bad_corner(mesh.corners, len(mesh.vertices))
    if c is not None:
        line, given = _corner_line(path, content, c, 0)
        known = "OBJ counts from 1" if given == 0 else f"there are {len(mesh.vertices)} vertices"
        raise FaceIndexError(f"{path}, line {line}: a face names vertex {given}, but {known}")
    if mesh.texture is None or mesh.uv is None:
        return
    c = first_bad_corner(np.where(mesh.texture == NO_UV, 0, mesh.texture), len(mesh.uv))
    if c is not None:
        line, given = _corner_line(path, content, c, 1)
        raise FaceIndexError(
            f"{path}, line {line}: a face names UV point {given}, but there are {len(mesh.uv)} (vt lines)"
        )


def _corner_line(path: Path, content: bytes, c: int, part: int) -> tuple[int, int]:
    """Return the line in which corner c stands, and the number there of its vertex (part 0) or UV point (part 1)."""
    for block in text_blocks(path, content, continued=True):
        rows = np.flatnonzero(_KINDS[block.heads()] == _FACE)
        words = block.words(rows, first=1)
        if c < words.counts.sum():
            numbers = words.corners()[part]
            row = int(rows[np.searchsorted(np.cumsum(words.counts), c, side="right")])
            return block.line_number(row), 0 if numbers is None else int(numbers[c])
        c -= int(words.counts.sum())
    raise AssertionError("there is no such corner")
