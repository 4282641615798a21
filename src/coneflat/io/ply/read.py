"""Reader for PLY files, text and binary, which keeps polygons.

This package has its own reader to keep polygons, all properties of vertices and faces and the UVs of corners, and to
check the counts in a header before memory is allocated.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...base.arrays import FloatArray, IntArray
from ...errors import MeshFileError
from ...mesh.polygons import COLOURS
from ..attributes import TEXTURE_FILES, VERTEX_COLOURS, Attribute
from ..colours import colour_shades, in_type
from ..mesh_file import MeshFile, check_filled, offsets_of
from .header import (
    FACE_UV,
    NORMAL,
    TYPES,
    Element,
    Layout,
    PlyHeader,
    corners_of,
    mesh_properties,
    read_header,
    texture_name,
)
from .values import Column, EndOfFile, decode, stored_element, text_values

#: Pairs of vertex properties that programs use for its UV point.
_VERTEX_UV = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"), ("u0", "v0"))
#: Elements of faces that this package does not read.
_STRIPS = ("tristrips", "tristrip")


def parse_ply(path: Path, content: bytes) -> MeshFile:
    """Return the mesh of a PLY file.

    Raises:
        MeshFileError: the file is not PLY, has fewer elements than its header declares, or has text for a number.
        EmptyMeshError: it has no vertex or no face.
    """
    layout = read_header(path, content)
    columns_of = _columns(path, content, layout)
    _refuse_strips(path, layout.elements)
    elements = {element.name: element for element in layout.elements}
    mesh = _vertices(path, elements, columns_of)
    if "face" in columns_of:
        mesh = _with_faces(path, mesh, elements["face"], columns_of["face"])
    check_filled(path, len(mesh.vertices), len(mesh.offsets) - 1)
    uv_pairs = [pair for pair in _VERTEX_UV if set(pair) <= mesh.properties.keys()]
    uv_names = uv_pairs[0] if uv_pairs and mesh.uv is None else ()
    kinds = {p.name: p.word for p in elements["vertex"].properties if p.name in mesh.properties}
    header = PlyHeader(layout.comments, kinds, tuple(name for pair in uv_pairs for name in pair))
    attributes = _attributes_of(mesh, elements.values(), layout.comments, uv_names)
    return replace(_with_shading(mesh, uv_names), ply=header, attributes=attributes)


def _columns(path: Path, content: bytes, layout: Layout) -> dict[str, list[Column]]:
    """Return the columns of each element up to the vertices and faces: those of `mesh_properties`."""
    start = layout.start
    if layout.form == "ascii":
        # Converted to an array of doubles, the text is read by the same code as the binary forms; doubles represent
        # every possible index exactly.
        content, start = text_values(path, content, start, layout.elements), 0
    columns_of: dict[str, list[Column]] = {}
    for element in layout.elements:
        chosen = mesh_properties(path, element)
        try:
            columns, start = decode(content, start, stored_element(element, layout.form), chosen)
        except EndOfFile as error:
            raise MeshFileError(
                f"{path} ends before the {element.length} {element.name} elements in its header"
            ) from error
        columns_of[element.name] = columns
        if columns_of.keys() >= {"vertex", "face"}:
            break
    return columns_of


def _vertices(
    path: Path, elements: Mapping[str, Element], columns_of: Mapping[str, list[Column]]
) -> MeshFile:
    """Return a mesh of the vertices of a file and their properties, without faces."""
    vertices, properties = np.empty((0, 3)), dict[str, FloatArray]()
    if "vertex" in columns_of:
        element, columns = elements["vertex"], columns_of["vertex"]
        declared = [element.properties[i] for i in mesh_properties(path, element)]
        vertices = np.stack([np.asarray(c, np.float64) for c in columns[:3]], axis=1)
        properties = {
            p.name: colour_shades(column, TYPES[p.word])
            if p.name in COLOURS
            else np.asarray(column, np.float64)
            for p, column in zip(declared[3:], columns[3:], strict=True)
        }
    return MeshFile(path, vertices, np.empty(0, np.int64), np.zeros(1, np.int64), properties=properties)


def _with_faces(path: Path, mesh: MeshFile, element: Element, columns: list[Column]) -> MeshFile:
    """Return a mesh with its faces, their properties and the UVs of their corners."""
    sizes, corners = columns[0].astype(np.int64), _as_integers(path, columns[1])
    chosen_properties = [element.properties[i] for i in mesh_properties(path, element)]
    lists = sum(p.count is not None for p in chosen_properties)
    texture, uv = _corner_uv(path, sizes, *columns[2:4]) if lists == 2 else (None, None)
    properties = {
        p.name: in_type(np.asarray(c), TYPES[p.word])
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


def _with_shading(mesh: MeshFile, uv_names: Sequence[str]) -> MeshFile:
    """Return a mesh with the UVs and the normals that are among the properties of its vertices.

    uv_names: names of the two properties that are its UVs, if any.
    """
    properties = mesh.properties
    if uv_names:
        mesh = replace(
            mesh, texture=mesh.corners, uv=np.stack([properties[name] for name in uv_names], axis=1)
        )
    if set(NORMAL) <= properties.keys():
        normals = np.stack([properties[name] for name in NORMAL], axis=1)
        mesh = replace(mesh, normals=normals, normal=mesh.corners)
    return mesh


def _corner_uv(path: Path, sizes: IntArray, counts: Column, numbers: Column) -> tuple[IntArray, FloatArray]:
    """Return (c,) the index of each corner's UV point and (u, 2) the points; a face may have an empty list.

    Raises:
        MeshFileError: a face's list does not have two numbers for each of its corners.
    """
    wrong = (counts != 0) & (counts != 2 * sizes)
    if wrong.any():
        face = int(np.argmax(wrong))
        raise MeshFileError(
            f"{path}: face {face} has {sizes[face]} corners and {int(counts[face])} numbers in '{FACE_UV}', which "
            "needs two for each corner"
        )
    has_uv = np.repeat(counts != 0, sizes)
    texture = np.where(has_uv, np.cumsum(has_uv) - 1, -1)
    return texture, np.asarray(numbers, np.float64).reshape(-1, 2)


def _as_integers(path: Path, corners: Column) -> IntArray:
    """Return corners as integers; in a text file they may be given as decimal numbers."""
    numbers = corners.astype(np.int64, copy=False)
    if corners.dtype.kind == "f" and np.any(numbers != corners):
        odd = corners[np.argmax(numbers != corners)]
        raise MeshFileError(f"{path}: a face refers to vertex {odd}, which is not an integer")
    return numbers


def _attributes_of(
    mesh: MeshFile, elements: Iterable[Element], comments: Sequence[str], uv: Sequence[str]
) -> tuple[Attribute, ...]:
    """Return the data of a file in addition to its mesh.

    uv: names of the vertex properties that are its UVs.
    """
    attributes = [Attribute(TEXTURE_FILES, texture_name(line)) for line in comments if texture_name(line)]
    properties = mesh.properties
    replaced = {*"xyz", *uv, "source_vertex", *(NORMAL if set(NORMAL) <= properties.keys() else ())}
    if mesh.has_colours:
        replaced |= set(COLOURS)
        attributes.append(VERTEX_COLOURS)
    for element in elements:
        names = [p.name for p in element.properties]
        if element.name == "vertex":
            attributes += [Attribute("vertex properties", name) for name in names if name not in replaced]
        elif element.name == "face":
            corners = corners_of(element)
            attributes += [
                Attribute("face properties", name) for name in names if name not in (corners, FACE_UV)
            ]
        elif element.length:
            attributes.append(Attribute("elements", element.name))
    return tuple(dict.fromkeys(attributes))


def _refuse_strips(path: Path, elements: Sequence[Element]) -> None:
    """Raise an error for a file whose faces are triangle strips."""
    strips = [element for element in elements if element.name in _STRIPS and element.length]
    if strips and not any(element.name == "face" and element.length for element in elements):
        raise MeshFileError(
            f"{path}, line {strips[0].line}: its faces are triangle strips ({strips[0].name}), which are not "
            "supported: save it with separate triangles"
        )
