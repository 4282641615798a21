"""The worker process of a session, which is started again if it dies.

Messages in both directions are JSON followed by bytes.
"""

from __future__ import annotations

import json
import struct
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import IO, Any

from ...base import exit_text
from ...errors import StudioError

_SIZES = struct.Struct("<QQ")

Head = dict[str, Any]

COMMAND = [sys.executable, "-m", "coneflat.apps.studio.child"]


class Worker:
    """A process that is started when the first job is sent."""

    def __init__(self, on_message: Callable[[Head, bytes], None], on_exit: Callable[[str], None]) -> None:
        """Args:
        on_message: called with every message of the process, from a thread.
        on_exit: called with a text that says how the process ended, unless `end` has ended it.
        """
        self._on_message, self._on_exit = on_message, on_exit
        self._process: subprocess.Popen[bytes] | None = None
        self._lock = threading.Lock()

    def send(self, job: Head) -> None:
        """Send a job to the process.

        Raises:
            StudioError: no process can be started.
        """
        with self._lock:
            process = self._started()
            assert process.stdin is not None
            with suppress(OSError):  # The process has just died, which `on_exit` reports.
                write_frame(process.stdin, job)

    def end(self) -> None:
        """End the process in any state."""
        with self._lock:
            process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.wait()

    @property
    def is_alive(self) -> bool:
        """Return whether the process is running."""
        process = self._process
        return process is not None and process.poll() is None

    def _started(self) -> subprocess.Popen[bytes]:
        if self._process is None or self._process.poll() is not None:
            try:
                # An interrupt of this process must not interrupt the worker. It ends when its input is closed.
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
                    self._on_message(*frame)
        code = process.wait()
        if self._process is process:  # It was not ended by `end`.
            self._on_exit(exit_text(code))


def write_frame(stream: IO[bytes], head: Head, body: bytes = b"") -> None:
    """Write a message to a stream."""
    text = json.dumps(head).encode("ascii")
    stream.write(_SIZES.pack(len(text), len(body)) + text)
    if body:
        stream.write(body)
    stream.flush()


def read_frame(stream: IO[bytes]) -> tuple[Head, bytes] | None:
    """Return the next message; None if the other side has closed the stream."""
    sizes = stream.read(_SIZES.size)
    if len(sizes) < _SIZES.size:
        return None
    head_size, body_size = _SIZES.unpack(sizes)
    text, body = stream.read(head_size), stream.read(body_size)
    if len(text) < head_size or len(body) < body_size:
        return None
    return json.loads(text), body
