"""Reading a mesh from a file."""

from __future__ import annotations

import glob
import os
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from ..base.text import shown
from ..errors import EmptyMeshError, MeshFileError, OptionError, UnknownFormatError
from ..mesh.check import weld as weld_vertices
from .files import PIPE, PathName, as_path, known_ending, read_bytes, read_input, readable
from .gltf.read import parse_gltf
from .join import Joined, join_borders
from .mesh_file import MeshFile, check_corners
from .obj import parse_obj
from .off import is_off, parse_off
from .ply import parse_ply
from .split import usable_normals
from .stl import is_stl, parse_stl

_READERS: dict[str, Callable[[Path, bytes], MeshFile]] = {
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


def read_mesh(path: PathName, weld: bool | None = None) -> MeshFile:
    """Return the mesh of a file, with its polygons, in the file's own order of vertices and faces.

    The format follows the path's ending, in any case: .obj, .ply, .stl, .off, .gltf, .glb. Of a glTF scene
    all meshes are joined, each placed by its nodes' transforms. NaN and infinite coordinates are passed on.

    OBJ, OFF, PLY and STL have parsers of their own: libraries renumber vertices, split polygons, or drop the
    groups, materials and comments that an OBJ is to keep.

    Of glTF, vertices of one node alone are merged. What the file says of normals, or of smoothing, is kept.

    Args:
        path: the file; "-" for standard input, whose content tells the format.
        weld: whether to merge vertices at exactly the same position; by default only where the format
            cannot share vertices, which is STL and glTF.

    Raises:
        UnknownFormatError: the ending is not one of `INPUT_FORMATS`.
        MeshFileError: the file is not there, may not be read, or is not what its ending says.
        EmptyMeshError: it has no vertex or no face.
        FaceIndexError: a face names a vertex that does not exist.

    Examples:
        >>> mesh = coneflat.read_mesh(coneflat.sample_path())
        >>> mesh.vertices.shape, mesh.triangles.shape
        ((5300, 3), (10600, 3))
        >>> coneflat.read_mesh("missing.obj")
        Traceback (most recent call last):
            ...
        coneflat.errors.MeshFileError: missing.obj: there is no such file
    """
    path = as_path(path)
    if path == PIPE:
        return read_mesh_from(read_input(), path, weld)
    if path.is_dir():
        raise MeshFileError(
            f"{path} is a folder, not a file; `coneflat batch` flattens all meshes in a folder"
        )
    ending = known_ending(path, INPUT_FORMATS, "meshes are read from")
    return read_mesh_from(read_bytes(path), path, weld, ending)


def read_mesh_from(
    content: bytes, name: PathName, weld: bool | None = None, ending: str | None = None
) -> MeshFile:
    """Return the mesh that the content of a file is; see `read_mesh`.

    Args:
        content: the whole file.
        name: what to call it. A glTF's buffers and images are sought beside it, an OBJ's materials left there.
        weld: as of `read_mesh`.
        ending: one of `INPUT_FORMATS`, which tells the format; by default the content does.

    Raises:
        UnknownFormatError: the ending is not one of `INPUT_FORMATS`.
        MeshFileError, EmptyMeshError, FaceIndexError: as of `read_mesh`.
        OptionError: `weld` is none of these.
    """
    path = Path(name)
    if weld is not None and not isinstance(weld, (bool, np.bool_)):
        raise OptionError(f"weld is True, False or None, not {shown(weld)}")
    if not content or content.isspace():
        raise EmptyMeshError(f"{path} is empty")
    ending = format_of(content) if ending is None else ending.lower()
    if ending not in _READERS:
        raise UnknownFormatError(
            f"{ending!r} is not a format that meshes are read from: {', '.join(INPUT_FORMATS)}"
        )
    with readable(path, f"{ending[1:].upper()} file"):
        with np.errstate(invalid="ignore"):  # coordinates that are not numbers are passed on
            mesh = _READERS[ending](path, content)
        check_corners(path, mesh)
    normal = None
    if mesh.normals is not None and mesh.normal is not None:
        normal = usable_normals(mesh.normals, mesh.normal)
    mesh = replace(mesh, normals=None if normal is None else mesh.normals, normal=normal)
    return _welded(mesh) if (ending in _WELDED_BY_DEFAULT if weld is None else weld) else mesh


def format_of(content: bytes) -> str:
    """Return the ending that files of such content have: one of `INPUT_FORMATS`; .obj of what is nothing else."""
    head = content[:512].removeprefix(b"\xef\xbb\xbf").lstrip()
    if content.startswith(b"glTF"):
        return ".glb"
    if head.startswith(b"{"):
        return ".gltf"
    if content.startswith(b"ply"):
        return ".ply"
    if is_stl(content):
        return ".stl"
    return ".off" if is_off(content) else ".obj"


def _welded(mesh: MeshFile) -> MeshFile:
    """Return a mesh with vertices at the same position merged, those of each node of a scene for themselves."""
    blocks = (0, len(mesh.vertices)) if mesh.scene is None else mesh.scene.blocks
    kept, merged, count = [], [], 0
    for begin, end in pairwise(blocks):
        first, number = weld_vertices(mesh.vertices[begin:end])
        kept.append(first + begin)
        merged.append(number + count)
        count += len(first)
    if count == len(mesh.vertices):
        return mesh
    every = np.concatenate(kept)
    return replace(
        mesh,
        vertices=mesh.vertices[every],
        corners=np.concatenate(merged)[mesh.corners],
        welded=len(mesh.vertices) - count,
        unwelded=mesh.corners,
        properties={name: values[every] for name, values in mesh.properties.items()},
    )


def find_meshes(pattern: str) -> list[str]:
    """Return the paths that a pattern names, in their order: a file, a folder's meshes, or what *, ? and ** match.

    Raises:
        OptionError: it matches no mesh.
        MeshFileError: the folder cannot be read.
    """
    if os.path.isdir(pattern):
        try:
            every = [os.path.join(pattern, name) for name in os.listdir(pattern)]
        except OSError as error:
            raise MeshFileError(f"{pattern} cannot be read: {error.strerror or error}") from error
    elif os.path.exists(pattern):
        return [pattern]
    else:
        every = [path for path in glob.glob(pattern, recursive=True) if os.path.isfile(path)]
    matches = sorted(path for path in every if path.lower().endswith(INPUT_FORMATS))
    if not matches:
        raise OptionError(f"{pattern!r} matches no mesh ({', '.join(INPUT_FORMATS)})")
    return matches


def read_joined(path: PathName, weld: bool | None = None) -> Joined:
    """Return the mesh of a file, closed where nobody could want it open.

    Args:
        path: the file.
        weld: True merges all vertices at the same position and False none; None merges them in the formats that
            cannot share vertices, and in the others joins borders that coincide.

    Raises:
        MeshError, MeshFileError: as of `read_mesh`.
    """
    mesh = read_mesh(path, weld)
    # What a scene has as several nodes stays apart.
    if weld is not None or mesh.unwelded is not None or mesh.scene is not None:
        return Joined(mesh, np.arange(len(mesh.vertices)))
    return join_borders(mesh)
