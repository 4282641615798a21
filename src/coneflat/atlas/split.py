"""A layout that overlaps itself split into charts: the layers of its overlaps, and the cheapest cuts between them."""

from __future__ import annotations

import numpy as np

from ..base.arrays import FloatArray, IntArray
from ..base.progress import check_cancelled
from ..mesh.connectivity import (
    NEXT,
    TriangleMesh,
    corner_fans,
    label_components,
    sort_by_counting,
    sort_pairs,
)
from .sheet import Sheet


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
    if not len(pairs):
        return chart
    sheets = [_Sheet.of(as_disk(points, corners) if whole is None else whole, costs, areas)]
    # Pieces of sheets, and the pairs in each.
    waiting = [(sheets[0], 0, pairs)]
    while waiting and count < most:
        check_cancelled()
        sheet, own, pairs = waiting.pop()
        if len(sheet.chart) > 1 and sheet.is_pinched(own):
            sheet, own, pairs = sheet.opened(own, pairs)
            sheets.append(sheet)
        one, other = np.zeros((2, len(sheet.faces)), dtype=bool)
        for layer, members in zip(
            (one, other), largest_layers(pairs, sheet.disk.faces, sheet.areas), strict=True
        ):
            layer[members] = True
        if least > 0:
            one, other = sheet.widened(own, one, other, sheet.areas, least)
        pieces = sheet.separate(own, one, other)
        if pieces is None:
            # They stay together and overlap, which the measures show.
            continue
        sheet.chart += [0] * (len(pieces) - 1)
        number = sheet.chart[own]
        for i, piece in enumerate(pieces):
            sheet.chart[piece] = number if i == 0 else count
            count += i > 0
            within = pairs[(sheet.piece[pairs] == piece).all(axis=1)]
            if len(within):
                waiting.append((sheet, piece, within))
    for sheet in sheets:  # what was opened comes after what it was part of
        chart[sheet.faces] = np.array(sheet.chart)[sheet.piece]
    return None if waiting else chart


class _Sheet(Sheet):
    """A sheet of some of the triangles.

    Attributes:
        faces: (m,) which they are.
        areas: (m,) of them.
        chart: the number of the chart that each piece is.
    """

    def __init__(
        self, disk: TriangleMesh, costs: FloatArray, areas: FloatArray, faces: IntArray, chart: int
    ) -> None:
        super().__init__(disk, costs)
        self.areas, self.faces, self.chart = areas, faces, [chart]

    @classmethod
    def of(cls, disk: TriangleMesh, costs: FloatArray, areas: FloatArray) -> _Sheet:
        """Return a sheet of all triangles."""
        return cls(disk, costs, areas, np.arange(len(areas)), 0)

    def opened(self, own: int, pairs: IntArray) -> tuple[_Sheet, int, IntArray]:
        """Return a piece that touches itself in a point as a sheet, opened there, with its pairs of triangles."""
        members = np.flatnonzero(self.piece == own)
        disk = as_disk(self.disk.vertices, self.disk.faces[members])
        costs = self.costs.reshape(-1, 3)[members].ravel()
        sheet = _Sheet(disk, costs, self.areas[members], self.faces[members], self.chart[own])
        return sheet, 0, np.searchsorted(members, pairs)


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
    # Numbered by themselves, as most triangles have no part in it.
    chosen, index = np.unique(pairs, return_inverse=True)
    pairs, count = index.reshape(-1, 2), len(chosen)
    one, two = _neighbours(triangles[chosen])
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


def _neighbours(triangles: IntArray) -> tuple[IntArray, IntArray]:
    """Return the triangles that share a side, two and two, each in both orders."""
    points, corner = np.unique(triangles, return_inverse=True)
    corners = corner.reshape(-1, 3)
    order, first = sort_pairs(corners.ravel(), corners[:, NEXT].ravel(), len(points))
    again = np.flatnonzero(~first)
    one, two = order[again - 1] // 3, order[again] // 3
    return np.concatenate([one, two]), np.concatenate([two, one])
