"""Writing a file so that it is there in full or not at all."""

from __future__ import annotations

import glob
import os
import secrets
import shutil
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from os import PathLike
from pathlib import Path
from typing import IO, Any

from ..errors import ConeflatError, MeshFileError, UnknownFormatError
from .raw import PIPE


def as_path(path: object) -> Path:
    """Return the path that text, bytes or a path object names.

    Raises:
        MeshFileError: it is something else.
    """
    try:
        return Path(os.fsdecode(path))  # type: ignore[arg-type]
    except TypeError as error:
        raise MeshFileError(f"a file is named by text or a path, not by {type(path).__name__}") from error


def known_ending(path: Path, endings: Collection[str], what: str) -> str:
    """Return the ending of a path in lower case if it is known.

    what: is done with files of these endings, for the message: "meshes are read from".

    Raises:
        UnknownFormatError: it is not.
    """
    ending = path.suffix.lower()
    if ending not in endings:
        wrong = f"ends with {path.suffix!r}, which is no known format" if path.suffix else "has no ending"
        raise UnknownFormatError(f"{path} {wrong}; {what} {', '.join(endings)}")
    return ending


def check_target(path: str | PathLike[str]) -> Path:
    """Return the file that a path names, links followed, if it looks as if it could be written.

    Raises:
        MeshFileError: the folder is missing, or the path is a pipe or something else than a file, or writing is not
            permitted.
    """
    path = as_path(path)
    if path == PIPE:
        raise MeshFileError("- is a pipe, to which only `coneflat flatten` writes its result: name a file")
    try:
        target = Path(os.path.realpath(path))
        folder = target.parent
        if not folder.is_dir():
            raise MeshFileError(f"{path} cannot be written: there is no folder {folder}; create it first")
        if target.is_dir():
            raise MeshFileError(f"{path} cannot be written: it is a folder")
        if target.exists():
            if not target.is_file():
                raise MeshFileError(f"{path} cannot be written: it is not an ordinary file")
            if not os.access(target, os.W_OK):
                raise MeshFileError(f"{path} cannot be written: no permission to change it")
        if not os.access(folder, os.W_OK):
            raise MeshFileError(f"{path} cannot be written: no permission to write in {folder}")
    except ConeflatError:
        raise
    except (OSError, ValueError) as error:
        raise _failure(path, error) from error
    return target


def checked_target(path: str | PathLike[str], endings: Collection[str], what: str) -> Path:
    """Return a path if a file can be expected to be written there that has one of some endings, see `known_ending`.

    Raises:
        UnknownFormatError: it has another ending.
        MeshFileError: as of `check_target`.
    """
    path = as_path(path)
    known_ending(path, endings, what)
    check_target(path)
    return path


def make_folder(path: Path) -> None:
    """Make a folder, and those that it is in, if they are missing.

    Raises:
        MeshFileError: it cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        raise MeshFileError(f"cannot make the folder {path}: {_reason(error)}") from error


@contextmanager
def atomic_write(path: str | PathLike[str], mode: str = "wb") -> Iterator[IO[Any]]:
    """Open a file that appears under its name only when it is complete.

    The content goes to a temporary file in the same folder, which takes the name at the end of the block; if
    the block ends by any exception, it is removed and an older file of that name stays as it was.

    Args:
        path: the file to write.
        mode: "wb" for bytes, "w" for text, which is UTF-8 with the line ends as given.

    Raises:
        MeshFileError: the file cannot be written, or the disk is full.
    """
    if mode not in ("w", "wb"):
        raise ValueError(f"mode must be 'w' or 'wb', not {mode!r}")
    target = check_target(path)
    # Created by open(), and not by tempfile, so that it has the permissions of any new file.
    temporary = target.with_name(_temporary(target.name, secrets.token_hex(6)))
    text = {} if mode == "wb" else {"encoding": "utf-8", "newline": ""}
    try:
        with open(temporary, mode.replace("w", "x"), **text) as stream:  # type: ignore[call-overload]
            yield stream
        if target.exists():
            shutil.copymode(target, temporary)
        os.replace(temporary, target)
    except ConeflatError:
        raise
    except OSError as error:
        raise _failure(as_path(path), error) from error
    finally:
        temporary.unlink(missing_ok=True)


def _temporary(name: str, mark: str) -> str:
    return f".{name[:100]}.{mark}.tmp"


def remove_unfinished(path: str | PathLike[str]) -> None:
    """Remove what a process that was killed while it wrote a file has left of it."""
    target = Path(os.path.realpath(path))
    for left in target.parent.glob(_temporary(glob.escape(target.name[:100]), "?" * 12)):
        with suppress(OSError):
            left.unlink()


def _failure(path: Path, error: Exception) -> MeshFileError:
    return MeshFileError(f"{path} cannot be written: {_reason(error)}")


def _reason(error: Exception) -> str:
    return error.strerror if isinstance(error, OSError) and error.strerror else str(error)
