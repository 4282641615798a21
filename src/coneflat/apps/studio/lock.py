"""Locks of projects: no two studios change the same one.

The lock is one of the operating system on a file beside the project, which contains the address of the studio. It ends
with its process in any way, also when the machine is restarted, so that a file that was left locks nothing.
"""

from __future__ import annotations

import json
import os
import socket
import sys
from contextlib import suppress
from pathlib import Path

from ...errors import ProjectError

if sys.platform == "win32":
    import msvcrt

    #: The locked byte. Windows denies reading locked bytes, and this one is behind the content.
    _LOCKED_BYTE = 1 << 30

    def _lock(descriptor: int) -> None:
        os.lseek(descriptor, _LOCKED_BYTE, os.SEEK_SET)
        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        os.lseek(descriptor, 0, os.SEEK_SET)

    #: The error of a lock that another process has.
    _Taken = PermissionError
else:
    import fcntl

    def _lock(descriptor: int) -> None:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)

    _Taken = BlockingIOError


# Number of times that a lock is tried whose file is removed in the meantime.
MAX_TRIES = 10


class ProjectLock:
    """The lock of a project file.

    Attributes:
        project: path of the project file.
    """

    def __init__(self, project: Path, address: str) -> None:
        """Args:
            project: path of the project file, which need not exist.
            address: address of the page of this studio, which others are told.

        Raises:
            ProjectError: another studio has the project open.
        """
        self.project = project
        self._path = lock_path(project)
        self._descriptor: int | None = None
        # A file system without locks, or a folder that cannot be written, does not keep anyone from looking at a mesh.
        with suppress(OSError):
            self._descriptor = self._acquire()
            self._write(address)

    def _acquire(self) -> int:
        """Return the descriptor of the locked file.

        Raises:
            ProjectError: another studio has locked it.
            OSError: the file cannot be created or locked.
        """
        for _ in range(MAX_TRIES):
            descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o600)
            try:
                _lock(descriptor)
            except _Taken as error:
                os.close(descriptor)
                raise ProjectError(_refusal(self.project, self._path)) from error
            except OSError:
                os.close(descriptor)
                raise
            if _is_same(descriptor, self._path):
                return descriptor
            os.close(descriptor)  # The studio that had it has just removed it.
        raise OSError("the file of the lock is not the one that is open")  # so on some network file systems

    def _write(self, address: str) -> None:
        assert self._descriptor is not None
        os.truncate(self._descriptor, 0)
        content = {"address": address, "machine": socket.gethostname()}
        os.write(self._descriptor, json.dumps(content).encode("ascii"))

    def release(self) -> None:
        """Release the lock, and remove its file."""
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is None:
            return
        if sys.platform == "win32":  # It does not remove files that are open.
            os.close(descriptor)
        with suppress(OSError):
            self._path.unlink()
        if sys.platform != "win32":
            os.close(descriptor)


def lock_path(project: Path) -> Path:
    """Return the path of the file that is locked for a project."""
    resolved = project.resolve()
    return resolved.with_name(f".{resolved.name}.lock")


def _is_same(descriptor: int, path: Path) -> bool:
    """Return whether a descriptor is that of the file that has a path now."""
    try:
        return os.path.samestat(os.fstat(descriptor), os.stat(path))
    except FileNotFoundError:
        return False


def _refusal(project: Path, path: Path) -> str:
    """Return the message on a project that another studio has open, with its address if it is known."""
    try:
        content = json.loads(path.read_text(encoding="ascii"))
        address, machine = str(content["address"]), str(content["machine"])
    except (OSError, ValueError, KeyError, TypeError):
        address = machine = ""
    place = "" if machine in ("", socket.gethostname()) else f" on the machine {machine}"
    where = f": {address}" if address else ""
    return f"{project.name} is open in another studio{place}{where}; use that one, or end it"
