"""Splitting of a layout that overlaps itself: layers of overlaps are separated by the cheapest cuts."""

from __future__ import annotations

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray, mask_of
from ..base.progress import check_cancelled
from ..mesh.connectivity import NEXT, TriangleMesh, corner_fans, label_components, sort_pairs
from ..mesh.holes import find_holes, with_fans
from .sheet import Sheet

# Cost of cutting a side in a hole, relative to the mean cost.
NO_COST = 1e-9


def split_overlaps(
    disk: TriangleMesh,
    costs: FloatArray,
    areas: FloatArray,
    pairs: IntArray,
    min_area: float = 0.0,
    max_charts: float = np.inf,
    steps: IntArray | None = None,
) -> IntArray | None:
    """Return (m,) the chart of each triangle, from 0, such that no chart has both triangles of a pair.

    The two layers of the largest overlap are separated by the cheapest cut, then those of the largest remaining overlap
    in each piece.

    Args:
        disk: the triangles in the plane, see `as_disk`.
        costs: (3m,) positive cost of cutting the side opposite each corner.
        areas: (m,) areas of the triangles, by which overlaps are compared.
        pairs: (k, 2) triangles to separate, one pair or more, in lexicographic order.
        min_area: minimum area that a chart should have.
        max_charts: number of charts at which splitting stops.
        steps: the steps between the pairs, if they are known, see `find_steps`.

    Returns:
        The charts, or None if `max_charts` charts are not enough.
    """
    chart, count = np.zeros(len(areas), dtype=np.int64), 1
    sheets = [_Sheet(disk, costs, areas, np.arange(len(areas)), 0)]
    # Pieces of sheets, with the pairs in each and the steps between them.
    waiting = [(sheets[0], 0, pairs, find_steps(pairs, disk.faces) if steps is None else steps)]
    while waiting and count < max_charts:
        check_cancelled()
        sheet, index, pairs, steps = waiting.pop()
        if len(sheet.chart) > 1 and sheet.is_pinched(index):
            sheet, index, pairs = sheet.opened(index, pairs)
            sheets.append(sheet)
        first_layer, second_layer = np.zeros((2, len(sheet.faces)), dtype=bool)
        for layer, members in zip(
            (first_layer, second_layer), largest_layers(pairs, steps, sheet.areas), strict=True
        ):
            layer[members] = True
        if min_area > 0:
            first_layer, second_layer = sheet.widened(index, first_layer, second_layer, sheet.areas, min_area)
        pieces = sheet.separate(index, first_layer, second_layer)
        if pieces is None:
            # The layers cannot be separated: the overlap remains and is reported by the measures.
            continue
        sheet.chart += [0] * (len(pieces) - 1)
        number = sheet.chart[index]
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

    def opened(self, index: int, pairs: IntArray) -> tuple[_Sheet, int, IntArray]:
        """Return a pinched piece as a sheet cut open at its pinch points, its piece index, and its pairs."""
        members = np.flatnonzero(self.piece == index)
        disk = as_disk(self.disk.vertices, self.disk.faces[members])
        costs = self.costs.reshape(-1, 3)[members].ravel()
        sheet = _Sheet(disk, costs, self.areas[members], self.faces[members], self.chart[index])
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


def filled_disk(disk: TriangleMesh, costs: FloatArray) -> tuple[TriangleMesh, FloatArray]:
    """Return a disk with filled holes, and the costs of cutting its sides: almost zero in and along holes.

    Args:
        disk: the m triangles, which come first in the result.
        costs: (3m,) the costs of cutting their sides.
    """
    holes = find_holes(disk)
    if not holes:
        return disk, costs
    filled = with_fans(disk, [disk.tails[hole] for hole in holes])
    finite = costs[np.isfinite(costs)]  # diagonals and forbidden sides have infinite costs
    side_costs = np.full(filled.faces.size, NO_COST * (finite.mean() if len(finite) else 1.0))
    side_costs[: len(costs)] = costs
    side_costs[np.concatenate(holes)] = side_costs[-1]
    return filled, side_costs


def _steps_between(steps: IntArray, chosen: BoolArray) -> IntArray:
    """Return the steps between chosen pairs (k,), renumbered, see `find_steps`."""
    number, is_within = np.cumsum(chosen) - 1, chosen[steps // 2].all(axis=0)
    return np.asarray(2 * number[steps[:, is_within] // 2] + steps[:, is_within] % 2)


def largest_layers(pairs: IntArray, steps: IntArray, areas: FloatArray) -> tuple[IntArray, IntArray]:
    """Return the two layers, as triangle indices, of the overlap region whose smaller layer has the most area.

    The assignment of triangles to layers continues along an overlap. A region therefore has two components, one for
    each order of its pairs, unless it winds around so that the layers are connected.

    Args:
        pairs: (k, 2) overlapping triangles, in lexicographic order.
        steps: the steps between them, see `find_steps`.
        areas: (m,) areas of the triangles.
    """
    count, label = label_components(2 * len(pairs), *np.concatenate([steps, steps ^ 1], axis=1))
    firsts, seconds, n = pairs.ravel(), pairs[:, ::-1].ravel(), len(areas)
    layer, swapped = np.unique(label * n + firsts), np.empty(count, dtype=np.int64)
    swapped[label] = label.reshape(-1, 2)[:, ::-1].ravel()
    size = np.bincount(layer // n, areas[layer % n], count)
    size = np.minimum(size, size[swapped])
    _, first = np.unique(label, return_index=True)
    wound = np.unique(layer[np.isin(layer, swapped[layer // n] * n + layer % n)] // n)
    size[wound] = np.minimum(areas[firsts], areas[seconds])[first[wound]]
    size[first % 2 == 1] = -1.0
    return _layers(pairs, np.flatnonzero(label == np.argmax(size)))


def _layers(pairs: IntArray, members: IntArray) -> tuple[IntArray, IntArray]:
    """Return the first and second triangles of pairs, see `find_steps`; those of one pair if they intersect."""
    firsts, seconds = pairs.ravel()[members], pairs.ravel()[members ^ 1]
    first_layer, second_layer = np.unique(firsts), np.unique(seconds)
    return (
        (firsts[:1], seconds[:1])
        if len(np.intersect1d(first_layer, second_layer))
        else (first_layer, second_layer)
    )


def find_steps(pairs: IntArray, triangles: IntArray) -> IntArray:
    """Return (2, s) the pairs of an overlap that are adjacent: the second triangle is replaced by a neighbour.

    Pair i has number 2i in its given order and 2i + 1 in the other order.
    """
    # The triangles of pairs are renumbered, as most triangles are in no pair.
    chosen, index = np.unique(pairs, return_inverse=True)
    pairs, count = index.reshape(-1, 2), len(chosen)
    triangle, neighbour = _neighbours(triangles[chosen])
    neighbour = neighbour[np.argsort(triangle, kind="stable")]
    degree = np.bincount(triangle, minlength=count)
    starts = np.cumsum(degree) - degree
    # Every pair in both orders; the second triangle moves to each of its neighbours.
    fixed, moved = pairs.ravel(), pairs[:, ::-1].ravel()
    first, degree = starts[moved], degree[moved]
    source = np.repeat(np.arange(len(moved)), degree)
    step = np.arange(len(source)) - np.repeat(np.cumsum(degree) - degree - first, degree)
    fixed, moved = fixed[source], neighbour[step]
    keys = pairs[:, 0] * count + pairs[:, 1]
    step_keys = np.minimum(fixed, moved) * count + np.maximum(fixed, moved)
    place = np.minimum(np.searchsorted(keys, step_keys), len(keys) - 1)
    is_pair = keys[place] == step_keys
    return np.stack([source[is_pair], 2 * place[is_pair] + (fixed > moved)[is_pair]])


def _neighbours(triangles: IntArray) -> tuple[IntArray, IntArray]:
    """Return (s,), (s,) the pairs of triangles that share a side, each in both orders."""
    points, corner = np.unique(triangles, return_inverse=True)
    corners = corner.reshape(-1, 3)
    order, first = sort_pairs(corners.ravel(), corners[:, NEXT].ravel(), len(points))
    again = np.flatnonzero(~first)
    triangle, neighbour = order[again - 1] // 3, order[again] // 3
    return np.concatenate([triangle, neighbour]), np.concatenate([neighbour, triangle])
