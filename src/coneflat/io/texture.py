"""Images that GLB files carry as textures, and pages as pictures."""

from __future__ import annotations

from io import BytesIO
from os import PathLike
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..errors import MeshFileError, OptionError
from .atomic import as_path
from .checker import DARK_CELL, LIGHT_CELL, cell_side
from .raw import read_bytes

if TYPE_CHECKING:
    from ..result import Flattening

CHECKER = "checker"
"""The name that stands for the checkerboard."""

IMAGE_SIDE = 2048
"""Pixels of the checkerboard's image along each side, about."""

EMBEDDED = {"PNG": "image/png", "JPEG": "image/jpeg"}
"""The formats that glTF knows, and their names there."""

MOST_BYTES = 32 * 2**20
"""A page with a picture that has more is slow to open."""

_BEGINNINGS = {
    b"\x89PNG\r\n\x1a\n": "image/png",
    b"\xff\xd8\xff": "image/jpeg",
    b"GIF8": "image/gif",
    b"\xabKTX 20\xbb\r\n\x1a\n": "image/ktx2",
}


class Texture(NamedTuple):
    """An image file's content, and its kind as glTF names it."""

    content: bytes
    kind: str


def find_texture(texture: str | PathLike[str], result: Flattening | None = None) -> Texture | None:
    """Return the texture that is meant: the checkerboard for a result, or an image file's.

    PNG and JPEG files are taken as they are; others that Pillow reads become PNG.

    Args:
        texture: "checker", or an image file.
        result: what it is for; without one, the checkerboard is None.

    Raises:
        OptionError: Pillow is not installed.
        MeshFileError: there is no such file, or it is no image.
    """
    try:
        from PIL import Image
    except ImportError as error:
        raise OptionError('textures need Pillow: pip install "coneflat[figures]"') from error
    if isinstance(texture, str) and texture == CHECKER:
        return None if result is None else _checkerboard(result, Image)
    path = as_path(texture)
    content = read_bytes(path)
    try:
        with Image.open(BytesIO(content)) as image:
            image.load()
            if image.format in EMBEDDED and image.mode != "CMYK":
                return Texture(content, EMBEDDED[image.format])
            return Texture(_png(image.convert("RGBA")), EMBEDDED["PNG"])
    except Exception as error:
        # Whatever a damaged file makes Pillow do, the caller sees one kind of error.
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise MeshFileError(f"{path} is not a readable image: {reason}") from error


def image_kind(content: bytes) -> str | None:
    """Return the media type of an image, of those that GLB files or pages can have, by how it begins; else None."""
    if content[:4] == b"RIFF" and content[8:12] == b"WEBP":
        return "image/webp"
    return next((kind for beginning, kind in _BEGINNINGS.items() if content.startswith(beginning)), None)


def read_picture(path: str | PathLike[str]) -> Texture:
    """Return a PNG, JPEG, GIF or WebP file as it is: browsers read them. The content counts, not the ending.

    Raises:
        MeshFileError: it cannot be read, is no such picture, or is too large.
    """
    path = as_path(path)
    content = read_bytes(path)
    kind = image_kind(content)
    if kind is None or kind == "image/ktx2":
        raise MeshFileError(f"{path} is no PNG, JPEG, GIF or WebP picture")
    if len(content) > MOST_BYTES:
        size = f"{len(content) / 2**20:.0f} MiB; a page takes up to {MOST_BYTES / 2**20:.0f}"
        raise MeshFileError(f"the picture {path} has {size}")
    return Texture(content, kind)


def _checkerboard(result: Flattening, image: Any) -> Texture:
    """Return a checkerboard of whole cells across the unit square, as large as those of the figures."""
    cells = max(round(1.0 / cell_side(result.uv, result.uv_faces)), 1)
    pixels = max(IMAGE_SIDE // cells, 1)
    along = np.arange(cells * pixels) // pixels
    # The first row is the upper one, where v is largest.
    dark = (along[None, :] + along[::-1, None]) % 2
    board = image.fromarray(dark.astype(np.uint8))
    board.putpalette([round(255 * value) for value in (*LIGHT_CELL, *DARK_CELL)])
    return Texture(_png(board), EMBEDDED["PNG"])


def _png(image: Any) -> bytes:
    stream = BytesIO()
    image.save(stream, format="PNG", optimize=True)
    return stream.getvalue()
