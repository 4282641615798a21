"""A layout that overlaps itself split into charts: the layers of its overlaps, and the cheapest cuts between them.

In the plane a minimum cut between two triangles, with lengths of edges as capacities, is a shortest path between the
two parts of the border that lie between them (planar duality): no flow has to be computed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import BoolArray, FloatArray, IntArray, as_faces, as_floats
from ..compiled import compiled
from ..errors import ArrayShapeError, FaceIndexError, OptionError
from ..geometry.charts import label_charts
from ..geometry.graph import MultiGraph, trace_back
from ..geometry.parts import part_of
from ..mesh import NEXT, TriangleMesh, corner_fans, label_components, sort_by_counting, sort_pairs
from ..progress import go_on
from ..text import list_some, plural


def split_overlaps(
    points: FloatArray,
    corners: IntArray,
    costs: FloatArray,
    areas: FloatArray,
    pairs: IntArray,
    least: float = 0.0,
    most: float = np.inf,
    whole: TriangleMesh | None = None,
) -> IntArray | None:
    """Return (m,) the chart of each triangle, numbered from 0, so that no chart has both of a pair; None if too many.

    The two layers of the largest overlap are separated by the cheapest cut, then those of the largest that is left in
    each piece.

    Args:
        points: (u, 2) of the plane.
        corners: (m, 3) indices of points; the triangles of a connected disk.
        costs: (3m,) positive, what it costs to cut the side opposite each corner.
        areas: (m,) by which overlaps are compared.
        pairs: (k, 2) of triangles to be separated, in lexicographic order.
        least: the area that a chart should have at least.
        most: the number of charts that are too many.
        whole: what `as_disk` returns of all triangles, if that is known.
    """
    chart, count = np.zeros(len(corners), dtype=np.int64), 1
    # Triangles of all, their pairs, a disk, and the triangles of the disk that they are.
    waiting = []
    if len(pairs):
        disk = as_disk(points, corners) if whole is None else whole
        waiting.append((np.arange(len(corners)), pairs, disk, np.arange(len(corners))))
    while waiting and count < most:
        go_on()
        faces, pairs, disk, members = waiting.pop()
        if len(members) < len(disk.faces):
            disk = unpinched(part_of(disk, members))
        one, other = np.zeros((2, len(faces)), dtype=bool)
        for layer, members in zip((one, other), largest_layers(pairs, disk.faces, areas[faces]), strict=True):
            layer[members] = True
        if least > 0:
            one, other = widen(disk, one, other, areas[faces], least)
        pieces = separate(disk, one, other, costs.reshape(-1, 3)[faces])
        if pieces is None:
            # They stay together and overlap, which the measures show.
            continue
        left = np.where(pieces[pairs[:, 0]] == pieces[pairs[:, 1]], pieces[pairs[:, 0]], -1)
        for piece in range(int(pieces.max()) + 1):
            members = np.flatnonzero(pieces == piece)
            if piece:
                chart[faces[members]] = count
                count += 1
            if (left == piece).any():
                within = np.searchsorted(members, pairs[left == piece])
                waiting.append((faces[members], within, disk, members))
    return None if waiting else chart


def as_disk(points: FloatArray, corners: IntArray) -> TriangleMesh:
    """Return triangles of the plane as a mesh of their own, opened where they touch in a point only."""
    is_used = np.zeros(len(points), dtype=bool)
    is_used[corners] = True
    return unpinched(TriangleMesh(points[is_used], (np.cumsum(is_used) - 1)[corners]))


def unpinched(mesh: TriangleMesh) -> TriangleMesh:
    """Return triangles of the plane opened where they touch in a point only."""
    if np.count_nonzero(mesh.is_boundary_edge) == np.count_nonzero(mesh.is_boundary_vertex):
        return mesh
    inside = mesh.edge_halfedges[~mesh.is_boundary_edge]
    count, fans = corner_fans(mesh.faces, *inside.T)
    vertices = np.empty((count, 2))
    vertices[fans] = mesh.vertices[mesh.faces]
    return TriangleMesh(vertices, fans)


def separate(disk: TriangleMesh, one: BoolArray, other: BoolArray, costs: FloatArray) -> IntArray | None:
    """Return (m,) the piece of each triangle after the cheapest cut between two sets of them, from 0.

    None if each set, down to a single triangle, keeps the other from the border.

    Args:
        disk: a topological disk.
        one, other: (m,) True for the triangles to be separated: two sets, connected each, without a common member.
        costs: (m, 3) of the side opposite each corner, positive, and the same from both triangles.
    """
    border = disk.halfedge_edges[disk.boundary_walk()]
    both = _both_to_the_border(disk, border, one, other)
    if both is None:
        return None
    one, other = both
    beside = disk.edge_faces[border, 0]
    mark = np.where(one[beside], 1, np.where(other[beside], 2, 0))
    starts, ends = _between(disk, border, mark)
    cut = _cheapest_path(disk, starts, ends, one, other, costs)
    glued = ~disk.is_boundary_edge
    glued[cut] = False
    return label_charts(disk, glued)[1]


def _both_to_the_border(
    disk: TriangleMesh, border: IntArray, one: BoolArray, other: BoolArray
) -> tuple[BoolArray, BoolArray] | None:
    """Return two sets of triangles with a path from each to the border; of one around the other, a single triangle."""
    for first, second in (
        (one, other),
        (_single(one), other),
        (one, _single(other)),
        (_single(one), _single(other)),
    ):
        wide = _to_the_border(disk, border, first, second)
        if wide is None:
            continue
        wider = _to_the_border(disk, border, second, wide)
        if wider is not None:
            return wide, wider
    return None


def _single(chosen: BoolArray) -> BoolArray:
    """Return one of the chosen triangles alone."""
    first = np.zeros_like(chosen)
    first[np.argmax(chosen)] = True
    return first


def _to_the_border(
    disk: TriangleMesh, border: IntArray, chosen: BoolArray, barred: BoolArray
) -> BoolArray | None:
    """Return chosen triangles, with the shortest path from them to the border if none of them is there.

    None if there is no path that does not lead through those that are barred.
    """
    beside = disk.edge_faces[border, 0]
    if chosen[beside].any():
        return chosen
    inside = disk.edge_faces[~disk.is_boundary_edge]
    inside = inside[~barred[inside].any(axis=1)]
    dual = MultiGraph(len(disk.faces), inside[:, 0], inside[:, 1], np.ones(len(inside)))
    free = beside[~barred[beside]]
    distance, before, _ = dual.shortest_paths(np.flatnonzero(chosen), free)
    if not np.isfinite(distance[free]).any():
        return None
    nodes, _ = trace_back(free[[np.argmin(distance[free])]], before)
    widened = chosen.copy()
    widened[nodes] = True
    return widened


def widen(
    disk: TriangleMesh, one: BoolArray, other: BoolArray, areas: FloatArray, least: float
) -> tuple[BoolArray, BoolArray]:
    """Return two sets of triangles, each with those nearest to it, and nearer to it than to the other, up to an area.

    areas: (m,) of the triangles.
    """
    inside = disk.edge_faces[~disk.is_boundary_edge]
    middles = (
        disk.vertices[disk.faces[:, 0]] + disk.vertices[disk.faces[:, 1]] + disk.vertices[disk.faces[:, 2]]
    )
    steps = (middles[inside[:, 0]] - middles[inside[:, 1]]) / 3
    lengths = np.hypot(steps[:, 0], steps[:, 1])
    dual = MultiGraph(len(disk.faces), inside[:, 0], inside[:, 1], lengths)
    wide = dual.widened(np.where(one, 0, np.where(other, 1, -1)), areas, least)
    return wide == 0, wide == 1


def _between(disk: TriangleMesh, border: IntArray, mark: IntArray) -> tuple[IntArray, IntArray]:
    """Return the vertices of the border between the sides marked 1 and those marked 2, and between 2 and 1.

    border: (b,) edges in order. mark: (b,).
    """
    # Turned so that the sides marked 1 come last; as both sets are connected, they do not alternate.
    marked = np.flatnonzero(mark)
    turn = marked[np.flatnonzero((mark[marked] == 1) & (mark[np.roll(marked, -1)] == 2))[0]] + 1
    border, mark = np.roll(border, -turn), np.roll(mark, -turn)
    twos, ones = np.flatnonzero(mark == 2), np.flatnonzero(mark == 1)
    tails = disk.tails[disk.edge_halfedges[border, 0]]
    return tails[: twos[0] + 1], tails[twos[-1] + 1 : ones[0] + 1]


def _cheapest_path(
    disk: TriangleMesh,
    starts: IntArray,
    ends: IntArray,
    one: BoolArray,
    other: BoolArray,
    costs: FloatArray,
) -> IntArray:
    """Return the edges of the cheapest path inside a disk that runs through neither set of triangles."""
    one_end, other_end = np.ascontiguousarray(disk.edges.T)
    ways = cost_of_edges(disk.edge_halfedges, one, other, costs)
    graph = MultiGraph(len(disk.vertices), one_end, other_end, ways)
    distance, before, _ = graph.shortest_paths(starts, ends)
    nodes, previous = trace_back(ends[[np.argmin(distance[ends])]], before)
    return graph.edges_between(nodes, previous)


@compiled
def cost_of_edges(
    edge_halfedges: IntArray, one: BoolArray, other: BoolArray, costs: FloatArray
) -> FloatArray:
    """Return (e,) what edges cost with costs (m, 3) of sides: without end on the border and within one set."""
    found = np.full(len(edge_halfedges), np.inf)
    for e in range(len(found)):
        h, t = edge_halfedges[e]
        left, right = h // 3, t // 3
        if t >= 0 and not (one[left] and one[right]) and not (other[left] and other[right]):
            found[e] = costs[left, h % 3]
    return found


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
    count, label = _label_ordered(pairs, triangles)
    order = sort_by_counting(label, count)
    regions = np.split(order, np.cumsum(np.bincount(label, minlength=count))[:-1])
    # An odd one is the same region in the other order.
    return [_layers(pairs, members) for members in regions if members[0] % 2 == 0]


def largest_layers(pairs: IntArray, triangles: IntArray, areas: FloatArray) -> tuple[IntArray, IntArray]:
    """Return the layers of the region of which the smaller layer has the most area.

    areas: (m,) of the triangles.
    """
    count, label = _label_ordered(pairs, triangles)
    kept, moved = pairs.ravel(), pairs[:, ::-1].ravel()
    layers = [np.unique(label * len(areas) + side) for side in (kept, moved)]
    sizes = [np.bincount(one // len(areas), areas[one % len(areas)], count) for one in layers]
    size = np.minimum(*sizes)
    _, first = np.unique(label, return_index=True)
    wound = np.unique(layers[0][np.isin(layers[0], layers[1])] // len(areas))
    size[wound] = np.minimum(areas[kept], areas[moved])[first[wound]]
    size[first % 2 == 1] = -1.0
    return _layers(pairs, np.flatnonzero(label == np.argmax(size)))


def _label_ordered(pairs: IntArray, triangles: IntArray) -> tuple[int, IntArray]:
    """Return how many parts the pairs form, each in both orders, and the part of each; numbered as in `_steps`.

    Which triangle is in which layer goes on with the overlap: a region has two parts, one in the other order, unless
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

    Pair i is numbered 2i as it stands and 2i + 1 in the other order.
    """
    if not len(pairs):
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    count = len(triangles)
    one, two = _neighbours(np.unique(pairs), triangles)
    two = two[sort_by_counting(one, count)]
    degree = np.bincount(one, minlength=count)
    starts = np.cumsum(degree) - degree
    # Every pair in both orders; the second triangle goes to each of its neighbours.
    kept, moved = pairs.ravel(), pairs[:, ::-1].ravel()
    first, degree = starts[moved], degree[moved]
    source = np.repeat(np.arange(len(moved)), degree)
    step = np.arange(len(source)) - np.repeat(np.cumsum(degree) - degree - first, degree)
    kept, moved = kept[source], two[step]
    keys = pairs[:, 0] * count + pairs[:, 1]
    wanted = np.minimum(kept, moved) * count + np.maximum(kept, moved)
    place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    found = keys[place] == wanted
    return source[found], 2 * place[found] + (kept > moved)[found]


def _neighbours(chosen: IntArray, triangles: IntArray) -> tuple[IntArray, IntArray]:
    """Return the chosen triangles that share a side, two and two, each in both orders."""
    tails, heads = triangles[chosen].ravel(), triangles[chosen][:, NEXT].ravel()
    order, first = sort_pairs(tails, heads, int(triangles.max()) + 1)
    again = np.flatnonzero(~first)
    one, two = chosen[order[again - 1] // 3], chosen[order[again] // 3]
    return np.concatenate([one, two]), np.concatenate([two, one])
