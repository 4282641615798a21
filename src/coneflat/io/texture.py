"""The checkerboard that shows what a flattening does, and images: textures of GLB files, pictures of pages."""

from __future__ import annotations

from io import BytesIO
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..base.arrays import FloatArray, IntArray
from ..errors import MeshFileError, OptionError
from ..geometry.planar import signed_double_areas
from .files import PathName, as_path, read_bytes, readable

if TYPE_CHECKING:
    from ..result import Flattening

#: A light, slightly cool grey.
LIGHT_CELL = (0.86, 0.87, 0.89)
#: Blue, so that red and black marks stand out.
DARK_CELL = (0.34, 0.46, 0.62)
#: Cells in a row that is as long as the square root of the area: about 20 across a ball.
CELLS = 36
#: The formats that glTF knows, and their names there.
EMBEDDED = {"PNG": "image/png", "JPEG": "image/jpeg"}
#: A page with a picture that has more is slow to open.
MOST_BYTES = 32 * 2**20

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


def cell_side(uv: FloatArray, uv_faces: IntArray, cells: float = CELLS) -> float:
    """Return the side, in UV units, of square cells of which the layout's area holds `cells` squared.

    Args:
        uv: (u, 2) points of the layout.
        uv_faces: (m, 3) index into them of every triangle corner.
        cells: how many are as long as the root of the area.

    Raises:
        OptionError: `cells` is not a positive number.
    """
    check_cells(cells)
    area = np.abs(signed_double_areas(uv[uv_faces])).sum() / 2
    return float(np.sqrt(area) or 1.0) / cells


def check_cells(cells: float) -> None:
    """Raise OptionError if a checkerboard cannot have so many cells."""
    if not 0 < cells < np.inf:
        raise OptionError(f"the number of cells of the checkerboard must be positive, not {cells:g}")


def find_texture(texture: PathName, result: Flattening | None = None) -> Texture | None:
    """Return the texture that is meant: the checkerboard for a result, or an image file's.

    PNG and JPEG files are taken as they are; others that Pillow reads become PNG.

    Args:
        texture: "checker", or an image file.
        result: what it is for; without one, the checkerboard is None.

    Raises:
        OptionError: Pillow is not installed.
        MeshFileError: there is no such file, or it is not an image.
    """
    try:
        from PIL import Image
    except ImportError as error:
        raise OptionError('textures need Pillow: pip install "coneflat[figures]"') from error
    if isinstance(texture, str) and texture == "checker":
        return None if result is None else _checkerboard(result, Image)
    path = as_path(texture)
    content = read_bytes(path)
    with readable(path, "image"), Image.open(BytesIO(content)) as image:
        image.load()
        if image.format in EMBEDDED and image.mode != "CMYK":
            return Texture(content, EMBEDDED[image.format])
        return Texture(_png(image.convert("RGBA")), EMBEDDED["PNG"])


def image_kind(content: bytes) -> str | None:
    """Return the media type of an image, of those that GLB files or pages can have, by how it begins; else None."""
    if content[:4] == b"RIFF" and content[8:12] == b"WEBP":
        return "image/webp"
    return next((kind for beginning, kind in _BEGINNINGS.items() if content.startswith(beginning)), None)


def read_picture(path: PathName) -> Texture:
    """Return a PNG, JPEG, GIF or WebP file as it is: browsers read them. The content counts, not the ending.

    Raises:
        MeshFileError: it cannot be read, is no such picture, or is too large.
    """
    path = as_path(path)
    content = read_bytes(path)
    kind = image_kind(content)
    if kind is None or kind == "image/ktx2":
        raise MeshFileError(f"{path} is not a PNG, JPEG, GIF or WebP picture")
    if len(content) > MOST_BYTES:
        size = f"{len(content) / 2**20:.0f} MiB; a page takes up to {MOST_BYTES / 2**20:.0f}"
        raise MeshFileError(f"the picture {path} has {size}")
    return Texture(content, kind)


def _checkerboard(result: Flattening, image: Any) -> Texture:
    """Return a checkerboard of whole cells across the unit square, as large as those of the figures."""
    cells = max(round(1.0 / cell_side(result.uv, result.uv_faces)), 1)
    pixels = max(2048 // cells, 1)  # of each cell's side, about 2048 in all
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
