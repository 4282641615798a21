"""Writing PLY."""

from __future__ import annotations

from collections.abc import Sequence
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import IntArray
from ..mesh.polygons import COLOURS
from .normals import source_normals
from .uv_split import split_at_seams

if TYPE_CHECKING:
    from ..result import Flattening


def write_ply(result: Flattening, stream: IO[bytes]) -> None:
    """Write a result as binary little-endian PLY, coordinates as doubles.

    Every vertex has its UV as `s` and `t`, and as `source_vertex` the vertex of the input that it came from;
    where the mesh was cut there are several of the same. If the input has normals or colours, so have they. Vertices
    without a face are left out.

    Args:
        result: what to write.
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
        comment: a line of the header.
        properties: of a vertex: "double x", say.
        vertices: (n, ...) as they lie in the file, with these properties.
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
    """Return (k, 3) the colours that the file gives vertices of the result, 0 to 255; (k, 0) if it gives none."""
    source = result.source
    if source is None or result.face_corners is None or not source.has_colours:
        return np.empty((len(vertices), 0), np.uint8)
    number = np.arange(len(result.vertices)) if result.vertex_origin is None else result.vertex_origin
    shades = np.stack([source.properties[name][number[vertices]] for name in COLOURS], axis=1)
    return np.round(255 * np.clip(np.nan_to_num(shades), 0, 1)).astype(np.uint8)
