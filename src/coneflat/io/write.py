"""Writing a flattened mesh to a file."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import IO, TYPE_CHECKING

from ..errors import OptionError, UnknownFormatError
from ..options.outputs import FORMATS
from .files import atomic_write, checked_target
from .gltf.write import write_glb
from .npz import write_npz
from .obj import write_obj
from .ply import write_ply
from .texture import find_texture

if TYPE_CHECKING:
    from ..result import Flattening


#: Endings of the files that `write_flattening` writes.
OUTPUT_FORMATS = tuple(f".{name}" for name in FORMATS)


def check_output(path: str | PathLike[str], texture: str | PathLike[str] | None = None) -> Path:
    """Return the path if `write_flattening` can be expected to succeed with it and a texture.

    Worth asking before long work.

    Raises:
        UnknownFormatError: the ending is not one of `OUTPUT_FORMATS`.
        MeshFileError: the folder is missing, the path is a folder, or writing is not permitted; or the texture is no
            image that can be read.
        OptionError: files of this ending carry no texture, or Pillow is not installed.
    """
    path = checked_target(path, OUTPUT_FORMATS, "results are written as")
    _check_texture(path, path.suffix.lower(), texture)
    if texture is not None:
        find_texture(texture)
    return path


def write_flattening(
    result: Flattening, path: str | PathLike[str], texture: str | PathLike[str] | None = None
) -> Path:
    """Write a flattened mesh, in full or not at all, and return the path.

    The format follows the path's ending, in any case. An .obj keeps the polygons, groups, materials and
    comments of the OBJ the mesh was read from. A .glb keeps the scene of the glTF or GLB that the mesh was read from.
    Of other meshes, a .ply and a .glb hold the triangles, with a vertex for every pair of vertex and UV point, the
    input's normals, and the input's vertex as an attribute. An .npz holds all arrays of the result
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
    return _write(result, path, texture)[0]


def write_measured(
    result: Flattening, path: str | PathLike[str], texture: str | PathLike[str] | None = None
) -> Flattening:
    """Write a flattened mesh as `write_flattening` does, and return it as the file holds it; see `as_written`."""
    written, stored = _write(result, path, texture)
    from .written import as_written

    return as_written(stored, written.suffix.lower())


def _write(
    result: Flattening, path: str | PathLike[str], texture: str | PathLike[str] | None
) -> tuple[Path, Flattening]:
    """Write a flattened mesh, and return the path and the arrays that were written."""
    path = check_output(path, texture)
    with atomic_write(path) as stream:
        stored = write_stream(result, stream, path.suffix, texture, path.parent)
    return path, stored


def write_stream(
    result: Flattening,
    stream: IO[bytes],
    ending: str,
    texture: str | PathLike[str] | None = None,
    folder: Path | None = None,
) -> Flattening:
    """Write a flattened mesh to a binary stream, and return the arrays that were written; see `write_flattening`.

    Args:
        result: what to write.
        stream: where to; it need not know its position.
        ending: one of `OUTPUT_FORMATS`.
        texture: as of `write_flattening`.
        folder: where the file will be, for paths in it; by default the current one.

    Raises:
        UnknownFormatError, MeshFileError, OptionError: as of `write_flattening`.
    """
    ending, folder = ending.lower(), Path() if folder is None else folder
    if ending not in OUTPUT_FORMATS:
        raise UnknownFormatError(
            f"{ending!r} is no format that results are written as: {', '.join(OUTPUT_FORMATS)}"
        )
    _check_texture(f"a {ending}", ending, texture)
    image = None if texture is None else find_texture(texture, result)
    # A .glb holds fewer digits, at which triangles are to be upright and apart, too.
    from .written import as_written

    stored = as_written(result, ending) if ending == ".glb" else result
    writers: dict[str, Callable[[], None]] = {
        ".obj": lambda: write_obj(stored, stream, folder),
        ".ply": lambda: write_ply(stored, stream),
        ".glb": lambda: write_glb(stored, stream, image, folder),
        ".npz": lambda: write_npz(stored, stream),
    }
    writers[ending]()
    return stored


def _check_texture(name: object, ending: str, texture: str | PathLike[str] | None) -> None:
    if texture is not None and ending != ".glb":
        raise OptionError(f"only .glb files carry a texture, and {name} is none")
