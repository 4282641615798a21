"""Where a layout covers the plane more than once, without rounding."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import FloatArray, IntArray, as_faces, as_floats, require_finite, rows_of, unit_exponent
from ..base.compiled import compiled
from ..errors import ArrayShapeError, OptionError
from .coverage import overlap_areas
from .fans import are_disjoint, find_fans
from .layers import may_overlap, open_sides
from .orientation import fill_orientations, orientation

# Of the largest coordinate: what is smaller counts as 0, lest products underflow.
MIN_COORDINATE = 2.0**-420


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


#: Of a layout of which nobody asks: they may be many, and take long to be found.
NOT_LOOKED_FOR = Overlaps(np.empty((0, 2), dtype=np.int64), float("nan"), float("nan"), complete=False)


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
        exact for the coordinates as they are given (J. R. Shewchuk, "Adaptive precision floating-point arithmetic and
        fast robust geometric predicates", 1997; those below 2^-420 of the largest count as 0). So two sides
        of a seam that should coincide, but are an ulp apart the wrong way, do overlap; `area` then is what
        rounding makes of it, about 1e-16 of the layout's extent times the length of the seam.

        Candidates come from a binary tree of boxes, which takes n log n; so do those around one point, by their
        angles. Large numbers of other long triangles in many directions, whose boxes all overlap, take more.
    """
    if limit is not None and limit < 1:
        raise OptionError(f"the limit must be 1 or more, not {limit}")
    corners, exponent = _at_unit_size(_corners(points, triangles))
    oriented, signs = _counterclockwise(corners)
    return _overlaps(oriented, exponent, np.flatnonzero(signs), limit)


def overlaps_of_mesh(edge_halfedges: IntArray, corners: FloatArray) -> Overlaps:
    """Return what `find_overlaps` does of triangles that are known to hang together, in a fraction of the time.

    Only what lies near the outline, or is covered twice by the winding number of this, is compared.

    Args:
        edge_halfedges: (e, 2) the half-edges of each edge, see `TriangleMesh`.
        corners: (m, 3, 2) of the triangles in the plane.
    """
    corners, exponent = _at_unit_size(_corners(corners, None))
    oriented, signs = _counterclockwise(corners)
    # What is not counterclockwise has sides that add up with those beside them, or none that count.
    is_open = open_sides(edge_halfedges, corners, signs - 1)
    return _overlaps(oriented, exponent, may_overlap(corners, signs, is_open), None)


def _overlaps(oriented: FloatArray, exponent: int, chosen: IntArray, limit: int | None) -> Overlaps:
    """Return the overlaps of chosen triangles, of those of all which may overlap; see `_find_pairs`."""
    pairs, complete = _find_pairs(oriented, chosen, limit)
    if not complete:
        return Overlaps(pairs, float("nan"), float("nan"), False)
    if not len(pairs):
        return Overlaps(pairs, 0.0, 0.0)
    twice, once = overlap_areas(oriented, pairs)
    return Overlaps(pairs, float(np.ldexp(twice, 2 * exponent)), 0.0 if once <= 0 else twice / once)


def _corners(points: ArrayLike, triangles: ArrayLike | None) -> FloatArray:
    """Return (m, 3, 2) the corners, if all is as it should be."""
    places = as_floats("points", points)
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
    exponent = unit_exponent(corners)
    if exponent <= -1000:  # the factor would not be finite
        corners, factor = np.ldexp(corners, -exponent), 1.0
    else:
        factor = 2.0**-exponent
    scaled = np.empty(corners.shape)
    scale_numbers(np.ascontiguousarray(corners).reshape(-1), factor, MIN_COORDINATE, scaled.reshape(-1))
    return scaled, exponent


def _counterclockwise(corners: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return the triangles, flipped where they are clockwise, and their orientations 1, -1 and 0."""
    signs = np.empty(len(corners), dtype=np.int64)
    fill_orientations(corners.reshape(-1, 6), np.empty(12), signs)
    clockwise = np.flatnonzero(signs < 0)
    if not len(clockwise):
        return corners, signs
    oriented = corners.copy()
    oriented[clockwise] = corners[clockwise][:, ::-1]
    return oriented, signs


def _find_pairs(corners: FloatArray, chosen: IntArray, limit: int | None) -> tuple[IntArray, bool]:
    """Return the pairs of the chosen triangles that overlap, and whether these are all.

    corners: (m, 3, 2), those chosen counterclockwise.
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
        found = np.empty((int(min(left, capacity)), 2), dtype=np.int64)
        top, count = join(*arrays, stack, top, found)
        pairs = chosen[found[:count]]
        keys.append(pairs.min(axis=1) * len(corners) + pairs.max(axis=1))
        left -= count
        capacity *= 2
    key = np.sort(np.concatenate(keys)[:limit])
    return np.stack(np.divmod(key, len(corners)), axis=1), left > 0


# By how much coordinates of up to 1 may be off once they are turned.
COORDINATE_ROUNDING = 2.0**-48
# Boxes are turned if that leaves less than this part of their areas.
MAX_BOX_SHARE = 0.5


def bounding_boxes(corners: FloatArray) -> FloatArray:
    """Return (m, 4) x0, y0, -x1, -y1 of triangles (m, 3, 2), none above 1: the box around several is their minimum.

    They are along the axes, or along the sides of long triangles askew to them; these are larger by what rounding may
    have taken.
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
    """Fill the boxes of triangles (m, 6), turned; return their area, and the sum of the squares of sides as complex.

    margin: by which boxes are larger on every side.
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
    """Return the order of boxes along a Z-shaped curve through their centres (Morton 1966), so near ones are close.

    The cells of the curve are 2^-32 of the extent wide, so charts whose scale varies by e^8 and more are resolved.
    """
    centres = boxes[:, :2] - boxes[:, 2:]
    centres -= centres.min(axis=0)
    extent = centres.max()
    cells = (centres * ((2**32 - 1) / extent if extent > 0 else 0.0)).astype(np.uint64)
    order: IntArray = np.argsort(_spread(cells[:, 0]) | _spread(cells[:, 1]) << np.uint64(1), kind="stable")
    return order


def _spread(cells: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Put a zero bit before each of 32 bits."""
    for shift in (16, 8, 4, 2, 1):
        kept = np.uint64((2**64 - 1) // (2**shift + 1))  # runs of `shift` ones and as many zeros
        cells = (cells | cells << np.uint64(shift)) & kept
    return cells


def box_tree(boxes: FloatArray) -> FloatArray:
    """Return (2 k - 1, 4) the boxes, last, and those around them: node i has 2 i + 1 and 2 i + 2 below it.

    k is a power of two, and at least 2; the boxes that are missing are empty.
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
def scale_numbers(numbers: FloatArray, factor: float, tiny: float, scaled: FloatArray) -> None:
    """Fill in numbers times a factor, 0 where that is less than tiny."""
    for i in range(len(numbers)):
        number = numbers[i] * factor
        scaled[i] = number if abs(number) >= tiny else 0.0


@compiled
def _boxes_meet(tree: FloatArray, i: int, j: int) -> bool:
    """Return whether two boxes (x0, y0, -x1, -y1) have inner points in common."""
    return (
        tree[i, 0] < -tree[j, 2]
        and tree[j, 0] < -tree[i, 2]
        and tree[i, 1] < -tree[j, 3]
        and tree[j, 1] < -tree[i, 3]
    )


@compiled
def _lies_outside(corners: FloatArray, one: int, two: int, parts: FloatArray) -> bool:
    """Return whether some side of triangle `one` has no corner of `two` to its left."""
    for i in range(0, 6, 2):
        px, py = corners[one, i], corners[one, i + 1]
        qx, qy = corners[one, (i + 2) % 6], corners[one, (i + 3) % 6]
        k = 0
        while k < 6 and orientation(px, py, qx, qy, corners[two, k], corners[two, k + 1], parts) <= 0:
            k += 2
        if k == 6:
            return True
    return False


@compiled
def join(
    tree: FloatArray,
    fans: IntArray,
    angles: FloatArray,
    corners: FloatArray,
    parts: FloatArray,
    stack: IntArray,
    top: int,
    found: IntArray,
) -> tuple[int, int]:
    """Fill in the pairs of triangles whose interiors meet, until there is no room left.

    Convex polygons have no inner point in common if and only if the line along a side of one of them has one on
    either side of it.

    Args:
        tree: (2 k - 1, 4) boxes: node i is above 2 i + 1 and 2 i + 2, the last k are the triangles' own.
        fans, angles: (2 k - 1,) the fan of each node and (2 k - 1, 2) its angles, see `Fans`; empty if there is none.
        corners: (m, 6) of the triangles, counterclockwise.
        parts: (12,) room for exact sums.
        stack: (s, 2) pairs of nodes of one level, the lower first, to be searched yet: the first `top`.
        found: (p, 2) filled.

    Returns:
        The height of the stack, 0 at the end, and the number of pairs filled in.
    """
    first_leaf = len(tree) // 2
    count = 0
    while top > 0 and count < len(found):
        top -= 1
        i, j = stack[top]
        if i >= first_leaf:
            one, two = i - first_leaf, j - first_leaf
            if not _lies_outside(corners, one, two, parts) and not _lies_outside(corners, two, one, parts):
                found[count, 0] = one
                found[count, 1] = two
                count += 1
            continue
        for a in range(2 * i + 1, 2 * i + 3):
            for b in range(2 * j + 1, 2 * j + 3):
                if (a == b and a < first_leaf) or (
                    a < b and _boxes_meet(tree, a, b) and not (len(fans) and are_disjoint(fans, angles, a, b))
                ):
                    stack[top, 0] = a
                    stack[top, 1] = b
                    top += 1
    return top, count
