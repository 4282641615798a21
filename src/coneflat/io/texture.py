"""Checkerboard textures that visualize a flattening, and images: textures of GLB files, pictures of pages."""

from __future__ import annotations

from io import BytesIO
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import FloatArray, IntArray
from ..base.defaults import CHECKER_CELLS
from ..errors import MeshFileError, OptionError
from ..geometry.planar import signed_double_areas
from ..result import Flattening
from .colours import BYTE, as_bytes
from .files import PathName, as_path, imported, read_bytes, readable

#: A light, slightly cool grey.
LIGHT_CELL = (0.86, 0.87, 0.89)
#: Blue, so that red and black marks stand out.
DARK_CELL = (0.34, 0.46, 0.62)
#: The image formats of glTF, and their names there.
EMBEDDED = {"PNG": "image/png", "JPEG": "image/jpeg"}
#: Maximum size of a picture in a page; larger ones are slow to open.
MAX_BYTES = 32 * 2**20
#: Largest values of grey images of integers and of floating-point numbers; the first that is large enough is white.
INTEGER_RANGES = (2**16 - 1, 2**31 - 1)
FLOAT_RANGES = (1.0, 2**8 - 1, 2**16 - 1)

_BEGINNINGS = {
    b"\x89PNG\r\n\x1a\n": "image/png",
    b"\xff\xd8\xff": "image/jpeg",
    b"GIF8": "image/gif",
    b"\xabKTX 20\xbb\r\n\x1a\n": "image/ktx2",
}


class Texture(NamedTuple):
    """The content of an image file, and its media type."""

    content: bytes
    kind: str


def cell_side(uv: FloatArray, uv_faces: IntArray, cells: float = CHECKER_CELLS) -> float:
    """Return the side, in UV units, of square cells such that `cells` squared of them have the layout's area.

    Args:
        uv: (u, 2) points of the layout.
        uv_faces: (m, 3) index into `uv` of every triangle corner.
        cells: number of cells along the square root of the area.

    Raises:
        OptionError: `cells` is not a positive number.
    """
    check_cells(cells)
    area = np.abs(signed_double_areas(uv[uv_faces])).sum() / 2
    return float(np.sqrt(area) or 1.0) / cells


def check_cells(cells: float) -> None:
    """Raise OptionError if the number of cells of a checkerboard is not a positive finite number."""
    if not 0 < cells < np.inf:
        raise OptionError(f"the number of cells of the checkerboard must be positive, got {cells:g}")


def find_texture(texture: PathName, result: Flattening | None = None) -> Texture | None:
    """Return the texture for an option: the checkerboard for a result, or the image of a file.

    PNG and JPEG files are used unchanged; other formats that Pillow reads are converted to PNG.

    Args:
        texture: "checker", or an image file.
        result: the result to texture; without one, None is returned for the checkerboard.

    Raises:
        OptionError: Pillow is not installed.
        MeshFileError: the file does not exist, or is not an image.
    """
    pillow = _pillow()
    if isinstance(texture, str) and texture == "checker":
        return None if result is None else _checkerboard(result, pillow)
    path = as_path(texture)
    content = read_bytes(path)
    with readable(path, "image"), pillow.open(BytesIO(content)) as image:
        image.load()
        if image.format in EMBEDDED and image.mode != "CMYK":
            return Texture(content, EMBEDDED[image.format])
        return Texture(_png(pillow.fromarray(_as_rgba(image))), EMBEDDED["PNG"])


def decode_image(content: bytes, name: PathName) -> NDArray[np.uint8]:
    """Return (h, w, 4) the RGBA of the content of an image file; `name` is for messages.

    Raises:
        OptionError: Pillow is not installed.
        MeshFileError: it is not an image that Pillow reads.
    """
    with readable(as_path(name), "image"), _pillow().open(BytesIO(content)) as image:
        return _as_rgba(image)


def _as_rgba(image: Any) -> NDArray[np.uint8]:
    """Return (h, w, 4) the RGBA of an image of Pillow; greys of more than 8 bits are scaled by their range.

    Pillow itself would clip them: all values above 255 would be white.
    """
    if image.mode[0] not in "IF":
        return np.asarray(image.convert("RGBA"))
    grey = np.nan_to_num(np.asarray(image, np.float64), nan=0.0)
    # Some versions of Pillow open 16-bit files as 32-bit integers.
    ranges = FLOAT_RANGES if image.mode == "F" else INTEGER_RANGES
    largest = next((limit for limit in ranges if grey.max(initial=0.0) <= limit), ranges[-1])
    shade = as_bytes(grey / largest)
    return np.stack([shade, shade, shade, np.full_like(shade, BYTE)], axis=-1)


def encode_png(pixels: NDArray[np.uint8]) -> Texture:
    """Return (h, w, 4) RGBA as a PNG file, without alpha if nothing is transparent.

    Raises:
        OptionError: Pillow is not installed.
    """
    shown = pixels if pixels[..., 3].min() < BYTE else np.ascontiguousarray(pixels[..., :3])
    return Texture(_png(_pillow().fromarray(shown)), EMBEDDED["PNG"])


def image_kind(content: bytes) -> str | None:
    """Return the media type of an image by its first bytes, if GLB files or pages support it; otherwise None."""
    if content[:4] == b"RIFF" and content[8:12] == b"WEBP":
        return "image/webp"
    return next((kind for beginning, kind in _BEGINNINGS.items() if content.startswith(beginning)), None)


def read_picture(path: PathName) -> Texture:
    """Return an unchanged PNG, JPEG, GIF or WebP file, the formats of browsers, recognized by its content.

    Raises:
        MeshFileError: the file cannot be read, has another format, or is too large.
    """
    path = as_path(path)
    content = read_bytes(path)
    kind = image_kind(content)
    if kind is None or kind == "image/ktx2":
        raise MeshFileError(f"{path} is not a PNG, JPEG, GIF or WebP picture")
    if len(content) > MAX_BYTES:
        size = f"{len(content) / 2**20:.0f} MiB; the limit for a page is {MAX_BYTES / 2**20:.0f}"
        raise MeshFileError(f"the picture {path} has {size}")
    return Texture(content, kind)


def _pillow() -> Any:
    return imported("PIL.Image", "textures need Pillow", '"coneflat[figures]"')


def _checkerboard(result: Flattening, image: Any) -> Texture:
    """Return a checkerboard with an integer number of cells across the unit square, sized as in the figures."""
    cells = max(round(1.0 / cell_side(result.uv, result.uv_faces)), 1)
    pixels = max(2048 // cells, 1)  # pixels per side of a cell, about 2048 in all
    along = np.arange(cells * pixels) // pixels
    # The first row is the upper one, where v is largest.
    dark = (along[None, :] + along[::-1, None]) % 2
    board = image.fromarray(dark.astype(np.uint8))
    board.putpalette(as_bytes(np.array([*LIGHT_CELL, *DARK_CELL])).tolist())
    return Texture(_png(board), EMBEDDED["PNG"])


def _png(image: Any) -> bytes:
    stream = BytesIO()
    image.save(stream, format="PNG", optimize=True)
    return stream.getvalue()
