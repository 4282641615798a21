"""Reading of a mesh from a file."""

from __future__ import annotations

import glob
import os
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..base.formats import FREESURFER, Use, endings
from ..base.text import short_repr
from ..errors import EmptyMeshError, MeshFileError, MissingUVError, OptionError, UnknownFormatError
from ..mesh.check import weld as weld_vertices
from .brains import is_freesurfer, is_gifti, parse_freesurfer, parse_gifti
from .files import PIPE, PathName, as_path, known_ending, read_bytes, read_input, readable
from .gltf.read import is_glb, is_gltf, parse_gltf
from .join import Joined, join_borders
from .mesh_file import MeshFile, check_corners, differing_properties, without_short_faces
from .obj import parse_obj
from .off import is_off, parse_off
from .ply.read import parse_ply
from .split import usable_normals
from .stl import is_stl, parse_stl


class InputFormat(NamedTuple):
    """How files of a format are read.

    Attributes:
        parse: returns the mesh for a path and a content.
        is_content: returns whether a content is of the format.
        is_text: the files are text, or begin with text.
        shares_vertices: faces share vertices. STL repeats every vertex for each triangle, glTF wherever a normal or a
            UV differs; these are merged by default.
        has_uv_sets: files may have several sets of UVs, whose number `parse` takes as well.
    """

    parse: Callable[..., MeshFile]
    is_content: Callable[[bytes], bool]
    is_text: bool = False
    shares_vertices: bool = True
    has_uv_sets: bool = False


#: How each format of `base/formats.py` is read, in the order in which a content is compared with them; any other
#: content is taken for OBJ.
_FORMATS = {
    ".obj": InputFormat(parse_obj, lambda content: False, is_text=True),
    ".ply": InputFormat(parse_ply, lambda content: content.startswith(b"ply"), is_text=True),
    ".stl": InputFormat(parse_stl, is_stl, shares_vertices=False),
    ".off": InputFormat(parse_off, is_off, is_text=True),
    ".gltf": InputFormat(parse_gltf, is_gltf, is_text=True, shares_vertices=False, has_uv_sets=True),
    ".glb": InputFormat(parse_gltf, is_glb, shares_vertices=False, has_uv_sets=True),
    ".gii": InputFormat(parse_gifti, is_gifti),
    **dict.fromkeys(FREESURFER, InputFormat(parse_freesurfer, is_freesurfer)),
}
#: Endings of the files that `read_mesh` reads.
INPUT_FORMATS = endings(Use.MESH)


#: What to do with the files of modellers, which are not read, by their endings.
_ADVICE = {
    **dict.fromkeys(
        (".fbx", ".dae", ".3ds", ".max", ".ma", ".mb", ".c4d", ".usd", ".usda", ".usdc", ".usdz"),
        "export glTF (.glb) from the program that made it",
    ),
    ".blend": "export glTF (.glb) from Blender, or map it there with the extension of `coneflat blender`",
}


def export_advice(ending: str) -> str:
    """Return what to do with a file of a modeller, in brackets after a space; "" for other endings."""
    advice = _ADVICE.get(ending.lower())
    return "" if advice is None else f" ({advice})"


def read_mesh(path: PathName, weld: bool | None = None, uv_set: int = 0) -> MeshFile:
    """Return the mesh of a file, with its polygons, in the file's own order of vertices and faces.

    The format is given by the path's ending, in upper or lower case: one of `INPUT_FORMATS`, or of FreeSurfer's names
    such as lh.pial. FreeSurfer's surfaces with further names are recognized by their content. All meshes of a glTF
    scene are combined, each transformed by its nodes. NaN and infinite coordinates are not rejected here.

    OBJ, OFF, PLY and STL have parsers in this package, because libraries renumber vertices, split polygons, or drop the
    groups, materials and comments that are needed to write an OBJ.

    For glTF, vertices are merged only within a node. Normals and smoothing groups of the file are kept.

    Args:
        path: the file; "-" for standard input, whose format is recognized by its content.
        weld: whether to merge vertices at exactly the same position; by default only for formats that
            cannot share vertices, which are STL and glTF.
        uv_set: the number of the UVs, of glTF: 0 for TEXCOORD_0, 1 for TEXCOORD_1, as of lightmaps.

    Returns:
        The mesh.

    Raises:
        UnknownFormatError: the ending is not one of `INPUT_FORMATS`.
        MeshFileError: the file does not exist, cannot be read, or is not of the format of its ending.
        EmptyMeshError: it has no vertex or no face.
        FaceIndexError: a face refers to a vertex that does not exist.
        MissingUVError: `uv_set` is not 0, and the file has no such UVs.

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
        return read_mesh_from(read_input(), path, weld, uv_set=uv_set)
    if os.path.isdir(path):  # unlike the method, no error if the name is too long
        raise MeshFileError(
            f"{path} is a folder, not a file; `coneflat batch` flattens all meshes in a folder"
        )
    if path.suffix.lower() not in INPUT_FORMATS and path.is_file():
        # The names of FreeSurfer's surfaces are not a fixed set: lh.graymid, lh.pial.T1.
        content = read_bytes(path)
        if is_freesurfer(content):
            return read_mesh_from(content, path, weld, uv_set=uv_set)
    ending = known_ending(path, INPUT_FORMATS, "meshes are read from", export_advice(path.suffix))
    return read_mesh_from(read_bytes(path), path, weld, ending, uv_set)


def read_mesh_from(
    content: bytes,
    name: PathName,
    weld: bool | None = None,
    ending: str | None = None,
    uv_set: int = 0,
) -> MeshFile:
    """Return the mesh in the content of a file; see `read_mesh`.

    Args:
        content: the whole file.
        name: its path. Buffers and images of a glTF are read from the same folder; paths of OBJ materials are relative
            to it.
        weld: as of `read_mesh`.
        ending: the format, one of `INPUT_FORMATS`; by default it is recognized by the content.
        uv_set: as of `read_mesh`.

    Raises:
        UnknownFormatError: the ending is not one of `INPUT_FORMATS`.
        MeshFileError, EmptyMeshError, FaceIndexError, MissingUVError: as of `read_mesh`.
        OptionError: `weld` is not True, False or None, or `uv_set` is not an integer from 0 on.
    """
    path = Path(name)
    if weld is not None and not isinstance(weld, (bool, np.bool_)):
        raise OptionError(f"weld must be True, False or None, got {short_repr(weld)}")
    if isinstance(uv_set, bool) or not isinstance(uv_set, (int, np.integer)) or uv_set < 0:
        raise OptionError(f"uv_set must be an integer, 0 or more, got {short_repr(uv_set)}")
    if not content or content.isspace():
        raise EmptyMeshError(f"{path} is empty")
    ending = format_of(content) if ending is None else ending.lower()
    if ending not in _FORMATS:
        raise UnknownFormatError(
            f"{ending!r} is not a format that meshes are read from: {', '.join(INPUT_FORMATS)}"
        )
    form = _FORMATS[ending]
    if form.is_text and is_utf16(content):
        raise MeshFileError(f"{path}, line 1: this is text in UTF-16: save the file as UTF-8 or ASCII")
    with readable(path, f"{ending[1:].upper()} file"):
        with np.errstate(invalid="ignore"):  # NaN coordinates are not rejected here
            sets = {"uv_set": int(uv_set)} if form.has_uv_sets else {}
            mesh = without_short_faces(form.parse(path, content, **sets))
        check_corners(path, mesh)
    if uv_set and not (form.has_uv_sets and mesh.uv is not None):
        raise MissingUVError(
            f"{path} has no UV set {uv_set}: `coneflat unwrap --uv-set 1` writes one to a .glb"
        )
    normal = None
    if mesh.normals is not None and mesh.normal is not None:
        normal = usable_normals(mesh.normals, mesh.normal)
    mesh = replace(mesh, normals=None if normal is None else mesh.normals, normal=normal)
    is_welded = not form.shares_vertices if weld is None else weld
    return _welded(mesh) if is_welded else mesh


def format_of(content: bytes) -> str:
    """Return the ending in `INPUT_FORMATS` for the format of a content; .obj if it is none of the others."""
    return next((ending for ending, form in _FORMATS.items() if form.is_content(content)), ".obj")


def is_utf16(content: bytes) -> bool:
    """Return whether a content begins as text in UTF-16 does: with its mark, or with a letter and a zero."""
    is_filled = list(map(bool, content[:4]))
    return content.startswith((b"\xff\xfe", b"\xfe\xff")) or is_filled in ([1, 0, 1, 0], [0, 1, 0, 1])


def _welded(mesh: MeshFile) -> MeshFile:
    """Return a mesh with vertices at the same position merged, separately for each node of a scene."""
    blocks = (0, len(mesh.vertices)) if mesh.scene is None else mesh.scene.blocks
    first_vertices, merged, count = [], [], 0
    for begin, end in pairwise(blocks):
        first, number = weld_vertices(mesh.vertices[begin:end])
        first_vertices.append(first + begin)
        merged.append(number + count)
        count += len(first)
    if count == len(mesh.vertices):
        return mesh
    every, number = np.concatenate(first_vertices), np.concatenate(merged)
    return replace(
        mesh,
        vertices=mesh.vertices[every],
        corners=number[mesh.corners],
        merged_properties=differing_properties(mesh, every[number]),
        welded=len(mesh.vertices) - count,
        unwelded=mesh.corners,
        properties={name: values[every] for name, values in mesh.properties.items()},
    )


def find_meshes(pattern: str) -> list[str]:
    """Return the sorted paths of a pattern: a file, the meshes of a folder, or the meshes that *, ? and ** match.

    Raises:
        OptionError: the pattern matches no mesh.
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


def read_joined(path: PathName, weld: bool | None = None, uv_set: int = 0) -> Joined:
    """Return the mesh of a file with duplicated border edges joined.

    Args:
        path: the file.
        weld: True merges all vertices at the same position and False none; None merges them in the formats that
            cannot share vertices, and joins coinciding borders in the others.
        uv_set: as of `read_mesh`.

    Raises:
        MeshError, MeshFileError, MissingUVError, OptionError: as of `read_mesh`.
    """
    mesh = read_mesh(path, weld, uv_set)
    # Different nodes of a scene stay separate.
    if weld is not None or mesh.unwelded is not None or mesh.scene is not None:
        return Joined(mesh, np.arange(len(mesh.vertices)))
    return join_borders(mesh)
