"""The user's picture, for the page."""

from __future__ import annotations

from os import PathLike

from ...errors import MeshFileError
from ...files.atomic import as_path
from ...files.raw import read_bytes
from ...files.texture import Texture

MOST_BYTES = 32 * 2**20
"""A page that holds more is slow to open."""

_BEGINNINGS = ((b"\x89PNG\r\n\x1a\n", "image/png"), (b"\xff\xd8\xff", "image/jpeg"), (b"GIF8", "image/gif"))


def read_picture(path: str | PathLike[str]) -> Texture:
    """Return a PNG, JPEG, GIF or WebP file as it is: browsers read them. The content counts, not the ending.

    Raises:
        MeshFileError: it cannot be read, is no such picture, or is too large.
    """
    path = as_path(path)
    content = read_bytes(path)
    kind = next((kind for beginning, kind in _BEGINNINGS if content.startswith(beginning)), None)
    if content[:4] == b"RIFF" and content[8:12] == b"WEBP":
        kind = "image/webp"
    if kind is None:
        raise MeshFileError(f"{path} is no PNG, JPEG, GIF or WebP picture")
    if len(content) > MOST_BYTES:
        size = f"{len(content) / 2**20:.0f} MiB; a page takes up to {MOST_BYTES / 2**20:.0f}"
        raise MeshFileError(f"the picture {path} has {size}")
    return Texture(content, kind)
