"""The connected pieces of an overlap."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import FloatArray, IntArray, as_faces, as_floats
from ..errors import ArrayShapeError, FaceIndexError, OptionError
from ..mesh import NEXT, label_components, sort_by_counting, sort_pairs
from ..text import list_some, plural


def overlap_regions(pairs: ArrayLike, triangles: ArrayLike) -> tuple[int, IntArray]:
    """Return the number of regions where a layout overlaps itself, and (k,) the region of each pair.

    Two pairs are neighbours where they have a triangle in common, and their other triangles share a side: the
    overlap goes on across it. Where two layers have sides in common, it ends for this purpose.

    Args:
        pairs: (k, 2) as in `Overlaps`: sorted, the smaller index first.
        triangles: (m, 3) the points at their corners, by which they share sides.

    Raises:
        MeshError: an array has the wrong shape, or an index is none of a triangle.
        OptionError: the pairs are not sorted.
    """
    faces = as_faces(triangles, np.iinfo(np.int64).max)
    ways = _checked_pairs(pairs, len(faces))
    source, place = _steps(ways, faces)
    return label_components(len(ways), source // 2, place // 2)


def _checked_pairs(pairs: ArrayLike, count: int) -> IntArray:
    """Return (k, 2) pairs of m triangles, if they are as `find_overlaps` has them."""
    values = as_floats("pairs", pairs)
    if values.ndim != 2 or values.shape[1] != 2:
        raise ArrayShapeError(f"pairs must have the shape (k, 2), not {values.shape}")
    bad = np.flatnonzero(~((values >= 0) & (values < count) & (values == np.floor(values))).all(axis=1))
    if len(bad):
        one, two = values[bad[0]]
        raise FaceIndexError(
            f"{plural(len(bad), 'pair')} with an index outside 0..{count - 1}: {list_some(bad)}; pair {bad[0]} is "
            f"({one:g}, {two:g})"
        )
    known = values.astype(np.int64)
    keys = known @ [count, 1]
    if (known[:, 0] >= known[:, 1]).any() or (np.diff(keys) <= 0).any():
        raise OptionError(
            "pairs must be sorted, each once, the smaller index first, as find_overlaps returns them"
        )
    return known


def overlap_layers(pairs: IntArray, triangles: IntArray) -> list[tuple[IntArray, IntArray]]:
    """Return for each region the triangles of its two layers: sets that are connected, without a common member.

    Where an overlap is wound up so that its layers go over into each other, they are one of its pairs.
    """
    if not len(pairs):
        return []
    count, label = _label_ways(pairs, triangles)
    order = sort_by_counting(label, count)
    regions = np.split(order, np.cumsum(np.bincount(label, minlength=count))[:-1])
    # An odd one is the same region the other way round.
    return [_layers(pairs, members) for members in regions if members[0] % 2 == 0]


def largest_layers(pairs: IntArray, triangles: IntArray, areas: FloatArray) -> tuple[IntArray, IntArray]:
    """Return the layers of the region of which the smaller layer has the most area.

    areas: (m,) of the triangles.
    """
    count, label = _label_ways(pairs, triangles)
    kept, moved = pairs.ravel(), pairs[:, ::-1].ravel()
    layers = [np.unique(label * len(areas) + side) for side in (kept, moved)]
    sizes = [np.bincount(one // len(areas), areas[one % len(areas)], count) for one in layers]
    size = np.minimum(*sizes)
    _, first = np.unique(label, return_index=True)
    wound = np.unique(layers[0][np.isin(layers[0], layers[1])] // len(areas))
    size[wound] = np.minimum(areas[kept], areas[moved])[first[wound]]
    size[first % 2 == 1] = -1.0
    return _layers(pairs, np.flatnonzero(label == np.argmax(size)))


def _label_ways(pairs: IntArray, triangles: IntArray) -> tuple[int, IntArray]:
    """Return how many parts the pairs form, each both ways round, and the part of each; numbered as in `_steps`.

    Which triangle is in which layer goes on with the overlap: a region has two parts, one the other way round, unless
    it is wound up.
    """
    source, place = _steps(pairs, triangles)
    return label_components(
        2 * len(pairs), np.concatenate([source, source ^ 1]), np.concatenate([place, place ^ 1])
    )


def _layers(pairs: IntArray, members: IntArray) -> tuple[IntArray, IntArray]:
    """Return the first and second triangles of pairs, numbered as in `_steps`; of one pair if they share any."""
    kept, moved = pairs.ravel()[members], pairs.ravel()[members ^ 1]
    one, other = np.unique(kept), np.unique(moved)
    return (kept[:1], moved[:1]) if len(np.intersect1d(one, other)) else (one, other)


def _steps(pairs: IntArray, triangles: IntArray) -> tuple[IntArray, IntArray]:
    """Return between which pairs an overlap goes on when its second triangle gives way to a neighbour.

    Pair i is numbered 2i as it stands and 2i + 1 the other way round.
    """
    if not len(pairs):
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    count = len(triangles)
    one, two = _neighbours(np.unique(pairs), triangles)
    two = two[sort_by_counting(one, count)]
    ways = np.bincount(one, minlength=count)
    starts = np.cumsum(ways) - ways
    # Every pair both ways round; the second triangle goes to each of its neighbours.
    kept, moved = pairs.ravel(), pairs[:, ::-1].ravel()
    first, ways = starts[moved], ways[moved]
    source = np.repeat(np.arange(len(moved)), ways)
    step = np.arange(len(source)) - np.repeat(np.cumsum(ways) - ways - first, ways)
    kept, moved = kept[source], two[step]
    keys = pairs[:, 0] * count + pairs[:, 1]
    wanted = np.minimum(kept, moved) * count + np.maximum(kept, moved)
    place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    found = keys[place] == wanted
    return source[found], 2 * place[found] + (kept > moved)[found]


def _neighbours(chosen: IntArray, triangles: IntArray) -> tuple[IntArray, IntArray]:
    """Return the chosen triangles that share a side, two and two, each both ways round."""
    tails, heads = triangles[chosen].ravel(), triangles[chosen][:, NEXT].ravel()
    order, first = sort_pairs(tails, heads, int(triangles.max()) + 1)
    again = np.flatnonzero(~first)
    one, two = chosen[order[again - 1] // 3], chosen[order[again] // 3]
    return np.concatenate([one, two]), np.concatenate([two, one])
