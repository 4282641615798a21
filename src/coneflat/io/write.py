"""Writing a flattened mesh to a file."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import IO, TYPE_CHECKING

from ..errors import OptionError
from .atomic import as_path, atomic_write, check_target, known_ending
from .glb_write import write_glb
from .npz import write_npz
from .obj_write import write_obj
from .ply_write import write_ply
from .texture import find_texture

if TYPE_CHECKING:
    from ..result import Flattening


#: Endings of the files that `write_flattening` writes.
OUTPUT_FORMATS = (".obj", ".ply", ".glb", ".npz")


def check_output(path: str | PathLike[str], texture: str | PathLike[str] | None = None) -> Path:
    """Return the path if `write_flattening` can be expected to succeed with it and a texture.

    Worth asking before long work.

    Raises:
        UnknownFormatError: the ending is not one of `OUTPUT_FORMATS`.
        MeshFileError: the folder is missing, the path is a folder, or writing is not permitted; or the texture is no
            image that can be read.
        OptionError: files of this ending carry no texture, or Pillow is not installed.
    """
    path = as_path(path)
    ending = known_ending(path, OUTPUT_FORMATS, "results are written as")
    check_target(path)
    if texture is not None:
        if ending != ".glb":
            raise OptionError(f"only .glb files carry a texture, and {path} is none")
        find_texture(texture)
    return path


def write_flattening(
    result: Flattening, path: str | PathLike[str], texture: str | PathLike[str] | None = None
) -> Path:
    """Write a flattened mesh, in full or not at all, and return the path.

    The format follows the path's ending, in any case. An .obj keeps the polygons, groups, materials and
    comments of the OBJ the mesh was read from. A .ply and a .glb hold the triangles, with a vertex for every
    pair of vertex and UV point and the input's vertex as an attribute. An .npz holds all arrays of the result
    and its report as JSON.

    Args:
        result: what to write.
        path: the file.
        texture: of a .glb: "checker" for a checkerboard, or an image file that becomes part of it.

    Raises:
        UnknownFormatError: the ending is not one of `OUTPUT_FORMATS`.
        MeshFileError: the file cannot be written, or the texture cannot be read.
        OptionError: files of this ending carry no texture, or Pillow is not installed.
    """
    path = check_output(path, texture)
    image = None if texture is None else find_texture(texture, result)
    writers: dict[str, Callable[[IO[bytes]], None]] = {
        ".obj": lambda stream: write_obj(result, stream, path.parent),
        ".ply": lambda stream: write_ply(result, stream),
        ".glb": lambda stream: write_glb(result, stream, image),
        ".npz": lambda stream: write_npz(result, stream),
    }
    with atomic_write(path) as stream:
        writers[path.suffix.lower()](stream)
    return path
