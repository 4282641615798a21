"""Reading a mesh from a file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from os import PathLike
from pathlib import Path

from ..errors import ConeflatError, MeshFileError
from .atomic import as_path, known_ending
from .gltf import parse_gltf
from .model import MeshFile
from .obj import parse_obj
from .off import parse_off
from .ply import parse_ply
from .raw import RawMesh, check_corners, read_bytes
from .stl import parse_stl
from .weld import weld as weld_vertices

_READERS: dict[str, Callable[[Path, bytes], RawMesh]] = {
    ".obj": parse_obj,
    ".ply": parse_ply,
    ".stl": parse_stl,
    ".off": parse_off,
    ".gltf": parse_gltf,
    ".glb": parse_gltf,
}
#: STL has no shared vertices at all; glTF repeats a vertex wherever a normal or a UV differs.
_WELDED_BY_DEFAULT = {".stl", ".gltf", ".glb"}

#: Endings of the files that `read_mesh` reads.
INPUT_FORMATS = tuple(_READERS)


def read_mesh(path: str | PathLike[str], weld: bool | None = None) -> MeshFile:
    """Return the mesh of a file, with its polygons, in the file's own order of vertices and faces.

    The format follows the path's ending, in any case: .obj, .ply, .stl, .off, .gltf, .glb. Of a glTF scene
    all meshes are joined, each placed by its nodes' transforms. NaN and infinite coordinates are passed on.

    OBJ, OFF, PLY and STL have parsers of their own: libraries renumber vertices, split polygons, or drop the
    groups, materials and comments that an OBJ is to keep.

    Args:
        path: the file.
        weld: whether to merge vertices at exactly the same position; by default only where the format
            cannot share vertices, which is STL and glTF.

    Raises:
        UnknownFormatError: the ending is not one of `INPUT_FORMATS`.
        MeshFileError: the file is not there, may not be read, or is not what its ending says.
        EmptyMeshError: it has no vertex or no face.
        FaceIndexError: a face names a vertex that does not exist.
    """
    path = as_path(path)
    ending = known_ending(path, INPUT_FORMATS, "meshes are read from")
    content = read_bytes(path)
    try:
        mesh = _READERS[ending](path, content)
        check_corners(path, mesh)
    except (ConeflatError, MemoryError):
        raise
    except Exception as error:
        # Whatever a damaged file makes a parser do, the caller sees one kind of error.
        reason = f"{error} is missing" if isinstance(error, KeyError) else " ".join(str(error).split())[:200]
        raise MeshFileError(
            f"{path} is not a readable {ending[1:].upper()} file: {reason or type(error).__name__}"
        ) from error
    whole = MeshFile(
        path,
        mesh.vertices,
        mesh.corners,
        mesh.offsets,
        obj=mesh.obj,
        properties=mesh.properties,
        texture=mesh.texture,
        uv=mesh.uv,
    )
    return _welded(whole) if (ending in _WELDED_BY_DEFAULT if weld is None else weld) else whole


def _welded(mesh: MeshFile) -> MeshFile:
    """Return a mesh with vertices at the same position merged."""
    kept, merged = weld_vertices(mesh.vertices)
    if len(kept) == len(mesh.vertices):
        return mesh
    return replace(
        mesh,
        vertices=mesh.vertices[kept],
        corners=merged[mesh.corners],
        welded=len(mesh.vertices) - len(kept),
        unwelded=mesh.corners,
        properties={name: values[kept] for name, values in mesh.properties.items()},
    )
