"""The process that flattens, seen from the session: it may die, and is started again.

Messages to it and from it are JSON, and bytes after it.
"""

from __future__ import annotations

import json
import signal
import struct
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import IO, Any

from ...errors import StudioError

_SIZES = struct.Struct("<QQ")

Head = dict[str, Any]

COMMAND = [sys.executable, "-m", "coneflat.apps.studio.child"]


class Worker:
    """A process that is started when there is something to do."""

    def __init__(self, hear: Callable[[Head, bytes], None], mourn: Callable[[str], None]) -> None:
        """Args:
        hear: called with every answer, from a thread.
        mourn: called with how the process ended, where nobody has ended it.
        """
        self._hear, self._mourn = hear, mourn
        self._process: subprocess.Popen[bytes] | None = None
        self._lock = threading.Lock()

    def send(self, job: Head) -> None:
        """Give it something to do.

        Raises:
            StudioError: no process can be started.
        """
        with self._lock:
            process = self._started()
            assert process.stdin is not None
            with suppress(OSError):  # It has just died, which its listener hears.
                write_frame(process.stdin, job)

    def end(self) -> None:
        """End the process, whatever it does."""
        with self._lock:
            process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.wait()

    @property
    def is_alive(self) -> bool:
        """Whether there is a process."""
        process = self._process
        return process is not None and process.poll() is None

    @property
    def process_id(self) -> int | None:
        """The number of the process that there is."""
        process = self._process
        return None if process is None else process.pid

    def _started(self) -> subprocess.Popen[bytes]:
        if self._process is None or self._process.poll() is not None:
            try:
                # What interrupts us must not interrupt it: we end it, and it ends where nobody is left to hear it.
                self._process = subprocess.Popen(
                    COMMAND, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
                )
            except OSError as error:
                raise StudioError(f"no process could be started: {error.strerror or error}") from error
            threading.Thread(target=self._listen, args=(self._process,), daemon=True).start()
        return self._process

    def _listen(self, process: subprocess.Popen[bytes]) -> None:
        assert process.stdout is not None
        with suppress(OSError, ValueError):
            while (frame := read_frame(process.stdout)) is not None:
                if self._process is process:
                    self._hear(*frame)
        code = process.wait()
        if self._process is process:  # Nobody has ended it.
            self._mourn(_end_of(code))


def _end_of(code: int) -> str:
    """Return how a process with an exit code ended."""
    if code < 0:
        with suppress(ValueError):
            return f"was ended by {signal.Signals(-code).name}, for want of memory perhaps"
    return f"ended with code {code}"


def write_frame(stream: IO[bytes], head: Head, body: bytes = b"") -> None:
    """Write a message."""
    text = json.dumps(head).encode("ascii")
    stream.write(_SIZES.pack(len(text), len(body)) + text)
    if body:
        stream.write(body)
    stream.flush()


def read_frame(stream: IO[bytes]) -> tuple[Head, bytes] | None:
    """Return the next message, or None where the other side has ended."""
    sizes = stream.read(_SIZES.size)
    if len(sizes) < _SIZES.size:
        return None
    head_size, body_size = _SIZES.unpack(sizes)
    text, body = stream.read(head_size), stream.read(body_size)
    if len(text) < head_size or len(body) < body_size:
        return None
    return json.loads(text), body
