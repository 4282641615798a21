"""Colours of an image at points, with the wrap modes of glTF."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...base import FloatArray, IntArray
from ...io import CLAMP, MIRRORED, ImageTexture, decode_image, to_linear


class Sampler(NamedTuple):
    """An image with linear values, and how it is read.

    Attributes:
        image: (h, w, 4) linear RGBA, 0 to 1; the first row is the upper one.
        texture: its wrap modes and its filter.
    """

    image: NDArray[np.float32]
    texture: ImageTexture

    @classmethod
    def of(cls, texture: ImageTexture, is_colour: bool) -> Sampler:
        """Read an image; `is_colour`: it is in sRGB, except for its alpha.

        Raises:
            OptionError: Pillow is not installed.
            MeshFileError: the image cannot be read.
        """
        pixels, shades = decode_image(texture.read(), texture.name), np.arange(256) / 255
        image = shades.astype(np.float32)[pixels]
        if is_colour:
            image[..., :3] = to_linear(shades).astype(np.float32)[pixels[..., :3]]
        return cls(image, texture)

    def at(self, points: FloatArray) -> FloatArray:
        """Return (q, 4) the values at points (q, 2) with v downwards, interpolated between the centres of pixels."""
        sizes = self.image.shape[1::-1]
        (columns, x), (rows, y) = (
            _neighbours(points[:, axis], sizes[axis], self.texture.wraps[axis], self.texture.is_nearest)
            for axis in (0, 1)
        )
        pixels = np.asarray(self.image[rows[:, :, None], columns[:, None, :]], np.float64)
        return np.asarray(np.einsum("qi,qj,qijc->qc", y, x, pixels))


def _neighbours(places: FloatArray, size: int, wrap: int, is_nearest: bool) -> tuple[IntArray, FloatArray]:
    """Return (q, k) the pixels along an axis that are interpolated at places (q,), and (q, k) their weights.

    Each pixel is wrapped, as graphics cards do, so that the border of a repeated image is mixed with the opposite one.
    """
    # Large coordinates are reduced before they are multiplied, which keeps all numbers finite.
    if wrap == CLAMP:
        places = np.clip(places, -1.0, 2.0)
    else:
        places = np.mod(places, 2.0 if wrap == MIRRORED else 1.0)
    if is_nearest:
        return wrapped(np.floor(places * size).astype(np.int64)[:, None], size, wrap), np.ones(
            (len(places), 1)
        )
    between = places * size - 0.5
    first = np.floor(between)
    share = between - first
    pixels: IntArray = first.astype(np.int64)[:, None] + np.array([0, 1])
    return wrapped(pixels, size, wrap), np.stack([1 - share, share], axis=1)


def wrapped(pixels: IntArray, size: int, wrap: int) -> IntArray:
    """Return the pixels, 0 to size - 1, that an image shows at any integer positions."""
    if wrap == CLAMP:
        return np.clip(pixels, 0, size - 1)
    if wrap == MIRRORED:
        inside = np.mod(pixels, 2 * size)
        return np.minimum(inside, 2 * size - 1 - inside)
    return np.mod(pixels, size)
