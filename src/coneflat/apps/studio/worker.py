"""The worker process of a session, which is started again if it dies.

Messages in both directions are JSON followed by bytes. Page data passes without the arrays that the page has already;
most of them do not change when a cone is moved.
"""

from __future__ import annotations

import json
import struct
import subprocess
import sys
import threading
from collections import OrderedDict
from collections.abc import Callable
from contextlib import suppress
from hashlib import blake2b
from typing import IO, Any

from ...base import exit_text
from ...errors import StudioError

_SIZES = struct.Struct("<QQ")

Head = dict[str, Any]
Picture = tuple[Head, bytes]

COMMAND = [sys.executable, "-m", "coneflat.apps.studio.child"]


class Worker:
    """A process that is started when the first job is sent."""

    def __init__(
        self,
        on_message: Callable[[Head, bytes], None],
        on_exit: Callable[[str], None],
        process: subprocess.Popen[bytes] | None = None,
    ) -> None:
        """Args:
        on_message: called with every message of the process, from a thread.
        on_exit: called with a text that says how the process ended, unless `end` has ended it.
        process: one that was started in advance.
        """
        self._on_message, self._on_exit = on_message, on_exit
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        if process is not None:
            self._listen_to(process)

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
            return self._listen_to(start_process())
        return self._process

    def _listen_to(self, process: subprocess.Popen[bytes]) -> subprocess.Popen[bytes]:
        self._process = process
        threading.Thread(target=self._listen, args=(process,), daemon=True).start()
        return process

    def _listen(self, process: subprocess.Popen[bytes]) -> None:
        assert process.stdin is not None
        assert process.stdout is not None
        with suppress(OSError, ValueError), process.stdout:
            while (frame := read_frame(process.stdout)) is not None:
                if self._process is process:
                    self._on_message(*frame)
        code = process.wait()
        with self._lock, suppress(OSError):  # A job that it has not read is discarded.
            process.stdin.close()
        if self._process is process:  # It was not ended by `end`.
            self._on_exit(exit_text(code))


def start_process() -> subprocess.Popen[bytes]:
    """Return a worker process; it loads its modules, which takes a second, while this one continues.

    Raises:
        StudioError: no process can be started.
    """
    try:
        # An interrupt of this process must not interrupt the worker. It ends when its input is closed.
        return subprocess.Popen(
            COMMAND, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
        )
    except OSError as error:
        raise StudioError(f"no process could be started: {error.strerror or error}") from error


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


def with_hashes(head: Head, block: bytes) -> Head:
    """Return the head of page data with a hash of each of its arrays, by which equal arrays are recognised."""
    view = memoryview(block)
    # With 16 bytes, hashes of different arrays do not collide by chance.
    arrays = [
        {**entry, "print": blake2b(view[slice(*_span(entry))], digest_size=16).hexdigest()}
        for entry in head["arrays"]
    ]
    return {**head, "arrays": arrays}


class SentPictures:
    """The hashes of the arrays in the last page data that were sent, by their numbers."""

    def __init__(self) -> None:
        self._count = 0
        self._hashes: OrderedDict[int, dict[str, str]] = OrderedDict()

    def numbered(self, picture: Picture) -> Picture:
        """Return page data with a new number, from 1 on, and store the hashes of its arrays."""
        head, block = picture
        self._count += 1
        self._hashes[self._count] = {entry["name"]: entry["print"] for entry in head["arrays"]}
        if len(self._hashes) > 16:  # The page is never further behind than this.
            self._hashes.popitem(last=False)
        return {**head, "number": self._count}, block

    def without(self, number: int, picture: Picture) -> Picture:
        """Return page data without the arrays that those of a number contain, too; the offset of these is None."""
        head, block = picture
        hashes = self._hashes.get(number, {})
        arrays, parts, offset = [], [], 0
        for entry in head["arrays"]:
            if hashes.get(entry["name"]) == entry["print"]:
                arrays.append({**entry, "offset": None})
                continue
            begin, end = _span(entry)
            end += -end % 4  # Arrays are aligned to 4 bytes in the block.
            arrays.append({**entry, "offset": offset})
            parts.append(memoryview(block)[begin:end])
            offset += end - begin
        return {**head, "arrays": arrays}, b"".join(parts)


def _span(listed: dict[str, Any]) -> tuple[int, int]:
    """Return the begin and the end of an array in its block."""
    return listed["offset"], listed["offset"] + int(listed["type"][1:]) * listed["count"]
