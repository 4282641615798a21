"""Messages between two processes: JSON, and bytes after it."""

from __future__ import annotations

import json
import struct
from typing import IO, Any

_SIZES = struct.Struct("<QQ")

Head = dict[str, Any]


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
