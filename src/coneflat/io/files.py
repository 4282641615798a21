"""Reading of files, and atomic writing: a file is either written completely or not at all."""

from __future__ import annotations

import glob
import os
import secrets
import shutil
import stat
import sys
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from os import PathLike
from pathlib import Path, PureWindowsPath
from typing import IO, Any, TypeAlias

from ..base.text import short_repr
from ..errors import ConeflatError, EmptyMeshError, MeshFileError, OptionError, UnknownFormatError

#: The types of file names that users may pass.
PathName: TypeAlias = "str | PathLike[str]"
#: Stands for standard input, and for standard output.
PIPE = Path("-")


def imported(module: str, need: str, package: str) -> Any:
    """Return a module that not every installation has.

    Args:
        module: its name.
        need: what needs it, for the message: "textures need Pillow".
        package: what pip installs.

    Raises:
        OptionError: it is not installed.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise OptionError(f"{need}: pip install {package}") from error


def read_bytes(path: Path) -> bytes:
    """Return the content of a file.

    Raises:
        MeshFileError: the file does not exist, is a directory, or cannot be read.
        EmptyMeshError: the file is empty.
    """
    try:
        mode = path.stat().st_mode
        # Reading devices, pipes and sockets may never end, and opening a pipe waits for a writer.
        is_file = stat.S_ISREG(mode) or stat.S_ISDIR(mode)
        content = path.read_bytes() if is_file else b""
    except FileNotFoundError as error:
        advice = ": it is a broken link" if path.is_symlink() else ""
        raise MeshFileError(f"{path}: there is no such file{advice}") from error
    except (IsADirectoryError, PermissionError) as error:
        reason = "is a folder, not a file" if os.path.isdir(path) else "cannot be read (no permission)"
        raise MeshFileError(f"{path} {reason}") from error
    except (OSError, ValueError) as error:
        raise MeshFileError(f"{path} cannot be read: {_reason(error)}") from error
    if not is_file:
        raise MeshFileError(
            f"{path} is not a file but a device, a pipe or a socket; give - to read from a pipe"
        )
    if not content or content.isspace():
        raise EmptyMeshError(f"{path} is empty")
    return content


def read_input() -> bytes:
    """Return the content of standard input.

    Raises:
        MeshFileError: standard input is a terminal, or cannot be read.
        EmptyMeshError: it is empty.
    """
    if sys.stdin is None or sys.stdin.isatty():
        raise MeshFileError(
            "- stands for a mesh on standard input, but there is none: pipe a file into the command"
        )
    try:
        content = sys.stdin.buffer.read()
    except OSError as error:
        raise MeshFileError(f"standard input cannot be read: {_reason(error)}") from error
    if not content or content.isspace():
        raise EmptyMeshError("standard input is empty")
    return content


@contextmanager
def readable(path: Path, kind: str) -> Iterator[None]:
    """Convert the exceptions of a parser on a damaged file into MeshFileError, as a context manager.

    Args:
        path: the file, for messages.
        kind: the expected kind of file, such as "PLY file".

    Raises:
        MeshFileError: the block raises an exception other than ConeflatError and MemoryError.
    """
    try:
        yield
    except (ConeflatError, MemoryError):
        raise
    except Exception as error:
        # Pillow adds the address of the stream.
        text = " ".join(str(error).partition(" <_io.")[0].split())[:200]
        reason = f"{error} is missing" if isinstance(error, KeyError) else text
        raise MeshFileError(f"{path} is not a readable {kind}: {reason or type(error).__name__}") from error


def as_path(path: object) -> Path:
    """Return the path given by text, bytes or a path object.

    Raises:
        MeshFileError: `path` has another type.
    """
    try:
        return Path(os.fsdecode(path))  # type: ignore[arg-type]
    except TypeError as error:
        raise MeshFileError(f"a file name must be text or a path, got {type(path).__name__}") from error


def known_ending(path: Path, endings: Collection[str], usage: str, advice: str = "") -> str:
    """Return the ending of a path in lower case if it is known.

    Args:
        path: the path.
        endings: the known endings.
        usage: how files with these endings are used, for the message: "meshes are read from".
        advice: what to do with the file, for the message.

    Raises:
        UnknownFormatError: the ending is not known.
    """
    ending = path.suffix.lower()
    if ending not in endings:
        wrong = f"ends with {path.suffix!r}, which is not a known format" if path.suffix else "has no ending"
        raise UnknownFormatError(f"{path} {wrong}{advice}; {usage} {', '.join(endings)}")
    return ending


def inner_path(folder: Path, name: str) -> Path:
    """Return the path of a file that another file names relative to its folder.

    Only files in this folder, and in folders in it, are read: a file from elsewhere must not make a program read
    others. Links are followed.

    Raises:
        MeshFileError: the name is an absolute path, or leads out of the folder.
    """
    is_absolute = os.path.isabs(name) or PureWindowsPath(name).is_absolute()
    if is_absolute or os.path.normpath(name).split(os.sep)[0] == os.pardir:
        raise MeshFileError(
            f"{short_repr(name)} is outside the folder of the file, and is not read: put both into one folder"
        )
    return folder / name


def moved_path(name: bytes, source: str, target: str) -> bytes:
    """Return a path relative to the folder `source` rewritten relative to the folder `target`, separated by slashes."""
    if os.path.isabs(name):
        return name
    full = os.path.join(os.fsencode(source), name)
    try:
        relative = os.path.relpath(full, os.fsencode(target))
    except ValueError:
        # A file on another drive can be reached only by its full path.
        relative = full
    return relative.replace(os.fsencode(os.sep), b"/")


def check_target(path: PathName) -> Path:
    """Return the file of a path, with links resolved, if it can be expected to be writable.

    Raises:
        MeshFileError: the folder is missing, the path is a pipe or not an ordinary file, or writing is not permitted.
    """
    path = as_path(path)
    if path == PIPE:
        raise MeshFileError("- is a pipe, to which only `coneflat flatten` writes its result: name a file")
    try:
        target = Path(os.path.realpath(path))
        folder = target.parent
        if not folder.is_dir():
            reason = f"there is no folder {folder}; create it first"
        elif target.is_dir():
            reason = "it is a folder"
        elif target.exists() and not target.is_file():
            reason = "it is not an ordinary file"
        elif target.exists() and not os.access(target, os.W_OK):
            reason = "no permission to change it"
        elif not os.access(folder, os.W_OK):
            reason = f"no permission to write in {folder}"
        else:
            return target
    except (OSError, ValueError) as error:
        raise MeshFileError(f"{path} cannot be written: {_reason(error)}") from error
    raise MeshFileError(f"{path} cannot be written: {reason}")


def checked_target(path: PathName, endings: Collection[str], usage: str) -> Path:
    """Return a path if it has a known ending and can be expected to be writable, see `known_ending`, `check_target`.

    Raises:
        UnknownFormatError: the ending is not known.
        MeshFileError: the file cannot be written.
    """
    path = as_path(path)
    known_ending(path, endings, usage)
    check_target(path)
    return path


def make_folder(path: Path) -> None:
    """Create a folder and its missing parents.

    Raises:
        MeshFileError: the folder cannot be created.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        raise MeshFileError(f"cannot create the folder {path}: {_reason(error)}") from error


@contextmanager
def atomic_write(path: PathName, mode: str = "wb") -> Iterator[IO[Any]]:
    """Open a file that appears under its name only when it is complete.

    The content is written to a temporary file in the same folder, which is renamed at the end of the block. If the
    block raises an exception, the temporary file is removed and an older file of that name is not changed.

    Args:
        path: the file to write.
        mode: "wb" for bytes, "w" for text, which is UTF-8 with the line ends as given.

    Raises:
        MeshFileError: the file cannot be written, or the disk is full.
    """
    target = check_target(path)
    # Created by open() instead of tempfile, so that it has the default permissions of a new file.
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
        raise MeshFileError(f"{as_path(path)} cannot be written: {_reason(error)}") from error
    finally:
        temporary.unlink(missing_ok=True)


def _temporary(name: str, mark: str) -> str:
    return f".{name[:100]}.{mark}.tmp"


def remove_unfinished(path: PathName) -> None:
    """Remove the temporary files of a process that was killed while it wrote a file."""
    target = Path(os.path.realpath(path))
    for left in target.parent.glob(_temporary(glob.escape(target.name[:100]), "?" * 12)):
        with suppress(OSError):
            left.unlink()


def _reason(error: Exception) -> str:
    return error.strerror if isinstance(error, OSError) and error.strerror else str(error)
