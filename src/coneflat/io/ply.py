"""Reader for PLY files, text and binary, which keeps polygons, and writer for PLY.

This package has its own reader to keep polygons, all properties of vertices and faces and the UVs of corners, and to
check the counts in a header before memory is allocated.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import IO, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import FloatArray, IntArray
from ..errors import MeshFileError
from ..mesh.polygons import COLOURS, polygon_of
from ..result import Flattening
from .attributes import (
    ALPHA,
    TEXTURE_FILES,
    VERTEX_COLOURS,
    Attribute,
    texture_files,
)
from .colours import colour_shades, in_type, stored_shades
from .files import moved_path
from .mesh_file import MeshFile, check_filled, offsets_of
from .split import input_vertices, source_normals, split_at_seams
from .text import Growing, text_blocks

#: The code of each type, in numpy and in struct.
_TYPES = {
    "char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I", "float": "f", "double": "d",
    "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "int64": "q", "uint64": "Q",
    "float32": "f", "float64": "d",
}  # fmt: skip
#: The first word of each type, by the kind and the bytes of numpy.
_WORDS = {np.dtype(code).str[1:]: word for word, code in reversed(_TYPES.items())}
#: One property of an element in all rows.
Column: TypeAlias = "np.ndarray[tuple[int, ...], np.dtype[Any]]"

_CORNERS = ("vertex_indices", "vertex_index")
#: Names that programs use for a vertex's UV point, and for the list of those of a face's corners: u, v, u, v, ...
_VERTEX_UV = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"), ("u0", "v0"))
_FACE_UV = "texcoord"
_NORMAL = ("nx", "ny", "nz")
#: Vertex properties that every written file has.
_WRITTEN = ("x", "y", "z", *_NORMAL, "s", "t", "source_vertex")
#: The comment by which programs name the image of a texture.
_TEXTURE = "comment TextureFile "
_COMMENT = "flattened by coneflat"
#: Elements of faces that this package does not read.
_STRIPS = ("tristrips", "tristrip")


class PlyHeader(NamedTuple):
    """What a PLY file declares in addition to the values of its mesh.

    Attributes:
        comments: its lines of comments and of `obj_info`, in order.
        kinds: the type of every vertex property in `MeshFile.properties`, by the word of the file: "uchar".
        uv: the vertex properties that are its UVs.
    """

    comments: tuple[str, ...]
    kinds: Mapping[str, str]
    uv: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Property:
    name: str
    kind: str  # numpy code of the value, or of a list's items; with the byte order once that is known
    count: str | None = None  # numpy code of a list's length, likewise
    word: str = ""  # the type of the value in the file's header


@dataclass(frozen=True, eq=False)
class _Element:
    name: str
    length: int
    line: int
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
    form, elements, start, comments = _header(path, content)
    if form == "ascii":
        # Converted to an array of doubles, the text is read by the same code as the binary forms; doubles represent
        # every possible index exactly.
        content, start = _text_values(path, content, start, elements), 0
    columns_of: dict[str, list[Column]] = {}
    for element in elements:
        chosen_properties = _mesh_properties(path, element)
        try:
            columns, start = _decode(content, start, _stored(element, form), chosen_properties)
        except _EndOfFile as error:
            raise MeshFileError(
                f"{path} ends before the {element.length} {element.name} elements in its header"
            ) from error
        columns_of[element.name] = columns
        if columns_of.keys() >= {"vertex", "face"}:
            break
    _refuse_strips(path, elements)
    by_name = {element.name: element for element in elements}
    mesh = _vertices(path, by_name, columns_of)
    if "face" in columns_of:
        mesh = _with_faces(path, mesh, by_name["face"], columns_of["face"])
    check_filled(path, len(mesh.vertices), len(mesh.offsets) - 1)
    pairs = [pair for pair in _VERTEX_UV if set(pair) <= mesh.properties.keys()]
    chosen = pairs[0] if pairs and mesh.uv is None else ()
    kinds = {p.name: p.word for p in by_name["vertex"].properties if p.name in mesh.properties}
    header = PlyHeader(comments, kinds, tuple(name for pair in pairs for name in pair))
    shading = {name: mesh.properties[name] for name in (*chosen, *_NORMAL) if name in mesh.properties}
    mesh = replace(mesh, ply=header, attributes=_attributes(mesh, by_name.values(), comments, chosen))
    if chosen:
        mesh = replace(mesh, texture=mesh.corners, uv=np.stack([shading[name] for name in chosen], axis=1))
    if set(_NORMAL) <= shading.keys():
        normals = np.stack([shading[name] for name in _NORMAL], axis=1)
        mesh = replace(mesh, normals=normals, normal=mesh.corners)
    return mesh


def _vertices(
    path: Path, elements: Mapping[str, _Element], columns_of: Mapping[str, list[Column]]
) -> MeshFile:
    """Return a mesh of the vertices of a file and their properties, without faces."""
    vertices, properties = np.empty((0, 3)), dict[str, FloatArray]()
    if "vertex" in columns_of:
        element, columns = elements["vertex"], columns_of["vertex"]
        declared = [element.properties[i] for i in _mesh_properties(path, element)]
        vertices = np.stack([np.asarray(c, np.float64) for c in columns[:3]], axis=1)
        properties = {
            p.name: colour_shades(column, _TYPES[p.word])
            if p.name in COLOURS
            else np.asarray(column, np.float64)
            for p, column in zip(declared[3:], columns[3:], strict=True)
        }
    return MeshFile(path, vertices, np.empty(0, np.int64), np.zeros(1, np.int64), properties=properties)


def _with_faces(path: Path, mesh: MeshFile, element: _Element, columns: list[Column]) -> MeshFile:
    """Return a mesh with its faces, their properties and the UVs of their corners."""
    sizes, corners = columns[0].astype(np.int64), _as_integers(path, columns[1])
    chosen_properties = [element.properties[i] for i in _mesh_properties(path, element)]
    lists = sum(p.count is not None for p in chosen_properties)
    texture, uv = _corner_uv(path, sizes, *columns[2:4]) if lists == 2 else (None, None)
    properties = {
        p.name: in_type(np.asarray(c), _TYPES[p.word])
        for p, c in zip(chosen_properties[lists:], columns[2 * lists :], strict=True)
    }
    has_uv = uv is not None and len(uv) > 0
    return replace(
        mesh,
        corners=corners,
        offsets=offsets_of(sizes),
        face_properties=properties,
        texture=texture if has_uv else None,
        uv=uv if has_uv else None,
    )


def _attributes(
    mesh: MeshFile, elements: Iterable[_Element], comments: Sequence[str], uv: Sequence[str]
) -> tuple[Attribute, ...]:
    """Return the data of a file in addition to its mesh.

    uv: names of the vertex properties that are its UVs.
    """
    attributes = [Attribute(TEXTURE_FILES, _texture_name(line)) for line in comments if _texture_name(line)]
    properties = mesh.properties
    replaced = {*"xyz", *uv, "source_vertex", *(_NORMAL if set(_NORMAL) <= properties.keys() else ())}
    if mesh.has_colours:
        replaced |= set(COLOURS)
        attributes.append(VERTEX_COLOURS)
    for element in elements:
        names = [p.name for p in element.properties]
        if element.name == "vertex":
            attributes += [Attribute("vertex properties", name) for name in names if name not in replaced]
        elif element.name == "face":
            corners = _corners_of(element)
            attributes += [
                Attribute("face properties", name) for name in names if name not in (corners, _FACE_UV)
            ]
        elif element.length:
            attributes.append(Attribute("elements", element.name))
    return tuple(dict.fromkeys(attributes))


def _texture_name(comment: str) -> str:
    """Return the name of the image in a comment, or ""."""
    return comment.removeprefix(_TEXTURE).strip() if comment.startswith(_TEXTURE) else ""


def _refuse_strips(path: Path, elements: Sequence[_Element]) -> None:
    """Raise an error for a file whose faces are triangle strips."""
    strips = [element for element in elements if element.name in _STRIPS and element.length]
    if strips and not any(element.name == "face" and element.length for element in elements):
        raise MeshFileError(
            f"{path}, line {strips[0].line}: its faces are triangle strips ({strips[0].name}), which are not "
            "supported: save it with separate triangles"
        )


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


def _header(path: Path, content: bytes) -> tuple[str, list[_Element], int, tuple[str, ...]]:
    """Return the format, the elements, the position after the header, and the comments."""
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
    comments = []
    for i, line in enumerate(lines):
        words = line.decode("latin-1").split()
        try:
            if words[:1] == ["format"]:
                form = words[1]
            elif words[:1] in (["comment"], ["obj_info"]):
                comments.append(line.decode("latin-1"))
            elif words[:1] == ["element"]:
                elements.append(_Element(words[1], int(words[2]), i + 1))
                if elements[-1].length < 0:
                    raise ValueError("a negative count")
            elif words[:1] == ["property"]:
                if words[1] == "list":
                    declared = _Property(words[4], _TYPES[words[3]], _TYPES[words[2]], words[3])
                else:
                    declared = _Property(words[2], _TYPES[words[1]], None, words[1])
                elements[-1] = replace(elements[-1], properties=(*elements[-1].properties, declared))
        except (IndexError, KeyError, ValueError) as error:
            raise MeshFileError(f"{path}, line {i + 1}: invalid line in a PLY header: {line!r}") from error
    if form not in ("ascii", "binary_little_endian", "binary_big_endian"):
        raise MeshFileError(f"{path} is not a PLY file: its header has no known format")
    return form, elements, start, tuple(comments)


def _mesh_properties(path: Path, element: _Element) -> list[int]:
    """Return the indices of the properties of an element that are part of the mesh."""
    if element.name == "vertex":
        names = [p.name for p in element.properties]
        missing = [axis for axis in "xyz" if axis not in names]
        if missing:
            raise MeshFileError(f"{path}: its vertices have no property {missing[0]!r}")
        axes = [names.index(axis) for axis in "xyz"]
        return axes + [i for i, p in enumerate(element.properties) if i not in axes and not p.count]
    if element.name == "face":
        corners, names = _corners_of(element), [p.name for p in element.properties]
        if corners is None:
            raise MeshFileError(f"{path}: its faces have no list 'vertex_indices'")
        lists, scalars = (
            [i for i, p in enumerate(element.properties) if bool(p.count) == is_list] for is_list in (1, 0)
        )
        return [names.index(corners), *(i for i in lists if names[i] == _FACE_UV), *scalars]
    return []


def _corners_of(element: _Element) -> str | None:
    """Return the name of the list of corners of faces, or None."""
    lists = [p.name for p in element.properties if p.count]
    named = [name for name in lists if name in _CORNERS]
    alone = [name for name in lists if name != _FACE_UV] if len(lists) == 1 else []
    return next(iter(named or alone), None)


class _EndOfFile(Exception):
    """Signals that the file is shorter than its header declares."""


def _decode(content: bytes, start: int, element: _Element, chosen: list[int]) -> tuple[list[Column], int]:
    """Return the chosen columns of an element, a list as two columns (lengths, items), and its end position."""
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
            for i in chosen:
                if i in lengths:
                    columns.append(np.full(element.length, lengths[i], dtype=np.int64))
                columns.append(rows[f"p{i}"].reshape(-1))
            return columns, stop
    if not lists or element.length > len(content):
        raise _EndOfFile
    return _decode_ragged(content, start, element, chosen)


def _decode_ragged(
    content: bytes, start: int, element: _Element, chosen: list[int]
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
        if i in chosen:
            within = np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths, lengths)
            items = read(np.repeat(places, lengths) + within * size, p.kind)
            columns[i] = [lengths, items] if p.count else [items]
        places = places + lengths * size
    return [column for i in chosen for column in columns[i]], starts[-1]


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


def _text_values(path: Path, content: bytes, start: int, elements: Sequence[_Element]) -> bytes:
    """Return all numbers of a text body, as little-endian doubles.

    Raises:
        MeshFileError: a word is not a number, or a line does not have the numbers that its element needs.
    """
    numbers, counts = Growing(np.float64), Growing(np.int64)
    for block in text_blocks(path, content, start, comments=False):
        numbers.add(block.words(np.arange(len(block.counts))).floats())
        counts.add(block.counts[block.counts > 0])
    values, lengths = numbers.done(), counts.done()
    # Some files have rows of several lines.
    if len(lengths) == sum(element.length for element in elements):
        needed = _needed(elements, values, lengths)
        wrong = np.flatnonzero(needed != lengths)
        if len(wrong):
            i = int(wrong[0])
            ends = np.cumsum([element.length for element in elements])
            name = elements[int(np.searchsorted(ends, i, side="right"))].name
            reason = (
                f"the list of this {name} has no valid length"
                if needed[i] < 0
                else f"the properties of this {name} need {needed[i]:,} numbers, but the line has {lengths[i]:,}"
            )
            raise MeshFileError(f"{path}, line {_filled_line(path, content, start, i)}: {reason}")
    return values.astype("<f8", copy=False).tobytes()


def _needed(elements: Sequence[_Element], values: FloatArray, lengths: IntArray) -> IntArray:
    """Return (k,) how many numbers each line of a text body needs, given those of all lines; -1 for an invalid list.

    lengths: (k,) numbers on each line.
    """
    needed = np.empty(len(lengths), np.int64)
    first, begin = np.cumsum(lengths) - lengths, 0
    for element in elements:
        rows = slice(begin, begin + element.length)
        place, is_valid = first[rows].copy(), np.ones(element.length, dtype=bool)
        for declared in element.properties:
            if declared.count:
                size = values[np.minimum(place, len(values) - 1)] if len(values) else np.zeros(len(place))
                is_valid &= (size >= 0) & (size <= len(values)) & (size == np.floor(size))
                place += np.where(is_valid, np.nan_to_num(size), 0).astype(np.int64)
            place += 1
        needed[rows] = np.where(is_valid, place - first[rows], -1)
        begin += element.length
    return needed


def _filled_line(path: Path, content: bytes, start: int, i: int) -> int:
    """Return the number of the i-th line with words of a text body."""
    for block in text_blocks(path, content, start, comments=False):
        rows = np.flatnonzero(block.counts)
        if i < len(rows):
            return block.line_number(int(rows[i]))
        i -= len(rows)
    raise AssertionError("there is no such line")


def _stored(element: _Element, form: str) -> _Element:
    """Return an element with the stored types of its properties; for text they are those of `_text_values`."""
    order = ">" if form == "binary_big_endian" else "<"

    def kind(code: str) -> str:
        return "<d" if form == "ascii" else order + code

    stored = [_Property(p.name, kind(p.kind), p.count and kind(p.count), p.word) for p in element.properties]
    return replace(element, properties=tuple(stored))


def _as_integers(path: Path, corners: Column) -> IntArray:
    """Return corners as integers; in a text file they may be given as decimal numbers."""
    numbers = corners.astype(np.int64, copy=False)
    if corners.dtype.kind == "f" and np.any(numbers != corners):
        odd = corners[np.argmax(numbers != corners)]
        raise MeshFileError(f"{path}: a face refers to vertex {odd}, which is not an integer")
    return numbers


def kept_in_ply(source: MeshFile) -> set[Attribute]:
    """Return the attributes of a source file that `write_ply` keeps."""
    attributes = {Attribute("vertex properties", name) for name in _kept_properties(source)}
    attributes |= {Attribute("face properties", name) for name in source.face_properties}
    attributes |= set(texture_files(source))
    return attributes | ({VERTEX_COLOURS} if source.has_colours else set())


def ply_has_textures(source: MeshFile) -> bool:
    """Return whether a source file names textures of its UVs, which `write_ply` keeps."""
    return source.ply is not None and source.uv is not None and len(texture_files(source)) > 0


def _kept_properties(source: MeshFile) -> list[str]:
    """Return the names of the vertex properties that `write_ply` keeps: except UVs and those that it computes."""
    replaced = (*_WRITTEN, *(() if source.ply is None else source.ply.uv))
    return [name for name in source.properties if name not in replaced]


def write_ply(result: Flattening, stream: IO[bytes], folder: Path) -> None:
    """Write a result as binary little-endian PLY, coordinates as doubles.

    Every vertex has its UV as `s` and `t`, and its vertex in the input as `source_vertex`; a vertex at a seam is
    repeated. Normals, colours, and the properties of vertices and faces of a PLY input are kept, with its comments.
    Vertices without a face are left out.

    Args:
        result: the result to write.
        stream: a binary file.
        folder: folder of the file, for relative paths of its textures.
    """
    mesh = split_at_seams(result, source_normals(result))
    doubles = {"x y z": mesh.vertices}
    if mesh.normals is not None:
        doubles["nx ny nz"] = mesh.normals
    doubles["s t"] = mesh.uv
    names = " ".join(doubles).split()
    source = None if result.face_corners is None else result.source
    columns = [] if source is None else list(_vertex_columns(source, input_vertices(result)[mesh.vertex]))
    kind: list[tuple[Any, ...]] = [("doubles", "<f8", len(names)), ("source_vertex", "<i4")]
    kind += [(f"p{i}", values.dtype.newbyteorder("<")) for i, (_, _, values) in enumerate(columns)]
    vertices = np.empty(len(mesh.vertices), kind)
    vertices["doubles"] = np.concatenate(list(doubles.values()), axis=1)
    vertices["source_vertex"] = mesh.origin
    for i, (_, _, values) in enumerate(columns):
        vertices[f"p{i}"] = values
    properties = [
        *(f"double {name}" for name in names),
        "int source_vertex",
        *(f"{word} {name}" for name, word, _ in columns),
    ]
    comments = list[str]()
    if source is not None and source.ply is not None:
        comments += _moved(source.ply, source.path.parent, folder)
    if f"comment {_COMMENT}" not in comments:
        comments.append(f"comment {_COMMENT}")
    write_parts(stream, comments, properties, vertices, mesh.faces, _face_columns(result))


def _vertex_columns(source: MeshFile, numbers: IntArray) -> Iterator[tuple[str, str, NDArray[Any]]]:
    """Yield the name, the type and the values of each kept property of some vertices of a source file."""
    kinds = {} if source.ply is None else source.ply.kinds
    for name in _kept_properties(source):
        values = source.properties[name][numbers]
        # The alpha of a PLY file is in the type of the file, that of other formats is 0 to 1.
        is_colour = name in COLOURS or (name == ALPHA.name and name not in kinds)
        word = kinds.get(name, "uchar" if is_colour else "double")
        yield name, word, (stored_shades if is_colour else in_type)(values, _TYPES[word])


def _face_columns(result: Flattening) -> dict[str, NDArray[Any]]:
    """Return the properties of the polygons of a source file at the triangles of a result."""
    if result.source is None or result.face_corners is None:
        return {}
    polygon = polygon_of(result.face_corners, result.source.offsets)
    return {name: values[polygon] for name, values in result.source.face_properties.items()}


def _moved(header: PlyHeader, source_folder: Path, target_folder: Path) -> Iterator[str]:
    """Yield the comments of a file, with paths of textures relative to another folder."""
    source, target = os.path.realpath(source_folder), os.path.realpath(target_folder)
    for line in header.comments:
        name = _texture_name(line)
        if name and source != target:
            line = _TEXTURE + moved_path(name.encode("latin-1"), source, target).decode("latin-1")
        yield line


def write_parts(
    stream: IO[bytes],
    comments: Sequence[str],
    properties: Sequence[str],
    vertices: NDArray[Any],
    faces: IntArray,
    face_properties: Mapping[str, NDArray[Any]] | None = None,
) -> None:
    """Write vertices and faces as binary little-endian PLY.

    Args:
        stream: a binary file.
        comments: lines of the header, such as "comment by coneflat".
        properties: declarations of the vertex properties, such as "double x".
        vertices: (n, ...) structured array with these properties in the layout of the file.
        faces: (m, k) vertex indices.
        face_properties: (m,) further properties of faces by name.
    """
    face_columns = {} if face_properties is None else face_properties
    kind: list[tuple[Any, ...]] = [("count", "u1"), ("corners", "<i4", faces.shape[1])]
    kind += [(f"p{i}", values.dtype.newbyteorder("<")) for i, values in enumerate(face_columns.values())]
    rows = np.empty(len(faces), kind)
    rows["count"] = faces.shape[1]
    rows["corners"] = faces
    for i, values in enumerate(face_columns.values()):
        rows[f"p{i}"] = values
    header = [
        "ply",
        "format binary_little_endian 1.0",
        *comments,
        f"element vertex {len(vertices)}",
        *(f"property {declared}" for declared in properties),
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        *(f"property {_WORDS[values.dtype.str[1:]]} {name}" for name, values in face_columns.items()),
        "end_header",
    ]
    stream.write(("\n".join(header) + "\n").encode("latin-1"))
    stream.write(vertices.data)
    stream.write(rows.data)
