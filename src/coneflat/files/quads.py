"""Writing meshes of quads."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np

from .._arrays import FloatArray, IntArray
from .atomic import as_path, atomic_write, check_target, known_ending
from .obj_write import lines_of

#: Endings of the files that `write_quads` writes.
QUAD_FORMATS = (".obj", ".ply")
_FACE = np.dtype([("count", "u1"), ("corners", "<i4", 4)])


def check_quads_output(path: str | PathLike[str]) -> Path:
    """Return the path if `write_quads` can be expected to succeed with it.

    Raises:
        UnknownFormatError: the ending is not one of `QUAD_FORMATS`.
        MeshFileError: the folder is missing, the path is a folder, or writing is not permitted.
    """
    path = as_path(path)
    known_ending(path, QUAD_FORMATS, "quads are written as")
    check_target(path)
    return path


def write_quads(path: str | PathLike[str], vertices: FloatArray, quads: IntArray) -> Path:
    """Write a mesh of quads, in full or not at all, and return the path.

    An .obj has the fewest digits from which the same numbers are read; a .ply is binary, coordinates as doubles.

    Args:
        path: the file.
        vertices, quads: (q, 3), (p, 4).

    Raises:
        UnknownFormatError: the ending is not one of `QUAD_FORMATS`.
        MeshFileError: the file cannot be written.
    """
    path = check_quads_output(path)
    with atomic_write(path) as stream:
        if path.suffix.lower() == ".obj":
            stream.writelines(lines_of("v", vertices, b"\n"))
            stream.writelines(lines_of("f", quads + 1, b"\n"))
        else:
            faces = np.empty(len(quads), _FACE)
            faces["count"] = 4
            faces["corners"] = quads
            header = [
                "ply",
                "format binary_little_endian 1.0",
                "comment quads by coneflat",
                f"element vertex {len(vertices)}",
                *(f"property double {axis}" for axis in "xyz"),
                f"element face {len(faces)}",
                "property list uchar int vertex_indices",
                "end_header",
            ]
            stream.write(("\n".join(header) + "\n").encode("ascii"))
            stream.write(np.ascontiguousarray(vertices, "<f8").data)
            stream.write(faces.data)
    return path
