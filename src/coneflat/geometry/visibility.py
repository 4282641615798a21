"""Visibility of the vertices of a surface from all directions (ambient occlusion)."""

from __future__ import annotations

import math

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray, dots
from ..base.jit import compiled
from ..errors import OptionError
from ..mesh.ties import shape_axes
from .triangles import vertex_normals

# Number of view directions, evenly distributed, and number of pixels along a side of each depth image.
DIRECTIONS, PIXELS = 64, 256


def visible_share(vertices: FloatArray, faces: IntArray, up: FloatArray | None = None) -> FloatArray:
    """Return (n,) the visible fraction of each vertex, averaged over all view directions, 0 to 1.

    This is ambient occlusion. A direction is weighted by the cosine of its angle with the normal, the apparent size of
    the surface. The surface has two sides, of which the more visible one counts. A depth image is drawn for every
    direction.

    Args:
        vertices, faces: (n, 3), (m, 3) one mesh, or several that occlude one another.
        up: (3,) the up direction of the model: directions are weighted from 1 for views
            from above to 0 for views from below. None: all directions have the same weight.

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
    """Return (n,) whether points, given in pixels from the centre, are visible from a direction."""
    right = np.cross(direction, axes[np.argmin(np.abs(axes @ direction))])
    right /= np.linalg.norm(right)
    seen_from = points @ np.stack([right, np.cross(direction, right), -direction], axis=1)
    seen_from[:, :2] += PIXELS / 2
    depth, face = np.full((PIXELS, PIXELS), np.inf), np.empty((PIXELS, PIXELS), dtype=np.int64)
    fill_nearest(seen_from, faces, depth, face)
    column, row = seen_from[:, :2].astype(np.int64).T
    # A vertex counts as visible up to one pixel behind the depth image, plus the change of depth of the surface within
    # a pixel. Pixels without a surface have infinite depth, so everything is in front of it.
    gap = np.maximum(seen_from[:, 2] - depth[row, column] - 1, -np.finfo(float).max)
    behind = facing * gap
    return np.asarray(behind <= np.sqrt(np.maximum(1 - facing**2, 0.0)))


def _directions() -> FloatArray:
    """Return (d, 3) unit vectors distributed evenly over the sphere, on a Fibonacci spiral."""
    index = np.arange(DIRECTIONS)
    z = 1 - (2 * index + 1) / DIRECTIONS
    angle = np.pi * (1 + 5**0.5) * index
    radius = np.sqrt(1 - z**2)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)


def _axes_with_up(axes: FloatArray, up: FloatArray) -> FloatArray:
    """Return (3, 3) orthonormal axes, as rows, of which the third is `up`."""
    length = np.linalg.norm(up) if up.shape == (3,) else np.nan
    if not (np.isfinite(length) and length > 0):
        raise OptionError(f"up must be a direction: three numbers that are not all 0, got {up.tolist()}")
    up = up / length
    flat = axes - np.outer(axes @ up, up)
    first = flat[np.argmax(np.linalg.norm(2 * flat, axis=1) > 1)]
    first = first / np.linalg.norm(first)
    return np.stack([first, np.cross(up, first), up])


@compiled
def first_centre(position: float, size: int) -> int:
    """Return the first pixel, from 0 to `size`, whose centre is not below a position."""
    return int(min(max(math.ceil(position - 0.5), 0.0), float(size)))


@compiled
def crossing(points: FloatArray, p: int, q: int, y: float) -> float:
    """Return the x at which the segment between two points crosses a scan line; NaN if it does not."""
    # Computed from the upper to the lower end in every triangle, so that both faces of an edge have the same rounding.
    if points[p, 1] > points[q, 1]:
        p, q = q, p
    if not points[p, 1] <= y < points[q, 1]:
        return math.nan
    drop = points[q, 1] - points[p, 1]
    return points[p, 0] + (y - points[p, 1]) / drop * (points[q, 0] - points[p, 0])


@compiled
def fill_nearest(points: FloatArray, faces: IntArray, depth: FloatArray, face: IntArray) -> None:
    """Write the nearest face and its depth to every pixel whose centre is covered by a face, in place.

    Args:
        points: (n, 3) x to the right and y downwards in pixels, and depth away from the viewer.
        faces: (m, 3) indices of points.
        depth, face: (h, w) depth and face of the image so far; among faces of the same depth, the first is drawn.
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
        # In a triangle that is seen nearly edge-on, the gradient is mostly rounding error, so the depth is clamped.
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
