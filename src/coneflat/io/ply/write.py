"""Writer for PLY files, binary and little-endian."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import IntArray
from ...mesh.polygons import COLOURS, polygon_of
from ...result import Flattening
from ..attributes import ALPHA, VERTEX_COLOURS, Attribute, texture_files
from ..colours import in_type, stored_shades
from ..files import moved_path
from ..mesh_file import MeshFile
from ..split import input_vertices, source_normals, split_at_seams
from .header import NORMAL, TEXTURE, TYPES, PlyHeader, texture_name

#: The first word of each type, by the kind and the bytes of numpy.
WORDS = {np.dtype(code).str[1:]: word for word, code in reversed(TYPES.items())}
#: Vertex properties that every written file has.
_WRITTEN = ("x", "y", "z", *NORMAL, "s", "t", "source_vertex")
_COMMENT = "flattened by coneflat"


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
        yield name, word, (stored_shades if is_colour else in_type)(values, TYPES[word])


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
        name = texture_name(line)
        if name and source != target:
            line = TEXTURE + moved_path(name.encode("latin-1"), source, target).decode("latin-1")
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
        face_properties: further properties of faces by name: (m,) numbers, or (m, l) lists.
    """
    face_columns = {} if face_properties is None else face_properties
    kind: list[tuple[Any, ...]] = [("count", "u1"), ("corners", "<i4", faces.shape[1])]
    for i, values in enumerate(face_columns.values()):
        kind += [(f"n{i}", "u1")] * (values.ndim - 1)
        kind.append((f"p{i}", values.dtype.newbyteorder("<"), values.shape[1:]))
    rows = np.empty(len(faces), kind)
    rows["count"] = faces.shape[1]
    rows["corners"] = faces
    for i, values in enumerate(face_columns.values()):
        rows[f"p{i}"] = values
        if values.ndim > 1:
            rows[f"n{i}"] = values.shape[1]
    header = [
        "ply",
        "format binary_little_endian 1.0",
        *comments,
        f"element vertex {len(vertices)}",
        *(f"property {declared}" for declared in properties),
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        *(
            f"property {'list uchar ' * (values.ndim - 1)}{WORDS[values.dtype.str[1:]]} {name}"
            for name, values in face_columns.items()
        ),
        "end_header",
    ]
    stream.write(("\n".join(header) + "\n").encode("latin-1"))
    stream.write(vertices.data)
    stream.write(rows.data)


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
