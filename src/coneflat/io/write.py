"""Writing a flattened mesh to a file."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import IO, TYPE_CHECKING

from ..errors import UnknownFormatError
from .atomic import atomic_write, check_target
from .glb_write import write_glb
from .npz import write_npz
from .obj_write import write_obj
from .ply_write import write_ply

if TYPE_CHECKING:
    from ..result import Flattening


def _write_obj(result: Flattening, stream: IO[bytes], path: Path) -> None:
    write_obj(result, stream, path.parent)


def _write_ply(result: Flattening, stream: IO[bytes], path: Path) -> None:
    write_ply(result, stream)


def _write_glb(result: Flattening, stream: IO[bytes], path: Path) -> None:
    write_glb(result, stream)


def _write_npz(result: Flattening, stream: IO[bytes], path: Path) -> None:
    write_npz(result, stream)


_WRITERS: dict[str, Callable[[Flattening, IO[bytes], Path], None]] = {
    ".obj": _write_obj,
    ".ply": _write_ply,
    ".glb": _write_glb,
    ".npz": _write_npz,
}

#: Endings of the files that `write_flattening` writes.
OUTPUT_FORMATS = tuple(_WRITERS)


def check_output(path: str | PathLike[str]) -> Path:
    """Return the path if `write_flattening` can be expected to succeed with it.

    Worth asking before long work.

    Raises:
        UnknownFormatError: the ending is not one of `OUTPUT_FORMATS`.
        MeshFileError: the folder is missing, the path is a folder, or writing is not permitted.
    """
    path = Path(path)
    if path.suffix.lower() not in _WRITERS:
        ending = f"ends with {path.suffix!r}, which is no known format" if path.suffix else "has no ending"
        raise UnknownFormatError(f"{path} {ending}; results are written as {', '.join(OUTPUT_FORMATS)}")
    check_target(path)
    return path


def write_flattening(result: Flattening, path: str | PathLike[str]) -> Path:
    """Write a flattened mesh, in full or not at all, and return the path.

    The format follows the path's ending, in any case. An .obj keeps the polygons, groups, materials and
    comments of the OBJ the mesh was read from. A .ply and a .glb hold the triangles, with a vertex for every
    pair of vertex and UV point and the input's vertex as an attribute. An .npz holds all arrays of the result
    and its report as JSON.

    Raises:
        UnknownFormatError: the ending is not one of `OUTPUT_FORMATS`.
        MeshFileError: the file cannot be written.
    """
    path = check_output(path)
    with atomic_write(path) as stream:
        _WRITERS[path.suffix.lower()](result, stream, path)
    return path
