"""Where a layout covers the plane more than once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import FloatArray, IntArray
from ..errors import ArrayShapeError, OptionError
from ..validation import as_faces, require_finite
from .boxes import box_tree, snug_boxes, z_order
from .coverage import covered_twice

# Of the largest coordinate: what is smaller counts as 0, lest products underflow.
TINY = 2.0**-420


@dataclass(frozen=True, eq=False)
class Overlaps:
    """Where the triangles of a layout overlap.

    Attributes:
        pairs: (k, 2) all pairs of triangles whose interiors have a point in common, each with the smaller index
            first, in lexicographic order.
        area: of the points of the plane inside at least two triangles, in squared units of the layout.
        fraction: the same over the area of the points inside at least one. Both are NaN where they would take too
            long, as of thousands of long triangles in all directions.
        complete: False if there are more pairs than asked for; then `area` and `fraction` are NaN.
    """

    pairs: IntArray
    area: float
    fraction: float
    complete: bool = True


def find_overlaps(
    points: ArrayLike, triangles: ArrayLike | None = None, *, limit: int | None = None
) -> Overlaps:
    """Return all pairs of triangles in the plane that overlap, without rounding.

    Args:
        points: (n, 2); or, without `triangles`, (m, 3, 2) the corners of each triangle.
        triangles: (m, 3) indices of points. Clockwise triangles cover the plane like others; those whose
            corners are on a line cover nothing.
        limit: end with so many pairs, any of them; 1 asks only whether there is one.

    Raises:
        MeshError: an array has the wrong shape, an index no point, a point no finite place.
        OptionError: the limit is below 1.

    Notes:
        Interiors are open: triangles that touch in points or along sides, in whole or in part, do not overlap,
        and whatever has inner points in common does, however thin. No tolerance is involved, and all signs are
        exact for the coordinates as they are given (those below 2^-420 of the largest count as 0). So two sides
        of a seam that should coincide, but are an ulp apart the wrong way, do overlap; `area` then is what
        rounding makes of it, about 1e-16 of the layout's extent times the length of the seam.

        Candidates come from a binary tree of boxes, which takes n log n; large numbers of long triangles in many
        directions, whose boxes all overlap, take more.
    """
    if limit is not None and limit < 1:
        raise OptionError(f"the limit must be 1 or more, not {limit}")
    corners = _corners(points, triangles)
    corners, exponent = _at_unit_size(corners)
    turned, signs = _counterclockwise(corners)
    pairs, complete = _find_pairs(turned, np.flatnonzero(signs), limit)
    if not complete:
        return Overlaps(pairs, float("nan"), float("nan"), False)
    twice, once = covered_twice(turned, pairs)
    return Overlaps(pairs, float(np.ldexp(twice, 2 * exponent)), 0.0 if once <= 0 else twice / once)


def _corners(points: ArrayLike, triangles: ArrayLike | None) -> FloatArray:
    """Return (m, 3, 2) the corners, if all is as it should be."""
    try:
        places = np.asarray(points, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ArrayShapeError(f"points must be an array of numbers: {error}") from error
    shape = "(n, 2)" if triangles is not None else "(m, 3, 2)"
    if places.shape[1:] != ((2,) if triangles is not None else (3, 2)):
        raise ArrayShapeError(f"points must have the shape {shape}, not {places.shape}")
    if triangles is not None:
        faces = as_faces(triangles, len(places))
        require_finite(places, faces)
        return places[faces]
    if not len(places) or not np.isfinite(places).all():
        faces = as_faces(np.arange(3 * len(places)).reshape(-1, 3), 3 * len(places))
        require_finite(places.reshape(-1, 2), faces)
    return places


def _at_unit_size(corners: FloatArray) -> tuple[FloatArray, int]:
    """Return the corners divided by a power of two, which rounds nothing, and its exponent."""
    exponent = int(np.frexp(max(corners.max(), -corners.min()))[1])
    # By a product, which takes a fifth of the time, unless the factor is not finite.
    scaled = corners * 2.0**-exponent if exponent > -1000 else np.ldexp(corners, -exponent)
    scaled[np.abs(scaled) < TINY] = 0.0
    return scaled, exponent


def _counterclockwise(corners: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return the triangles, turned over where they are clockwise, and their orientations 1, -1 and 0."""
    from .orientation_kernel import fill_orientations

    signs = np.empty(len(corners), dtype=np.int64)
    fill_orientations(corners.reshape(-1, 6), np.empty(12), signs)
    turned = corners.copy()
    turned[signs < 0] = corners[signs < 0][:, ::-1]
    return turned, signs


def _find_pairs(corners: FloatArray, chosen: IntArray, limit: int | None) -> tuple[IntArray, bool]:
    """Return the pairs of the chosen triangles that overlap, and whether these are all.

    corners: (m, 3, 2), those chosen counterclockwise.
    """
    from .overlap_kernel import join

    if len(chosen) < 2:
        return np.empty((0, 2), dtype=np.int64), True
    boxes = snug_boxes(corners[chosen])
    order = z_order(boxes)
    tree, chosen = box_tree(boxes[order]), chosen[order]
    arrays = tree, corners[chosen].reshape(-1, 6), np.empty(12)
    stack, top = np.zeros((4 * len(tree).bit_length(), 2), dtype=np.int64), 1
    keys, room, left = [], len(chosen), np.inf if limit is None else limit + 1
    while top > 0 and left > 0:
        found = np.empty((int(min(left, room)), 2), dtype=np.int64)
        top, count = join(*arrays, stack, top, found)
        pairs = chosen[found[:count]]
        keys.append(pairs.min(axis=1) * len(corners) + pairs.max(axis=1))
        left -= count
        room *= 2
    key = np.sort(np.concatenate(keys)[:limit])
    return np.stack(np.divmod(key, len(corners)), axis=1), left > 0
