"""The texture that a file has, for pages that show it on the model."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from ... import ConeflatError, MeshFile
from ...base import FloatArray
from ...io import Texture, encode_png
from .materials import BASE, Painted

#: Coordinate of corners without the texture, by which the page knows them.
NO_PICTURE = -1e6


def own_picture(mesh: MeshFile, max_side: int = 2048) -> tuple[Texture, FloatArray] | None:
    """Return the base colours of the material of most triangles of a file, and its UVs; None if it has no image.

    Args:
        mesh: the file.
        max_side: largest number of pixels along a side; the image is reduced if it has more.

    Returns:
        The image, and (k, 2) the UVs of the k polygon corners of the file, v upwards; -1e6 at corners of triangles of
        other materials.
    """
    with suppress(ConeflatError, AttributeError, TypeError):  # Materials that are not valid are not shown.
        painted = Painted(mesh.path, None)
        layers = {i: layer for i in painted.shown if (layer := painted.layer(BASE, i)) is not None}
        material = max(layers, key=np.bincount(painted.material).item, default=None)
        if material is not None:
            places = painted.placed(layers[material])
            has_picture = (painted.material == material) & np.isfinite(places).all(axis=(1, 2))
            uv = np.full((len(mesh.corners), 2), NO_PICTURE)
            uv[painted.corners[has_picture]] = places[has_picture] * [1, -1] + [0, 1]
            image = painted.pixels(layers[material])
            step = -(-max(image.shape) // max_side)
            return encode_png(np.ascontiguousarray(image[::step, ::step])), uv
    return None
