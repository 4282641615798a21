"""Headers of PLY files: the elements that a file declares, with their properties."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...errors import MeshFileError

#: The code of each type, in numpy and in struct.
TYPES = {
    "char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I", "float": "f", "double": "d",
    "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "int64": "q", "uint64": "Q",
    "float32": "f", "float64": "d",
}  # fmt: skip
#: The formats of the body.
FORMS = ("ascii", "binary_little_endian", "binary_big_endian")
#: Names of the list of corners of a face.
_CORNERS = ("vertex_indices", "vertex_index")
#: The list of UVs of a face's corners: u, v, u, v, ...
FACE_UV = "texcoord"
#: Vertex properties that are the normal.
NORMAL = ("nx", "ny", "nz")
#: The comment by which programs name the image of a texture.
TEXTURE = "comment TextureFile "


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
class Property:
    """A property of an element: a number, or a list of numbers.

    Attributes:
        name: its name.
        kind: numpy code of the number, or of a list's items; with the byte order once that is known.
        count: numpy code of a list's length, likewise; None for a number.
        word: the type of the number, or of a list's items, in the file's header.
    """

    name: str
    kind: str
    count: str | None = None
    word: str = ""


@dataclass(frozen=True, eq=False)
class Element:
    """A table of the file: a row for each vertex, a column for each property.

    Attributes:
        name: such as "vertex".
        length: number of rows.
        line: number of the line that declares it.
        properties: the columns.
    """

    name: str
    length: int
    line: int
    properties: tuple[Property, ...] = ()

    @cached_property
    def steps(self) -> list[tuple[int, struct.Struct | None]]:
        """Return for each property the bytes of the value or of an item, and the struct that reads a list's length."""
        sizes = (np.dtype(p.kind).itemsize for p in self.properties)
        counts = (struct.Struct(p.count) if p.count else None for p in self.properties)
        return list(zip(sizes, counts, strict=True))


class Layout(NamedTuple):
    """How the body of a file is to be read.

    Attributes:
        form: "ascii", "binary_little_endian" or "binary_big_endian".
        elements: the tables, in their order in the body.
        comments: lines of comments and of `obj_info`, in order.
        start: position of the body.
    """

    form: str
    elements: list[Element]
    comments: tuple[str, ...]
    start: int


def read_header(path: Path, content: bytes) -> Layout:
    """Return what the header of a file declares about its body.

    Raises:
        MeshFileError: the file has no header, or a line of it is not valid.
    """
    end = content.find(b"end_header")
    if not content.startswith(b"ply") or end < 0:
        raise MeshFileError(f"{path} is not a PLY file: it has no PLY header")
    form = ""
    elements: list[Element] = []
    comments = []
    for number, line in enumerate(content[:end].splitlines(), 1):
        words = line.decode("latin-1").split()
        try:
            if words[:1] == ["format"]:
                form = words[1]
            elif words[:1] in (["comment"], ["obj_info"]):
                comments.append(line.decode("latin-1"))
            elif words[:1] == ["element"]:
                elements.append(_element(words, number))
            elif words[:1] == ["property"]:
                properties = (*elements[-1].properties, _property(words))
                elements[-1] = replace(elements[-1], properties=properties)
        except (IndexError, KeyError, ValueError) as error:
            raise MeshFileError(f"{path}, line {number}: invalid line in a PLY header: {line!r}") from error
    if form not in FORMS:
        raise MeshFileError(f"{path} is not a PLY file: its header has no known format")
    return Layout(form, elements, tuple(comments), _body_start(content, end))


def _element(words: list[str], line: int) -> Element:
    """Return the element that the words of a line declare."""
    length = int(words[2])
    if length < 0:
        raise ValueError("a negative count")
    return Element(words[1], length, line)


def _property(words: list[str]) -> Property:
    """Return the property that the words of a line declare."""
    if words[1] == "list":
        return Property(words[4], TYPES[words[3]], TYPES[words[2]], words[3])
    return Property(words[2], TYPES[words[1]], None, words[1])


def _body_start(content: bytes, end: int) -> int:
    """Return the position after the last line of the header, whose "end_header" is at `end`."""
    start = end + len(b"end_header")
    while content[start : start + 1] == b" ":
        start += 1
    # Some old files end lines with a single carriage return; then a line feed after it is data.
    return start + (2 if content[start : start + 2] == b"\r\n" and b"\n" in content[:end] else 1)


def mesh_properties(path: Path, element: Element) -> list[int]:
    """Return the indices of the properties of an element that are part of the mesh."""
    if element.name == "vertex":
        names = [p.name for p in element.properties]
        missing = [axis for axis in "xyz" if axis not in names]
        if missing:
            raise MeshFileError(f"{path}: its vertices have no property {missing[0]!r}")
        axes = [names.index(axis) for axis in "xyz"]
        return axes + [i for i, p in enumerate(element.properties) if i not in axes and not p.count]
    if element.name == "face":
        corners, names = corners_of(element), [p.name for p in element.properties]
        if corners is None:
            raise MeshFileError(f"{path}: its faces have no list 'vertex_indices'")
        lists, scalars = (
            [i for i, p in enumerate(element.properties) if bool(p.count) == is_list] for is_list in (1, 0)
        )
        return [names.index(corners), *(i for i in lists if names[i] == FACE_UV), *scalars]
    return []


def corners_of(element: Element) -> str | None:
    """Return the name of the list of corners of faces, or None."""
    lists = [p.name for p in element.properties if p.count]
    named = [name for name in lists if name in _CORNERS]
    alone = [name for name in lists if name != FACE_UV] if len(lists) == 1 else []
    return next(iter(named or alone), None)


def texture_name(comment: str) -> str:
    """Return the name of the image in a comment, or ""."""
    return comment.removeprefix(TEXTURE).strip() if comment.startswith(TEXTURE) else ""
