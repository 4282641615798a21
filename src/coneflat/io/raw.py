"""The content of files, and what all readers check of a mesh."""

from __future__ import annotations

import os
import stat
import sys
from pathlib import Path

import numpy as np

from ..base.arrays import IntArray
from ..errors import ConeflatError, EmptyMeshError, FaceIndexError, MeshFileError
from ..mesh.polygons import first_bad_corner
from .mesh_file import MeshFile

#: Instead of the number of a UV point: the corner has none.
NO_UV = -1


#: Stands for standard input, and for standard output.
PIPE = Path("-")


def read_bytes(path: Path) -> bytes:
    """Return the content of a file.

    Raises:
        MeshFileError: there is no such file, it is a directory, or it may not be read.
        EmptyMeshError: the file is empty.
    """
    try:
        # Devices, pipes and sockets may never end, or never begin: opening a pipe waits for who writes to it.
        if not stat.S_ISREG(mode := path.stat().st_mode) and not stat.S_ISDIR(mode):
            raise MeshFileError(
                f"{path} is not a file but a device, a pipe or a socket; give - to read from a pipe"
            )
        content = path.read_bytes()
    except ConeflatError:
        raise
    except FileNotFoundError as error:
        why = ": it is a link that leads nowhere" if path.is_symlink() else ""
        raise MeshFileError(f"{path}: there is no such file{why}") from error
    except IsADirectoryError as error:
        raise MeshFileError(f"{path} is a folder, not a file") from error
    except PermissionError as error:
        reason = "is a folder, not a file" if os.path.isdir(path) else "may not be read (no permission)"
        raise MeshFileError(f"{path} {reason}") from error
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise MeshFileError(f"{path} cannot be read: {reason}") from error
    if not content or content.isspace():
        raise EmptyMeshError(f"{path} is empty")
    return content


def read_input() -> bytes:
    """Return what comes in on standard input.

    Raises:
        MeshFileError: that is a terminal, or cannot be read.
        EmptyMeshError: nothing comes in.
    """
    if sys.stdin is None or sys.stdin.isatty():
        raise MeshFileError(
            "- stands for a mesh on standard input, and there is none: pipe a file into the command"
        )
    try:
        content = sys.stdin.buffer.read()
    except OSError as error:
        raise MeshFileError(f"standard input cannot be read: {error.strerror or error}") from error
    if not content or content.isspace():
        raise EmptyMeshError("nothing came in on standard input")
    return content


def check_corners(path: Path, mesh: MeshFile) -> None:
    """Refuse a mesh without vertices or faces, with a face of fewer than 3 corners, or a bad index.

    Raises:
        EmptyMeshError, MeshFileError, FaceIndexError: respectively.
    """
    count = len(mesh.vertices)
    if count == 0:
        raise EmptyMeshError(f"{path} has no vertices")
    if len(mesh.offsets) < 2:
        raise EmptyMeshError(f"{path} has no faces")
    sizes = np.diff(mesh.offsets)
    if sizes.min() < 3:
        i = int(np.argmax(sizes < 3))
        raise MeshFileError(f"{path}: face {i} has {sizes[i]} corners, but a face needs at least 3")
    c = first_bad_corner(mesh.corners, count)
    if c is not None:
        i = int(np.searchsorted(mesh.offsets, c, side="right")) - 1
        raise FaceIndexError(
            f"{path}: face {i} names vertex {mesh.corners[c]}, but there are {count} vertices, from 0 on"
        )


def offsets_of(sizes: IntArray) -> IntArray:
    """Return (p + 1,) the offsets of polygons of (p,) sizes."""
    offsets = np.zeros(len(sizes) + 1, dtype=np.int64)
    np.cumsum(sizes, out=offsets[1:])
    return offsets


def triangle_offsets(count: int) -> IntArray:
    """Return (count + 1,) the offsets of `count` triangles."""
    return np.arange(0, 3 * count + 1, 3, dtype=np.int64)
