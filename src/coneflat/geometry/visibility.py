"""How well the vertices of a surface can be seen from all around."""

from __future__ import annotations

import math

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray, dots
from ..base.compiled import compiled
from ..errors import OptionError
from ..mesh.ties import shape_axes
from .triangles import vertex_normals

# Directions to look from, evenly spread, and pixels along the side of each picture.
DIRECTIONS, PIXELS = 64, 256


def visible_share(vertices: FloatArray, faces: IntArray, up: FloatArray | None = None) -> FloatArray:
    """Return (n,) how much of what there is to see of each vertex from all around can be seen, 0 to 1.

    This is ambient occlusion: a direction counts by the cosine of its angle with the normal, as the surface then looks
    so large. The surface has two sides; the one that is seen better counts. It is drawn from every direction.

    Args:
        vertices, faces: (n, 3), (m, 3) one mesh, or several that hide one another.
        up: (3,) where up is, if the model is mostly seen standing: what is seen from straight below counts nothing.

    Raises:
        OptionError: `up` is not a direction.
    """
    axes = shape_axes(vertices)
    if up is not None:
        axes = _axes_with_up(axes, np.asarray(up, dtype=np.float64))
    centred = vertices - vertices.mean(axis=0)
    size = float(np.sqrt(dots(centred, centred).max()))
    points = centred * ((PIXELS / 2 - 1) / size if size > 0 else 1.0)
    normals = vertex_normals(vertices, faces)
    seen, total = np.zeros((2, 2, len(vertices)))
    for direction in _directions() @ axes:
        facing = normals @ direction
        side = (facing < 0).astype(np.int64), np.arange(len(vertices))
        amount = np.abs(facing)
        total[side] += amount
        weight = 1.0 if up is None else (1 + direction @ axes[2]) / 2
        seen[side] += weight * amount * _is_seen(points, faces, amount, direction, axes)
    share = (seen / np.maximum(total, np.finfo(float).tiny)).max(axis=0)
    # The mean of (1 + z) / 2 over a hemisphere, where directions count by z.
    best = 1.0 if up is None else 5 / 6
    return np.minimum(share / best, 1.0)


def _is_seen(
    points: FloatArray, faces: IntArray, facing: FloatArray, direction: FloatArray, axes: FloatArray
) -> BoolArray:
    """Return (n,) whether points, in pixels from the centre, are seen from a direction."""
    right = np.cross(direction, axes[np.argmin(np.abs(axes @ direction))])
    right /= np.linalg.norm(right)
    seen_from = points @ np.stack([right, np.cross(direction, right), -direction], axis=1)
    seen_from[:, :2] += PIXELS / 2
    depth, face = np.full((PIXELS, PIXELS), np.inf), np.empty((PIXELS, PIXELS), dtype=np.int64)
    fill_nearest(seen_from, faces, depth, face)
    column, row = seen_from[:, :2].astype(np.int64).T
    # A vertex may lie a pixel behind what the picture shows, and as much more as the surface falls within a pixel.
    # Where the picture shows nothing, the depth is infinite: all is before it.
    gap = np.maximum(seen_from[:, 2] - depth[row, column] - 1, -np.finfo(float).max)
    behind = facing * gap
    return np.asarray(behind <= np.sqrt(np.maximum(1 - facing**2, 0.0)))


def _directions() -> FloatArray:
    """Return (d, 3) unit vectors evenly spread over the sphere: on a spiral, as seeds in a sunflower."""
    index = np.arange(DIRECTIONS)
    z = 1 - (2 * index + 1) / DIRECTIONS
    angle = np.pi * (1 + 5**0.5) * index
    radius = np.sqrt(1 - z**2)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)


def _axes_with_up(axes: FloatArray, up: FloatArray) -> FloatArray:
    """Return axes of which the third is up."""
    length = np.linalg.norm(up) if up.shape == (3,) else np.nan
    if not (np.isfinite(length) and length > 0):
        raise OptionError(f"up is a direction, three numbers that are not all 0, not {up.tolist()}")
    up = up / length
    flat = axes - np.outer(axes @ up, up)
    first = flat[np.argmax(np.linalg.norm(2 * flat, axis=1) > 1)]
    first = first / np.linalg.norm(first)
    return np.stack([first, np.cross(up, first), up])


@compiled
def first_centre(position: float, size: int) -> int:
    """Return the first pixel whose centre is at a position or beyond, from 0 up to the size."""
    return int(min(max(math.ceil(position - 0.5), 0.0), float(size)))


@compiled
def crossing(points: FloatArray, p: int, q: int, y: float) -> float:
    """Return the x at which the side between two points crosses a scan line; NaN if it does not."""
    # From the upper end to the lower in every triangle: both faces of an edge then round alike.
    if points[p, 1] > points[q, 1]:
        p, q = q, p
    if not points[p, 1] <= y < points[q, 1]:
        return math.nan
    drop = points[q, 1] - points[p, 1]
    return points[p, 0] + (y - points[p, 1]) / drop * (points[q, 0] - points[p, 0])


@compiled
def fill_nearest(points: FloatArray, faces: IntArray, depth: FloatArray, face: IntArray) -> None:
    """Write the nearest face, and its depth, to every pixel whose centre a face covers.

    points: (n, 3) pixel x to the right, pixel y downwards, and depth away from the eye. depth, face: (h, w) what there
    is already; of faces at the same depth the first stays.
    """
    height, width = depth.shape
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        xa, ya, za = points[a, 0], points[a, 1], points[a, 2]
        xb, yb, zb = points[b, 0] - xa, points[b, 1] - ya, points[b, 2] - za
        xc, yc, zc = points[c, 0] - xa, points[c, 1] - ya, points[c, 2] - za
        total = xb * yc - yb * xc
        right = (zb * yc - zc * yb) / total if total != 0 else 0.0
        down = (zc * xb - zb * xc) / total if total != 0 else 0.0
        # In a triangle seen nearly edge on the gradient is mostly rounding error.
        nearest = min(za, points[b, 2], points[c, 2])
        farthest = max(za, points[b, 2], points[c, 2])
        first = first_centre(min(ya, points[b, 1], points[c, 1]), height)
        stop = first_centre(max(ya, points[b, 1], points[c, 1]), height)
        for row in range(first, stop):
            y = row + 0.5
            left, end = math.inf, -math.inf
            for p, q in ((a, b), (b, c), (c, a)):
                x = crossing(points, p, q, y)
                if x < left:
                    left = x
                if x > end:
                    end = x
            for column in range(first_centre(left, width), first_centre(end, width)):
                z = za + right * (column + 0.5 - xa) + down * (y - ya)
                z = min(max(z, nearest), farthest)
                if z < depth[row, column]:
                    depth[row, column] = z
                    face[row, column] = f
