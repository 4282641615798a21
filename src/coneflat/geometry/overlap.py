"""Overlaps of the triangles of a layout, found with exact predicates."""

from __future__ import annotations

import math
from dataclasses import dataclass
from numbers import Integral

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    as_faces,
    as_floats,
    require_finite,
    rows_of,
    unit_exponent,
)
from ..base.jit import compiled
from ..errors import ArrayShapeError, OptionError
from ..mesh.charts import open_sides
from .coverage import overlap_areas
from .fans import are_disjoint, find_fans
from .layers import may_overlap
from .orientation import counterclockwise, orientation

# Relative to the largest coordinate: smaller coordinates count as 0, so that products do not underflow.
MIN_COORDINATE = 2.0**-420
# Largest number of triangles of a group all pairs of which are compared.
MAX_COMPARED = 500


@dataclass(frozen=True, eq=False)
class Overlaps:
    """Where the triangles of a layout overlap.

    Attributes:
        pairs: (k, 2) all pairs of triangles whose interiors have a point in common, each with the smaller index
            first, in lexicographic order.
        area: area of the points of the plane inside at least two triangles, in squared units of the layout.
        fraction: this area divided by the area of the points inside at least one triangle. Both are NaN if they would
            take too long, as with thousands of long triangles in all directions.
        complete: False if there are more pairs than the limit; then `area` and `fraction` are NaN.
    """

    pairs: IntArray
    area: float
    fraction: float
    complete: bool = True


#: Value for a layout whose overlaps were not searched for, as there may be many, which take long to find.
UNKNOWN_OVERLAPS = Overlaps(np.empty((0, 2), dtype=np.int64), float("nan"), float("nan"), complete=False)


def find_overlaps(
    points: ArrayLike, triangles: ArrayLike | None = None, *, limit: int | None = None
) -> Overlaps:
    """Return all pairs of triangles in the plane that overlap, found with exact predicates.

    Args:
        points: (n, 2) points; or, without `triangles`, (m, 3, 2) the corners of each triangle.
        triangles: (m, 3) indices of points. Clockwise triangles cover the plane like others. Triangles with collinear
            corners cover nothing.
        limit: stop at this number of pairs, which may be any of them; 1 tests whether there is a pair.

    Returns:
        The pairs, and the area of the overlaps.

    Raises:
        MeshError: an array has the wrong shape, an index is out of range, or a coordinate is not finite.
        OptionError: the limit is below 1.

    Notes:
        Triangles overlap if their open interiors have a common point, however thin the intersection is. Triangles
        that touch in points or along sides, or along parts of sides, do not overlap. There is no tolerance, and all
        signs are exact for the given coordinates (J. R. Shewchuk, "Adaptive precision floating-point arithmetic and
        fast robust geometric predicates", 1997; coordinates below 2^-420 of the largest count as 0). Therefore the
        two sides of a seam overlap if they should coincide, but differ by an ulp in the wrong direction. `area` then
        has the size of rounding errors, about 1e-16 of the extent of the layout times the length of the seam.

        Candidates come from a binary tree of bounding boxes, in n log n time, and around a common point from the
        angles there, in the same time. Large numbers of other long triangles in many directions, whose boxes all
        overlap, take longer.
    """
    if limit is not None and not (isinstance(limit, Integral) and limit >= 1):
        raise OptionError(f"the limit must be an integer, 1 or more, got {limit!r}")
    corners, exponent = _at_unit_size(_corners(points, triangles))
    oriented, signs = counterclockwise(corners)
    return _overlaps(oriented, exponent, np.flatnonzero(signs), limit)


def overlaps_of_mesh(edge_halfedges: IntArray, corners: FloatArray) -> Overlaps:
    """Return the same as `find_overlaps` for triangles of a mesh with known edges, in a fraction of the time.

    Only triangles near the outline, or where the winding number of the outline is above 1, are compared.

    Args:
        edge_halfedges: (e, 2) the half-edges of each edge, see `TriangleMesh`.
        corners: (m, 3, 2) corners of the triangles in the plane.
    """
    corners, exponent = _at_unit_size(_corners(corners, None))
    oriented, signs = counterclockwise(corners)
    # The sides of triangles that are not counterclockwise do not cancel with those of their neighbours.
    is_open = open_sides(edge_halfedges, corners, signs - 1)
    return _overlaps(oriented, exponent, may_overlap(corners, signs, is_open), None)


def has_overlaps(corners: FloatArray, starts: IntArray) -> BoolArray:
    """Return (k,) whether triangles of the same group overlap; for many small groups, which may overlap each other.

    All pairs of a small group are compared, those of a large one as by `find_overlaps`.

    Args:
        corners: (m, 3, 2) corners of the triangles in the plane.
        starts: (k + 1,) the first triangle of each group, and m.
    """
    scaled, _ = _at_unit_size(_corners(corners, None))
    oriented, signs = counterclockwise(scaled)
    flat = np.ascontiguousarray(oriented).reshape(-1, 6)
    boxes = np.empty((len(flat), 4))
    fill_boxes(flat, 1.0, 0.0, 0.0, boxes)
    first, end = starts[:-1], starts[1:]
    is_large = end - first > MAX_COMPARED
    compared = first, np.where(is_large, first, end)
    is_overlapping = find_overlapping_groups(flat, signs != 0, boxes, *compared, np.empty(12))
    for group in np.flatnonzero(is_large).tolist():
        is_overlapping[group] = len(find_overlaps(corners[first[group] : end[group]], limit=1).pairs) > 0
    return is_overlapping


def _overlaps(oriented: FloatArray, exponent: int, chosen: IntArray, limit: int | None) -> Overlaps:
    """Return the overlaps of counterclockwise triangles, given those that may overlap; see `_find_pairs`."""
    pairs, complete = _find_pairs(oriented, chosen, limit)
    if not complete:
        return Overlaps(pairs, float("nan"), float("nan"), False)
    twice, once = overlap_areas(oriented, pairs)
    return Overlaps(pairs, float(np.ldexp(twice, 2 * exponent)), 0.0 if once <= 0 else twice / once)


def _corners(points: ArrayLike, triangles: ArrayLike | None) -> FloatArray:
    """Return (m, 3, 2) the corners of the triangles after a check of the arrays."""
    places = as_floats("points", points)
    shape = "(n, 2)" if triangles is not None else "(m, 3, 2)"
    if places.shape[1:] != ((2,) if triangles is not None else (3, 2)):
        raise ArrayShapeError(f"points must have the shape {shape}, got {places.shape}")
    if triangles is not None:
        faces = as_faces(triangles, len(places))
        require_finite(places, faces)
        return places[faces]
    if not len(places) or not np.isfinite(places).all():
        faces = as_faces(np.arange(3 * len(places)).reshape(-1, 3), 3 * len(places))
        require_finite(places.reshape(-1, 2), faces)
    return places


def _at_unit_size(corners: FloatArray) -> tuple[FloatArray, int]:
    """Return the corners divided by a power of two, which is exact, and the exponent of the power."""
    exponent = unit_exponent(corners)
    if exponent <= -1000:  # the factor would not be finite
        corners, factor = np.ldexp(corners, -exponent), 1.0
    else:
        factor = 2.0**-exponent
    scaled = np.ascontiguousarray(corners * factor)
    scaled[np.abs(scaled) < MIN_COORDINATE] = 0.0
    return scaled, exponent


def _find_pairs(corners: FloatArray, chosen: IntArray, limit: int | None) -> tuple[IntArray, bool]:
    """Return the pairs of chosen triangles that overlap, and whether all pairs were found.

    corners: (m, 3, 2) corners of the triangles; the chosen ones must be counterclockwise.
    """
    if len(chosen) < 2:
        return np.empty((0, 2), dtype=np.int64), True
    places = rows_of(corners.reshape(-1, 6), chosen)
    boxes = bounding_boxes(places.reshape(-1, 3, 2))
    order = z_order(boxes)
    fans = find_fans(places.reshape(-1, 3, 2))
    if fans is not None:
        order = fans.sorted(order)
    tree = box_tree(boxes[order])
    around = (np.empty(0, dtype=np.int64), np.empty((0, 2)))
    if fans is not None:
        around = fans.tree(order, (len(tree) + 1) // 2)
    chosen = chosen[order]
    arrays = tree, *around, rows_of(places, order), np.empty(12)
    stack, top = np.zeros((4 * len(tree).bit_length(), 2), dtype=np.int64), 1
    keys, capacity, left = [], len(chosen), np.inf if limit is None else limit + 1
    while top > 0 and left > 0:
        buffer = np.empty((int(min(left, capacity)), 2), dtype=np.int64)
        top, count = join(*arrays, stack, top, buffer)
        pairs = chosen[buffer[:count]]
        keys.append(pairs.min(axis=1) * len(corners) + pairs.max(axis=1))
        left -= count
        capacity *= 2
    key = np.sort(np.concatenate(keys)[:limit])
    return np.stack(np.divmod(key, len(corners)), axis=1), left > 0


# Largest rounding error of coordinates of up to 1 after a rotation.
COORDINATE_ROUNDING = 2.0**-48
# Boxes are rotated if that reduces their total area to less than this fraction.
MAX_BOX_SHARE = 0.5


def bounding_boxes(corners: FloatArray) -> FloatArray:
    """Return (m, 4) bounding boxes x0, y0, -x1, -y1 of triangles (m, 3, 2) with coordinates of up to 1.

    With these signs, the box around several boxes is their minimum. The boxes are aligned with the axes, or, if they
    are then much smaller, with the main direction of the triangles; rotated boxes include a margin for rounding.
    """
    straight, askew = np.empty((2, len(corners), 4))
    flat = np.ascontiguousarray(corners).reshape(-1, 6)
    area, x, y = fill_boxes(flat, 1.0, 0.0, 0.0, straight)
    turn = -math.atan2(y, x) / 2
    rotated_area, _, _ = fill_boxes(flat, math.cos(turn), math.sin(turn), COORDINATE_ROUNDING, askew)
    return askew if rotated_area < MAX_BOX_SHARE * area else straight


@compiled
def fill_boxes(
    corners: FloatArray, cos: float, sin: float, margin: float, boxes: FloatArray
) -> tuple[float, float, float]:
    """Write the boxes of rotated triangles (m, 6); return their total area, and the sum of squared complex sides.

    Args:
        corners: (m, 6) x and y of the corners of each triangle.
        cos, sin: of the angle of rotation.
        margin: distance by which boxes are enlarged on every side.
        boxes: (m, 4) the boxes on return.
    """
    area, real, imaginary = 0.0, 0.0, 0.0
    for t in range(len(corners)):
        c = corners[t]
        x0, y0, x1, y1 = math.inf, math.inf, math.inf, math.inf
        for i in range(0, 6, 2):
            x, y = cos * c[i] - sin * c[i + 1], sin * c[i] + cos * c[i + 1]
            x0, y0, x1, y1 = min(x0, x), min(y0, y), min(x1, -x), min(y1, -y)
            u, v = c[(i + 2) % 6] - c[i], c[(i + 3) % 6] - c[i + 1]
            real += u * u - v * v
            imaginary += 2 * u * v
        boxes[t, 0], boxes[t, 1], boxes[t, 2], boxes[t, 3] = (
            x0 - margin,
            y0 - margin,
            x1 - margin,
            y1 - margin,
        )
        area += (x0 + x1) * (y0 + y1)
    return area, real, imaginary


def z_order(boxes: FloatArray) -> IntArray:
    """Return the order of boxes (m, 4) along a Z-order curve through their centres (Morton 1966).

    The cells of the curve are 2^-32 of the extent wide, so charts whose scale varies by e^8 and more are resolved.
    """
    centres = boxes[:, :2] - boxes[:, 2:]
    for x in centres.T:  # NumPy is slow at minima of pairs
        x -= x.min()
    extent = centres.max()
    cells = (centres * ((2**32 - 1) / extent if extent > 0 else 0.0)).astype(np.uint64)
    return np.argsort(_spread(cells[:, 0]) | _spread(cells[:, 1]) << np.uint64(1), kind="stable")


def _spread(cells: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Return numbers with a zero bit inserted before each of their 32 bits."""
    for shift in (16, 8, 4, 2, 1):
        mask = np.uint64((2**64 - 1) // (2**shift + 1))  # runs of `shift` ones and as many zeros
        cells = (cells | cells << np.uint64(shift)) & mask
    return cells


def box_tree(boxes: FloatArray) -> FloatArray:
    """Return (2 k - 1, 4) the nodes of a binary tree of boxes: node i has the children 2 i + 1 and 2 i + 2.

    The last k nodes are the given boxes (m, 4). k is a power of two, at least 2; the remaining leaves are empty.
    """
    leaves = 2 ** max(1, (len(boxes) - 1).bit_length())
    tree = np.full((2 * leaves - 1, 4), np.inf)
    tree[leaves - 1 : leaves - 1 + len(boxes)] = boxes
    while leaves > 1:
        below = tree[leaves - 1 : 2 * leaves - 1]
        leaves //= 2
        np.minimum(below[::2], below[1::2], out=tree[leaves - 1 : 2 * leaves - 1])
    return tree


@compiled
def _boxes_meet(tree: FloatArray, i: int, j: int) -> bool:
    """Return whether the interiors of the boxes (x0, y0, -x1, -y1) of two nodes have a common point."""
    return (
        tree[i, 0] < -tree[j, 2]
        and tree[j, 0] < -tree[i, 2]
        and tree[i, 1] < -tree[j, 3]
        and tree[j, 1] < -tree[i, 3]
    )


@compiled
def _lies_outside(corners: FloatArray, first: int, second: int, parts: FloatArray) -> bool:
    """Return whether the line along a side of triangle `one` has no corner of triangle `two` on its left."""
    for i in range(0, 6, 2):
        px, py = corners[first, i], corners[first, i + 1]
        qx, qy = corners[first, (i + 2) % 6], corners[first, (i + 3) % 6]
        k = 0
        while k < 6 and orientation(px, py, qx, qy, corners[second, k], corners[second, k + 1], parts) <= 0:
            k += 2
        if k == 6:
            return True
    return False


@compiled
def find_overlapping_groups(
    corners: FloatArray,
    has_area: BoolArray,
    boxes: FloatArray,
    starts: IntArray,
    ends: IntArray,
    parts: FloatArray,
) -> BoolArray:
    """Return (k,) whether two triangles of the same group overlap, by comparing all pairs of each group.

    Args:
        corners: (m, 6) corners of the triangles, counterclockwise.
        has_area: (m,) False for triangles that cover nothing.
        boxes: (m, 4) their boxes x0, y0, -x1, -y1.
        starts, ends: (k,) the first triangle of each group, and the first after it.
        parts: (12,) buffer for exact sums.
    """
    is_overlapping = np.zeros(len(starts), np.bool_)
    for group in range(len(is_overlapping)):
        for first in range(starts[group], ends[group]):
            for second in range(first + 1, ends[group]):
                if (
                    not is_overlapping[group]
                    and has_area[first]
                    and has_area[second]
                    and _boxes_meet(boxes, first, second)
                    and not _lies_outside(corners, first, second, parts)
                    and not _lies_outside(corners, second, first, parts)
                ):
                    is_overlapping[group] = True
    return is_overlapping


@compiled
def join(
    tree: FloatArray,
    fans: IntArray,
    angles: FloatArray,
    corners: FloatArray,
    parts: FloatArray,
    stack: IntArray,
    top: int,
    pairs: IntArray,
) -> tuple[int, int]:
    """Write the pairs of triangles whose interiors intersect, until the buffer is full.

    The interiors of two convex polygons are disjoint if and only if the line along a side of one of them separates
    them.

    Args:
        tree: (2 k - 1, 4) boxes: node i has the children 2 i + 1 and 2 i + 2, the last k are those of the triangles.
        fans, angles: (2 k - 1,) the fan of each node and (2 k - 1, 2) its angles, see `Fans`; empty if there is none.
        corners: (m, 6) corners of the triangles, counterclockwise.
        parts: (12,) buffer for exact sums.
        stack: (s, 2) pairs of nodes of the same level, the smaller first, that are still to be searched.
        top: number of pairs on the stack.
        pairs: (p, 2) buffer for the pairs.

    Returns:
        The height of the stack, 0 if the search is complete, and the number of pairs written.
    """
    first_leaf = len(tree) // 2
    count = 0
    while top > 0 and count < len(pairs):
        top -= 1
        i, j = stack[top, 0], stack[top, 1]
        if i >= first_leaf:
            first, second = i - first_leaf, j - first_leaf
            if not _lies_outside(corners, first, second, parts) and not _lies_outside(
                corners, second, first, parts
            ):
                pairs[count, 0], pairs[count, 1] = first, second
                count += 1
            continue
        for a in range(2 * i + 1, 2 * i + 3):
            for b in range(2 * j + 1, 2 * j + 3):
                if (a == b and a < first_leaf) or (
                    a < b and _boxes_meet(tree, a, b) and not (len(fans) and are_disjoint(fans, angles, a, b))
                ):
                    stack[top, 0], stack[top, 1] = a, b
                    top += 1
    return top, count
