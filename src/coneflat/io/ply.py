"""Reader for PLY files, text and binary, which keeps polygons, and writer for PLY.

This package has its own reader to keep polygons, all vertex properties and the UVs of corners, and to check the counts
in a header before memory is allocated.
"""

from __future__ import annotations

import os
import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import IO, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import FloatArray, IntArray
from ..errors import MeshFileError
from ..mesh.polygons import COLOURS
from ..result import Flattening
from .mesh_file import MeshFile, check_filled, offsets_of
from .split import source_normals, split_at_seams
from .text import Growing, text_blocks

#: The code of each type, in numpy and in struct.
_TYPES = {
    "char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I", "float": "f", "double": "d",
    "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "int64": "q", "uint64": "Q",
    "float32": "f", "float64": "d",
}  # fmt: skip
#: One property of an element in all rows.
Column: TypeAlias = "np.ndarray[tuple[int, ...], np.dtype[Any]]"

_CORNERS = ("vertex_indices", "vertex_index")
#: Names that programs use for a vertex's UV point, and for the list of those of a face's corners: u, v, u, v, ...
_VERTEX_UV = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"), ("u0", "v0"))
_FACE_UV = "texcoord"
#: The name of a face's image, as an index of those that comments in the header list.
_FACE_IMAGE = "texnumber"
_IMAGE_COMMENT = re.compile(rb"^comment[ \t]+TextureFile[ \t]+(.*?)[ \t]*$", re.IGNORECASE | re.MULTILINE)


@dataclass(frozen=True, eq=False)
class _Property:
    name: str
    kind: str  # numpy code of the value, or of a list's items; with the byte order once that is known
    count: str | None = None  # numpy code of a list's length, likewise


@dataclass(frozen=True, eq=False)
class _Element:
    name: str
    length: int
    properties: tuple[_Property, ...] = ()

    @cached_property
    def steps(self) -> list[tuple[int, struct.Struct | None]]:
        """Return for each property the bytes of the value or of an item, and the struct that reads a list's length."""
        sizes = (np.dtype(p.kind).itemsize for p in self.properties)
        counts = (struct.Struct(p.count) if p.count else None for p in self.properties)
        return list(zip(sizes, counts, strict=True))


def parse_ply(path: Path, content: bytes) -> MeshFile:
    """Return the mesh of a PLY file.

    Raises:
        MeshFileError: the file is not PLY, has fewer elements than its header declares, or has text for a number.
        EmptyMeshError: it has no vertex or no face.
    """
    form, elements, start = _header(path, content)
    images, image = _images(content[:start]), None
    if form == "ascii":
        # Converted to an array of doubles, the text is read by the same code as the binary forms; doubles represent
        # every possible index exactly.
        content, start = _text_values(path, content, start), 0
    vertices: FloatArray = np.empty((0, 3))
    sizes: IntArray = np.empty(0, np.int64)
    corners, properties, missing = sizes, dict[str, FloatArray](), {"vertex", "face"}
    texture, uv = None, None
    for element in elements:
        wanted = _wanted(path, element)
        try:
            columns, start = _decode(content, start, _stored(element, form), wanted)
        except _EndOfFile as error:
            raise MeshFileError(
                f"{path} ends before the {element.length} {element.name} elements in its header"
            ) from error
        if element.name == "vertex":
            names = [element.properties[i].name for i in wanted]
            vertices = np.stack([np.asarray(c, np.float64) for c in columns[:3]], axis=1)
            properties = {name: _shade(name, c) for name, c in zip(names[3:], columns[3:], strict=True)}
        elif element.name == "face":
            sizes, corners = columns[0].astype(np.int64), _as_integers(path, columns[1])
            if element.properties[wanted[-1]].name == _FACE_IMAGE:
                image = columns.pop().astype(np.int64)
            texture, uv = _corner_uv(path, sizes, *columns[2:]) if columns[2:] else (None, None)
        missing.discard(element.name)
        if not missing:
            break
    check_filled(path, len(vertices), len(sizes))

    def together(names: tuple[str, ...]) -> FloatArray | None:
        found = [properties[name] for name in names if name in properties]
        return np.stack(found, axis=1) if len(found) == len(names) else None

    if uv is None or not len(uv):
        uv = next((points for pair in _VERTEX_UV if (points := together(pair)) is not None), None)
        texture = None if uv is None else corners
    normals = together(("nx", "ny", "nz"))
    return MeshFile(
        path,
        vertices,
        corners,
        offsets_of(sizes),
        properties=properties,
        texture=texture,
        uv=uv,
        normals=normals,
        normal=None if normals is None else corners,
        images=images,
        # Without numbers, the first image is that of all faces.
        image=(np.zeros(len(sizes), np.int64) if image is None else image) if images else None,
    )


def _images(header: bytes) -> tuple[str, ...]:
    """Return the names of the image files that the comments of a header list."""
    # Some old files end lines with a single carriage return.
    return tuple(map(os.fsdecode, _IMAGE_COMMENT.findall(b"\n".join(header.splitlines()))))


def _corner_uv(path: Path, sizes: IntArray, counts: Column, numbers: Column) -> tuple[IntArray, FloatArray]:
    """Return (c,) the index of each corner's UV point and (u, 2) the points; a face may have an empty list.

    Raises:
        MeshFileError: a face's list does not have two numbers for each of its corners.
    """
    wrong = (counts != 0) & (counts != 2 * sizes)
    if wrong.any():
        face = int(np.argmax(wrong))
        raise MeshFileError(
            f"{path}: face {face} has {sizes[face]} corners and {int(counts[face])} numbers in '{_FACE_UV}', which "
            "needs two for each corner"
        )
    has_uv = np.repeat(counts != 0, sizes)
    texture = np.where(has_uv, np.cumsum(has_uv) - 1, -1)
    return texture, np.asarray(numbers, np.float64).reshape(-1, 2)


def _header(path: Path, content: bytes) -> tuple[str, list[_Element], int]:
    """Return the format, the elements, and the position after the header."""
    end = content.find(b"end_header")
    if not content.startswith(b"ply") or end < 0:
        raise MeshFileError(f"{path} is not a PLY file: it has no PLY header")
    lines = content[:end].splitlines()
    start = end + len(b"end_header")
    while content[start : start + 1] == b" ":
        start += 1
    # Some old files end lines with a single carriage return; then a line feed after it is data.
    start += 2 if content[start : start + 2] == b"\r\n" and b"\n" in content[:end] else 1

    form = ""
    elements: list[_Element] = []
    for i, line in enumerate(lines):
        words = line.decode("latin-1").split()
        try:
            if words[:1] == ["format"]:
                form = words[1]
            elif words[:1] == ["element"]:
                elements.append(_Element(words[1], int(words[2])))
                if elements[-1].length < 0:
                    raise ValueError("a negative count")
            elif words[:1] == ["property"]:
                if words[1] == "list":
                    new = _Property(words[4], _TYPES[words[3]], _TYPES[words[2]])
                else:
                    new = _Property(words[2], _TYPES[words[1]])
                elements[-1] = replace(elements[-1], properties=(*elements[-1].properties, new))
        except (IndexError, KeyError, ValueError) as error:
            raise MeshFileError(f"{path}, line {i + 1}: invalid line in a PLY header: {line!r}") from error
    if form not in ("ascii", "binary_little_endian", "binary_big_endian"):
        raise MeshFileError(f"{path} is not a PLY file: its header has no known format")
    return form, elements, start


def _wanted(path: Path, element: _Element) -> list[int]:
    """Return the indices of the properties of an element that are part of the mesh."""
    if element.name == "vertex":
        names = [p.name for p in element.properties]
        missing = [axis for axis in "xyz" if axis not in names]
        if missing:
            raise MeshFileError(f"{path}: its vertices have no property {missing[0]!r}")
        axes = [names.index(axis) for axis in "xyz"]
        return axes + [i for i, p in enumerate(element.properties) if i not in axes and not p.count]
    if element.name == "face":
        lists = [i for i, p in enumerate(element.properties) if p.count]
        named = [i for i in lists if element.properties[i].name in _CORNERS]
        if not named and (len(lists) != 1 or element.properties[lists[0]].name == _FACE_UV):
            raise MeshFileError(f"{path}: its faces have no list 'vertex_indices'")
        points = [i for i in lists if element.properties[i].name == _FACE_UV]
        images = [i for i, p in enumerate(element.properties) if p.name == _FACE_IMAGE and not p.count]
        return (named[:1] or lists) + points[:1] + images[:1]
    return []


def _shade(name: str, values: Column) -> FloatArray:
    """Return a property as doubles; colours, which are bytes in most files, are scaled to 0 to 1."""
    numbers = np.asarray(values, np.float64)
    return numbers / 255 if name in COLOURS and numbers.max(initial=0.0) > 1 else numbers


class _EndOfFile(Exception):
    """Signals that the file is shorter than its header declares."""


def _decode(content: bytes, start: int, element: _Element, wanted: list[int]) -> tuple[list[Column], int]:
    """Return the wanted columns of an element, a list as two columns (lengths, items), and its end position."""
    lists = [i for i, p in enumerate(element.properties) if p.count]
    first = _row(content, start, element)[1] if element.length else [0] * len(lists)
    lengths = dict(zip(lists, first, strict=True))
    fields: list[tuple[str, str] | tuple[str, str, int]] = []
    for i, p in enumerate(element.properties):
        fields += [(f"n{i}", p.count), (f"p{i}", p.kind, lengths[i])] if p.count else [(f"p{i}", p.kind)]
    row = np.dtype(fields)
    stop = start + element.length * row.itemsize
    if stop <= len(content):
        rows = np.frombuffer(content, row, element.length, start)
        if all(np.all(rows[f"n{i}"] == lengths[i]) for i in lists):
            columns: list[Column] = []
            for i in wanted:
                if i in lengths:
                    columns.append(np.full(element.length, lengths[i], dtype=np.int64))
                columns.append(rows[f"p{i}"].reshape(-1))
            return columns, stop
    if not lists or element.length > len(content):
        raise _EndOfFile
    return _decode_ragged(content, start, element, wanted)


def _decode_ragged(
    content: bytes, start: int, element: _Element, wanted: list[int]
) -> tuple[list[Column], int]:
    """Return the same as `_decode` for an element whose lists differ in length."""
    codes = np.frombuffer(content, np.uint8)
    starts = [start]
    for _ in range(element.length):
        starts.append(_row(content, starts[-1], element)[0])

    def read(places: IntArray, kind: str) -> Column:
        every = np.lib.stride_tricks.sliding_window_view(codes, np.dtype(kind).itemsize)
        return every[places].reshape(-1).view(kind)

    places: IntArray = np.array(starts[:-1])
    columns: dict[int, list[Column]] = {}
    for i, p in enumerate(element.properties):
        size = np.dtype(p.kind).itemsize
        lengths: IntArray = np.ones(element.length, np.int64)
        if p.count:
            lengths = read(places, p.count).astype(np.int64)
            places = places + np.dtype(p.count).itemsize
        if i in wanted:
            within = np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths, lengths)
            items = read(np.repeat(places, lengths) + within * size, p.kind)
            columns[i] = [lengths, items] if p.count else [items]
        places = places + lengths * size
    return [column for i in wanted for column in columns[i]], starts[-1]


def _row(content: bytes, start: int, element: _Element) -> tuple[int, list[int]]:
    """Return the end position of a row of an element, and the lengths of its lists.

    Raises:
        _EndOfFile: the content ends within the row.
    """
    lengths = []
    for size, count in element.steps:
        if count is not None:
            if start + count.size > len(content):
                raise _EndOfFile
            (length,) = count.unpack_from(content, start)
            if not 0 <= length < 2**31 or length != int(length):
                raise ValueError(f"a list has the length {length}")
            lengths.append(int(length))
            size = count.size + size * lengths[-1]
        start += size
    if start > len(content):
        raise _EndOfFile
    return start, lengths


def _text_values(path: Path, content: bytes, start: int) -> bytes:
    """Return all numbers of a text body, as little-endian doubles."""
    numbers = Growing(np.float64)
    for block in text_blocks(path, content, start, comments=False):
        numbers.add(block.words(np.arange(len(block.counts))).floats())
    return numbers.done().astype("<f8", copy=False).tobytes()


def _stored(element: _Element, form: str) -> _Element:
    """Return an element with the stored types of its properties; for text they are those of `_text_values`."""
    order = ">" if form == "binary_big_endian" else "<"

    def kind(code: str) -> str:
        return "<d" if form == "ascii" else order + code

    stored = [_Property(p.name, kind(p.kind), p.count and kind(p.count)) for p in element.properties]
    return replace(element, properties=tuple(stored))


def _as_integers(path: Path, corners: Column) -> IntArray:
    """Return corners as integers; in a text file they may be given as decimal numbers."""
    numbers = corners.astype(np.int64, copy=False)
    if corners.dtype.kind == "f" and np.any(numbers != corners):
        odd = corners[np.argmax(numbers != corners)]
        raise MeshFileError(f"{path}: a face refers to vertex {odd}, which is not an integer")
    return numbers


def write_ply(result: Flattening, stream: IO[bytes]) -> None:
    """Write a result as binary little-endian PLY, coordinates as doubles.

    Every vertex has its UV as `s` and `t`, and its vertex in the input as `source_vertex`; a vertex at a seam is
    repeated. Normals and colours of the input are kept. Vertices without a face are left out.

    Args:
        result: the result to write.
        stream: a binary file.
    """
    mesh = split_at_seams(result, source_normals(result))
    doubles = {"x y z": mesh.vertices}
    if mesh.normals is not None:
        doubles["nx ny nz"] = mesh.normals
    doubles["s t"] = mesh.uv
    names = " ".join(doubles).split()
    colours = _colours(result, mesh.own)
    kind = [("doubles", "<f8", len(names)), ("source_vertex", "<i4"), ("colours", "u1", colours.shape[1])]
    vertices = np.empty(len(mesh.vertices), kind)
    vertices["doubles"] = np.concatenate(list(doubles.values()), axis=1)
    vertices["source_vertex"] = mesh.origin
    vertices["colours"] = colours
    properties = [
        *(f"double {name}" for name in names),
        "int source_vertex",
        *(f"uchar {name}" for name in COLOURS[: colours.shape[1]]),
    ]
    write_parts(stream, "flattened by coneflat", properties, vertices, mesh.faces)


def write_parts(
    stream: IO[bytes], comment: str, properties: Sequence[str], vertices: NDArray[Any], faces: IntArray
) -> None:
    """Write vertices and faces as binary little-endian PLY.

    Args:
        stream: a binary file.
        comment: a comment line of the header.
        properties: declarations of the vertex properties, such as "double x".
        vertices: (n, ...) structured array with these properties in the layout of the file.
        faces: (m, k) vertex indices.
    """
    rows = np.empty(len(faces), [("count", "u1"), ("corners", "<i4", faces.shape[1])])
    rows["count"] = faces.shape[1]
    rows["corners"] = faces
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"comment {comment}",
        f"element vertex {len(vertices)}",
        *(f"property {one}" for one in properties),
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "end_header",
    ]
    stream.write(("\n".join(header) + "\n").encode("ascii"))
    stream.write(vertices.data)
    stream.write(rows.data)


def _colours(result: Flattening, vertices: IntArray) -> NDArray[np.uint8]:
    """Return (k, 3) the colours of vertices of the result in the source file, 0 to 255; (k, 0) if it has none."""
    source = result.source
    if source is None or result.face_corners is None or not source.has_colours:
        return np.empty((len(vertices), 0), np.uint8)
    number = np.arange(len(result.vertices)) if result.vertex_origin is None else result.vertex_origin
    shades = np.stack([source.properties[name][number[vertices]] for name in COLOURS], axis=1)
    return np.round(255 * np.clip(np.nan_to_num(shades), 0, 1)).astype(np.uint8)
