"""Mesh files by name, by folder, by pattern."""

from __future__ import annotations

import glob
import os

from ..errors import MeshFileError, OptionError
from .read import INPUT_FORMATS


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
