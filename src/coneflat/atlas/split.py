"""Splitting of a layout that overlaps itself: layers of overlaps are separated by the cheapest cuts."""

from __future__ import annotations

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray, mask_of
from ..base.progress import check_cancelled
from ..mesh.connectivity import NEXT, TriangleMesh, corner_fans, label_components, sort_pairs
from .sheet import Sheet


def split_overlaps(
    disk: TriangleMesh,
    costs: FloatArray,
    areas: FloatArray,
    pairs: IntArray,
    least: float = 0.0,
    most: float = np.inf,
) -> IntArray | None:
    """Return (m,) the chart of each triangle, from 0, such that no chart has both triangles of a pair.

    The two layers of the largest overlap are separated by the cheapest cut, then those of the largest remaining overlap
    in each piece.

    Args:
        disk: the triangles in the plane, see `as_disk`.
        costs: (3m,) positive cost of cutting the side opposite each corner.
        areas: (m,) areas of the triangles, by which overlaps are compared.
        pairs: (k, 2) triangles to separate, one pair or more, in lexicographic order.
        least: minimum area that a chart should have.
        most: number of charts at which splitting stops.

    Returns:
        The charts, or None if `most` charts are not enough.
    """
    chart, count = np.zeros(len(areas), dtype=np.int64), 1
    sheets = [_Sheet(disk, costs, areas, np.arange(len(areas)), 0)]
    # Pieces of sheets, with the pairs in each and the steps between them.
    waiting = [(sheets[0], 0, pairs, _steps(pairs, disk.faces))]
    while waiting and count < most:
        check_cancelled()
        sheet, own, pairs, steps = waiting.pop()
        if len(sheet.chart) > 1 and sheet.is_pinched(own):
            sheet, own, pairs = sheet.opened(own, pairs)
            sheets.append(sheet)
        one, other = np.zeros((2, len(sheet.faces)), dtype=bool)
        for layer, members in zip((one, other), largest_layers(pairs, steps, sheet.areas), strict=True):
            layer[members] = True
        if least > 0:
            one, other = sheet.widened(own, one, other, sheet.areas, least)
        pieces = sheet.separate(own, one, other)
        if pieces is None:
            # The layers cannot be separated: the overlap remains and is reported by the measures.
            continue
        sheet.chart += [0] * (len(pieces) - 1)
        number = sheet.chart[own]
        for i, piece in enumerate(pieces):
            sheet.chart[piece] = number if i == 0 else count
            count += i > 0
            within = (sheet.piece[pairs] == piece).all(axis=1)
            if within.any():
                waiting.append((sheet, piece, pairs[within], _steps_between(steps, within)))
    for sheet in sheets:  # an opened sheet comes after the sheet that it is a piece of
        chart[sheet.faces] = np.array(sheet.chart)[sheet.piece]
    return None if waiting else chart


class _Sheet(Sheet):
    """A sheet of some of the triangles.

    Attributes:
        faces: (m,) indices of the triangles.
        areas: (m,) their areas.
        chart: the chart index of each piece.
    """

    def __init__(
        self, disk: TriangleMesh, costs: FloatArray, areas: FloatArray, faces: IntArray, chart: int
    ) -> None:
        super().__init__(disk, costs)
        self.areas, self.faces, self.chart = areas, faces, [chart]

    def opened(self, own: int, pairs: IntArray) -> tuple[_Sheet, int, IntArray]:
        """Return a pinched piece as a sheet cut open at its pinch points, its piece index, and its pairs."""
        members = np.flatnonzero(self.piece == own)
        disk = as_disk(self.disk.vertices, self.disk.faces[members])
        costs = self.costs.reshape(-1, 3)[members].ravel()
        sheet = _Sheet(disk, costs, self.areas[members], self.faces[members], self.chart[own])
        return sheet, 0, np.searchsorted(members, pairs)


def as_disk(points: FloatArray, corners: IntArray) -> TriangleMesh:
    """Return triangles of the plane as a separate mesh, cut open at pinch points."""
    is_used = mask_of(len(points), corners)
    return unpinched(TriangleMesh(points[is_used], (np.cumsum(is_used) - 1)[corners]))


def unpinched(mesh: TriangleMesh) -> TriangleMesh:
    """Return a mesh in the plane cut open at pinch points, where triangles meet only in a point."""
    if np.count_nonzero(mesh.is_boundary_edge) == np.count_nonzero(mesh.is_boundary_vertex):
        return mesh
    inside = mesh.edge_halfedges[~mesh.is_boundary_edge]
    count, fans = corner_fans(mesh.faces, *inside.T)
    vertices = np.empty((count, 2))
    vertices[fans] = mesh.vertices[mesh.faces]
    return TriangleMesh(vertices, fans)


def _steps_between(steps: IntArray, chosen: BoolArray) -> IntArray:
    """Return the steps between chosen pairs (k,), renumbered, see `_steps`."""
    number, kept = np.cumsum(chosen) - 1, chosen[steps // 2].all(axis=0)
    return np.asarray(2 * number[steps[:, kept] // 2] + steps[:, kept] % 2)


def largest_layers(pairs: IntArray, steps: IntArray, areas: FloatArray) -> tuple[IntArray, IntArray]:
    """Return the two layers, as triangle indices, of the overlap region whose smaller layer has the most area.

    The assignment of triangles to layers continues along an overlap. A region therefore has two components, one for
    each order of its pairs, unless it winds around so that the layers are connected.

    Args:
        pairs: (k, 2) overlapping triangles, in lexicographic order.
        steps: the steps between them, see `_steps`.
        areas: (m,) areas of the triangles.
    """
    count, label = label_components(2 * len(pairs), *np.concatenate([steps, steps ^ 1], axis=1))
    kept, moved, n = pairs.ravel(), pairs[:, ::-1].ravel(), len(areas)
    layer, swapped = np.unique(label * n + kept), np.empty(count, dtype=np.int64)
    swapped[label] = label.reshape(-1, 2)[:, ::-1].ravel()
    size = np.bincount(layer // n, areas[layer % n], count)
    size = np.minimum(size, size[swapped])
    _, first = np.unique(label, return_index=True)
    wound = np.unique(layer[np.isin(layer, swapped[layer // n] * n + layer % n)] // n)
    size[wound] = np.minimum(areas[kept], areas[moved])[first[wound]]
    size[first % 2 == 1] = -1.0
    return _layers(pairs, np.flatnonzero(label == np.argmax(size)))


def _layers(pairs: IntArray, members: IntArray) -> tuple[IntArray, IntArray]:
    """Return the first and second triangles of pairs numbered as in `_steps`; those of one pair if they intersect."""
    kept, moved = pairs.ravel()[members], pairs.ravel()[members ^ 1]
    one, other = np.unique(kept), np.unique(moved)
    return (kept[:1], moved[:1]) if len(np.intersect1d(one, other)) else (one, other)


def _steps(pairs: IntArray, triangles: IntArray) -> IntArray:
    """Return (2, s) the pairs of an overlap that are adjacent: the second triangle is replaced by a neighbour.

    Pair i has number 2i in its given order and 2i + 1 in the other order.
    """
    # The triangles of pairs are renumbered, as most triangles are in no pair.
    chosen, index = np.unique(pairs, return_inverse=True)
    pairs, count = index.reshape(-1, 2), len(chosen)
    one, two = _neighbours(triangles[chosen])
    two = two[np.argsort(one, kind="stable")]
    degree = np.bincount(one, minlength=count)
    starts = np.cumsum(degree) - degree
    # Every pair in both orders; the second triangle moves to each of its neighbours.
    kept, moved = pairs.ravel(), pairs[:, ::-1].ravel()
    first, degree = starts[moved], degree[moved]
    source = np.repeat(np.arange(len(moved)), degree)
    step = np.arange(len(source)) - np.repeat(np.cumsum(degree) - degree - first, degree)
    kept, moved = kept[source], two[step]
    keys = pairs[:, 0] * count + pairs[:, 1]
    wanted = np.minimum(kept, moved) * count + np.maximum(kept, moved)
    place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    found = keys[place] == wanted
    return np.stack([source[found], 2 * place[found] + (kept > moved)[found]])


def _neighbours(triangles: IntArray) -> tuple[IntArray, IntArray]:
    """Return (s,), (s,) the pairs of triangles that share a side, each in both orders."""
    points, corner = np.unique(triangles, return_inverse=True)
    corners = corner.reshape(-1, 3)
    order, first = sort_pairs(corners.ravel(), corners[:, NEXT].ravel(), len(points))
    again = np.flatnonzero(~first)
    one, two = order[again - 1] // 3, order[again] // 3
    return np.concatenate([one, two]), np.concatenate([two, one])
