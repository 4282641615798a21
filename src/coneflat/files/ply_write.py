"""Writing PLY."""

from __future__ import annotations

from typing import IO, TYPE_CHECKING

import numpy as np

from .normals import source_normals
from .uv_split import split_at_seams

if TYPE_CHECKING:
    from ..result.flattening import Flattening

_FACE = np.dtype([("count", "u1"), ("corners", "<i4", 3)])


def write_ply(result: Flattening, stream: IO[bytes]) -> None:
    """Write a result as binary little-endian PLY, coordinates as doubles.

    Every vertex has its UV as `s` and `t`, and as `source_vertex` the vertex of the input that it came from;
    where the mesh was cut there are several of the same. If the input has normals, so have they. Vertices without
    a face are left out.

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
    vertices = np.empty(len(mesh.vertices), [("doubles", "<f8", len(names)), ("source_vertex", "<i4")])
    vertices["doubles"] = np.concatenate(list(doubles.values()), axis=1)
    vertices["source_vertex"] = mesh.origin
    faces = np.empty(len(mesh.faces), _FACE)
    faces["count"] = 3
    faces["corners"] = mesh.faces
    header = [
        "ply",
        "format binary_little_endian 1.0",
        "comment flattened by coneflat",
        f"element vertex {len(vertices)}",
        *(f"property double {name}" for name in names),
        "property int source_vertex",
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "end_header",
    ]
    stream.write(("\n".join(header) + "\n").encode("ascii"))
    stream.write(vertices.data)
    stream.write(faces.data)
