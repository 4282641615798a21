"""Writing and reading meshes of quads."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from ...base import FloatArray, IntArray
from ...geometry import vertex_normals
from ...io import (
    FOR_INDICES,
    FOR_VERTICES,
    MATERIAL,
    CheckedArrays,
    Glb,
    as_path,
    atomic_write,
    bounds,
    checked_target,
    known_ending,
    lines_of,
    number,
    read_archive,
    shading_normals,
    write_parts,
)

if TYPE_CHECKING:
    from .quad_mesh import QuadMesh

#: Endings of the files that `write_quads` writes.
QUAD_FORMATS = (".obj", ".ply", ".glb", ".npz")
#: Arrays from which a mesh of quads is made again.
_NAMES = ("vertices", "quads", "faces", "barycentric", "surface_vertices", "surface_faces", "report")


def check_quads_output(path: str | PathLike[str]) -> Path:
    """Return the path if `write_quads` can be expected to succeed with it.

    Raises:
        UnknownFormatError: the ending is not one of `QUAD_FORMATS`.
        MeshFileError: the folder is missing, the path is a folder, or writing is not permitted.
    """
    return checked_target(path, QUAD_FORMATS, "quads are written as")


def write_quads(path: str | PathLike[str], mesh: QuadMesh) -> Path:
    """Write a mesh of quads, in full or not at all, and return the path.

    An .obj has the fewest digits from which the same numbers are read; a .ply is binary, coordinates as doubles. A
    .glb, which knows no quads, has two triangles for each, and their edges as lines; see `write_quads_glb`. An .npz has
    all arrays of the `QuadMesh`, from which `read_quads` makes it again, and the irregular vertices with
    their valences.

    Args:
        path: the file.
        mesh: what to write.

    Raises:
        UnknownFormatError: the ending is not one of `QUAD_FORMATS`.
        MeshFileError: the file cannot be written.
    """
    path = check_quads_output(path)
    with atomic_write(path) as stream:
        write_quads_stream(mesh, stream, path.suffix.lower())
    return path


def write_quads_stream(mesh: QuadMesh, stream: IO[bytes], ending: str) -> None:
    """Write a mesh of quads to a binary stream; ending: one of `QUAD_FORMATS`, see `write_quads`."""
    writers: dict[str, Callable[[QuadMesh, IO[bytes]], None]] = {
        ".obj": _write_obj,
        ".ply": _write_ply,
        ".glb": write_quads_glb,
        ".npz": _write_npz,
    }
    writers[ending](mesh, stream)


def _write_obj(mesh: QuadMesh, stream: IO[bytes]) -> None:
    stream.writelines(lines_of("v", mesh.vertices, b"\n"))
    stream.writelines(lines_of("f", mesh.quads + 1, b"\n"))


def _write_ply(mesh: QuadMesh, stream: IO[bytes]) -> None:
    places = np.ascontiguousarray(mesh.vertices, "<f8")
    write_parts(stream, "quads by coneflat", [f"double {axis}" for axis in "xyz"], places, mesh.quads)


def _write_npz(mesh: QuadMesh, stream: IO[bytes]) -> None:
    report = {"left_out": mesh.left_out, "area_left_out": mesh.area_left_out, "notes": list(mesh.notes)}
    np.savez(
        stream,
        vertices=mesh.vertices,
        quads=mesh.quads,
        faces=mesh.faces,
        barycentric=mesh.barycentric,
        surface_vertices=mesh.surface.vertices,
        surface_faces=mesh.surface.faces,
        irregular=mesh.irregular,
        valences=mesh.valences[mesh.irregular],
        report=np.array(json.dumps(report)),
    )


def holds_quads(path: str | PathLike[str]) -> bool:
    """Return whether a file is an archive with quads, whatever else may be wrong with it."""
    path = as_path(path)
    try:
        with zipfile.ZipFile(path) as archive:
            return path.suffix.lower() == ".npz" and "quads.npy" in archive.namelist()
    except (OSError, ValueError, zipfile.BadZipFile):
        return False


def read_quads(path: str | PathLike[str]) -> QuadMesh:
    """Return a mesh of quads that was written as .npz.

    Raises:
        UnknownFormatError: the ending is another.
        MeshFileError: the file is not there, may not be read, or holds no mesh of quads.
    """
    path = as_path(path)
    known_ending(path, (".npz",), "quads with their surface are read from")
    return read_archive(path, _NAMES, _quad_mesh)


def _quad_mesh(reading: CheckedArrays) -> QuadMesh:
    from ... import TriangleMesh
    from .quad_mesh import QuadMesh

    reading.need(_NAMES, "mesh of quads")
    report = reading.report()
    vertices, surface = reading.finite("vertices", (None, 3)), reading.finite("surface_vertices", (None, 3))
    faces = reading.indices("surface_faces", (None, 3), len(surface))
    return QuadMesh(
        vertices=vertices,
        quads=reading.indices("quads", (None, 4), len(vertices)),
        faces=reading.indices("faces", (len(vertices),), len(faces)),
        barycentric=reading.finite("barycentric", (len(vertices), 3)),
        left_out=int(number(report["left_out"])),
        area_left_out=number(report["area_left_out"]),
        surface=TriangleMesh(surface, faces),
        notes=reading.notes(report),
    )


LINE_MATERIAL: dict[str, Any] = {
    "name": "edges",
    "pbrMetallicRoughness": {
        "baseColorFactor": [0.02, 0.02, 0.02, 1.0],
        "metallicFactor": 0.0,
        "roughnessFactor": 1.0,
    },
    # Lines have no side to be lit from.
    "extensions": {"KHR_materials_unlit": {}},
}


def write_quads_glb(mesh: QuadMesh, stream: IO[bytes]) -> None:
    """Write a mesh of quads as GLB: two triangles for each quad, and its edges as lines, so that quads are seen.

    The first primitive has the vertices in their order and the triangles on either side of the shorter diagonal of quad
    after quad; the second has the edges, a hundredth of the mean edge above the quads: nearer,
    and viewers draw them in dashes. All are 32-bit floats.

    Raises:
        MeshFileError: it is larger than GLB can be.
    """
    normals = shading_normals(vertex_normals(mesh.vertices, mesh.triangles))
    ends = mesh.vertices[mesh.edges]
    length = float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).mean())
    glb = Glb(
        {
            "asset": {"version": "2.0", "generator": "coneflat"},
            "extensionsUsed": ["KHR_materials_unlit"],
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0, "name": "quads"}],
            "materials": [MATERIAL, LINE_MATERIAL],
        }
    )
    normal = _floats(glb, normals)
    faces = {"attributes": {"POSITION": _places(glb, mesh.vertices), "NORMAL": normal}, "material": 0}
    lines = {"attributes": {"POSITION": _places(glb, mesh.vertices + 0.01 * length * normals)}, "material": 1}
    glb.tree["meshes"] = [
        {
            "name": "quads",
            "primitives": [
                faces | {"indices": _indices(glb, mesh.triangles)},
                lines | {"indices": _indices(glb, mesh.edges), "mode": 1},
            ],
        }
    ]
    glb.write(stream)


def _floats(glb: Glb, rows: FloatArray, **more: Any) -> int:
    form = {"componentType": 5126, "type": "VEC3", **more}
    return glb.add_array(rows.astype("<f4"), form, FOR_VERTICES)


def _places(glb: Glb, rows: FloatArray) -> int:
    return _floats(glb, rows, **bounds(rows.astype("<f4")))


def _indices(glb: Glb, rows: IntArray) -> int:
    form = {"componentType": 5125, "type": "SCALAR"}
    return glb.add_array(rows.reshape(-1, 1).astype("<u4"), form, FOR_INDICES)
