"""How well the vertices of a surface can be seen from all around."""

from __future__ import annotations

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray, dots
from ..errors import OptionError
from .normals import vertex_normals
from .ties import own_axes

# Directions to look from, evenly spread, and pixels along the side of each picture.
DIRECTIONS, PIXELS = 64, 256
# Pixels by which a vertex may lie behind what a picture shows there, where it faces the eye, and still be seen. Where
# the surface is steep it is so much farther away within a pixel; from STEEPEST on there is not much to be seen.
BIAS, STEEPEST = 1.0, 20.0


def visible_share(vertices: FloatArray, faces: IntArray, up: FloatArray | None = None) -> FloatArray:
    """Return (n,) how much of what there is to see of each vertex from all around can be seen, 0 to 1.

    This is ambient occlusion: a direction counts by the cosine of its angle with the normal, as the surface then looks
    so large. The surface has two sides; the one that is seen better counts. It is drawn from every direction.

    Args:
        vertices, faces: (n, 3), (m, 3) one mesh, or several that hide one another.
        up: (3,) where up is, if the model is mostly seen standing: what is seen from straight below counts nothing.

    Raises:
        OptionError: `up` is no direction.
    """
    axes = own_axes(vertices)
    if up is not None:
        axes = _upright(axes, np.asarray(up, dtype=np.float64))
    centred = vertices - vertices.mean(axis=0)
    size = float(np.sqrt(dots(centred, centred).max()))
    points = centred * ((PIXELS / 2 - 1) / size if size > 0 else 1.0)
    normals = vertex_normals(vertices, faces)
    seen, whole = np.zeros((2, 2, len(vertices)))
    for direction in _directions() @ axes:
        facing = normals @ direction
        side = (facing < 0).astype(np.int64), np.arange(len(vertices))
        amount = np.abs(facing)
        whole[side] += amount
        weight = 1.0 if up is None else (1 + direction @ axes[2]) / 2
        seen[side] += weight * amount * _is_seen(points, faces, amount, direction, axes)
    share = (seen / np.maximum(whole, np.finfo(float).tiny)).max(axis=0)
    # The mean of (1 + z) / 2 over a hemisphere, where directions count by z.
    best = 1.0 if up is None else 5 / 6
    return np.minimum(share / best, 1.0)


def _is_seen(
    points: FloatArray, faces: IntArray, facing: FloatArray, direction: FloatArray, axes: FloatArray
) -> BoolArray:
    """Return (n,) whether points, in pixels from the centre, are seen from a direction."""
    from .raster import fill_nearest

    right = np.cross(direction, axes[np.argmin(np.abs(axes @ direction))])
    right /= np.linalg.norm(right)
    seen_from = points @ np.stack([right, np.cross(direction, right), -direction], axis=1)
    seen_from[:, :2] += PIXELS / 2
    depth, face = np.full((PIXELS, PIXELS), np.inf), np.empty((PIXELS, PIXELS), dtype=np.int64)
    fill_nearest(seen_from, faces, depth, face)
    column, row = seen_from[:, :2].astype(np.int64).T
    steep = np.sqrt(np.maximum(1 - facing**2, 0.0)) / np.maximum(facing, 1 / STEEPEST)
    visible: BoolArray = seen_from[:, 2] <= depth[row, column] + BIAS * (1 + steep)
    return visible


def _directions() -> FloatArray:
    """Return (d, 3) unit vectors evenly spread over the sphere: on a spiral, as seeds in a sunflower."""
    index = np.arange(DIRECTIONS)
    z = 1 - (2 * index + 1) / DIRECTIONS
    angle = np.pi * (1 + 5**0.5) * index
    radius = np.sqrt(1 - z**2)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)


def _upright(axes: FloatArray, up: FloatArray) -> FloatArray:
    """Return axes of which the third is up."""
    length = np.linalg.norm(up) if up.shape == (3,) else np.nan
    if not (np.isfinite(length) and length > 0):
        raise OptionError(f"up is a direction, three numbers that are not all 0, not {up.tolist()}")
    up = up / length
    flat = axes - np.outer(axes @ up, up)
    first = flat[np.argmax(np.linalg.norm(flat, axis=1) > 0.5)]
    first = first / np.linalg.norm(first)
    return np.stack([first, np.cross(up, first), up])
