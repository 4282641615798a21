"""A disk of triangles that is cut into pieces, in time that depends on the size of the smaller pieces.

In the plane a minimum cut between two triangles, with lengths of edges as capacities, is a shortest path between the
two parts of the border that separate them (planar duality), so no flow has to be computed. Most pieces that are cut
off are small: neither the search for a cut nor the labelling of its sides visits all triangles.
"""

from __future__ import annotations

from functools import cached_property
from itertools import product

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray, has_any, rows_of
from ..geometry.intrinsic import halfedge_twins
from ..linalg.shortest_paths import MultiGraph, Paths, Regions
from ..mesh.connectivity import TriangleMesh
from .sheet_kernels import split_piece, walk_border

# Bound of the relative rounding error of sums of areas.
AREA_ROUNDING = 1e-9


class Sheet:
    """A disk that is cut into pieces.

    Attributes:
        disk: the mesh, a topological disk.
        costs: (3m,) positive cost of cutting the side opposite each corner, equal in both triangles of an edge.
        piece: (m,) the piece of each triangle.
    """

    def __init__(self, disk: TriangleMesh, costs: FloatArray) -> None:
        self.disk, self.costs = disk, costs
        self.piece = np.zeros(len(disk.faces), dtype=np.int64)
        self._twins = halfedge_twins(disk)
        # For each piece a lower bound of its first triangle, and a half-edge on its border.
        self._first, self._start = [0], [int(disk.edge_halfedges[np.argmax(disk.is_boundary_edge), 0])]
        self._owner = np.full(len(disk.faces), -1, dtype=np.int64)
        self._is_cut = np.zeros(len(disk.halfedge_edges), dtype=bool)
        self._edge_costs = costs[disk.edge_halfedges[:, 0]]

    def border(self, index: int) -> IntArray:
        """Return (b,) the half-edges on the border of a piece in order, with the piece on their left."""
        around: IntArray = walk_border(self._twins, self.piece, self._start[index])
        return np.roll(around, -int(np.argmin(self.disk.halfedge_edges[around])))

    def is_pinched(self, index: int) -> bool:
        """Return True if the border of a piece passes through a vertex more than once."""
        border = self.border(index)
        return len(np.unique(self.disk.ends_of(border)[0])) < len(border)

    def separate(self, index: int, first_set: BoolArray, second_set: BoolArray) -> list[int] | None:
        """Cut a piece between two sets of its triangles; return the new pieces, sorted by their first triangles.

        Args:
            index: the piece; one of the new pieces keeps its index.
            first_set, second_set: (m,) True for the triangles to separate: two disjoint connected sets.

        Returns:
            Two or more pieces, or None if each set, even reduced to a single triangle, separates the other from the
            border.
        """
        border = self.border(index)
        widened = self._both_to_the_border(index, border // 3, first_set, second_set)
        if widened is None:
            return None
        first_set, second_set = widened
        mark = np.where(first_set[border // 3], 1, np.where(second_set[border // 3], 2, 0))
        starts, ends = (self.disk.ends_of(sides)[0] for sides in _between(border, mark))
        cut = self.disk.edge_halfedges[self._path(index, first_set, second_set, starts, ends)]
        ids, first, start = split_piece(
            self._twins,
            self.piece,
            index,
            cut,
            self._owner,
            self._is_cut,
            len(self._first),
            self._first[index],
        )
        if len(ids) < 2:
            return None
        self._first += [0] * (len(ids) - 1)
        self._start += [0] * (len(ids) - 1)
        for piece, low, side in zip(ids.tolist(), first.tolist(), start.tolist(), strict=True):
            self._first[piece], self._start[piece] = low, side
        return ids[np.argsort(first)].tolist()

    def _path(
        self, index: int, first_set: BoolArray, second_set: BoolArray, starts: IntArray, ends: IntArray
    ) -> IntArray:
        """Return the edges of the cheapest path in a piece from starts to ends that avoids two sets of triangles."""
        # The last entry is for the outside of the boundary, which is in no piece.
        kind = np.zeros(len(self.piece) + 1, dtype=np.uint8)
        kind[:-1] = np.where(first_set, 2, np.where(second_set, 3, self.piece == index))
        left, right = kind[self.disk.edge_faces.T]
        is_open = (left > 0) & (right > 0) & ((left != right) | (left == 1))
        costs = np.where(is_open, self._edge_costs, np.inf)
        paths = MultiGraph(
            len(self.disk.vertices), self.disk.edges, costs, self.disk.incident_edges
        ).shortest_paths(starts, ends)
        nearest = ends[np.argsort(paths.distance[ends], kind="stable")[:1]]
        return paths.edge[paths.nodes_to(nearest)]

    def widened(
        self, index: int, first_set: BoolArray, second_set: BoolArray, areas: FloatArray, min_area: float
    ) -> tuple[BoolArray, BoolArray]:
        """Return two sets of a piece's triangles, each extended by triangles that are closer to it than to the other.

        Args:
            index: the piece.
            first_set, second_set: (m,) True for the triangles of the sets.
            areas: (m,) areas of the triangles.
            min_area: area up to which each set is extended, where possible.
        """
        regions = Regions(second_set, areas, (1 + AREA_ROUNDING) * min_area)
        paths = self._dual(np.where(self._is_inside(index), self._steps, np.inf)).shortest_paths(
            np.flatnonzero(first_set | second_set), regions=regions
        )
        return grown(paths, first_set, areas, min_area), grown(paths, second_set, areas, min_area)

    @cached_property
    def _steps(self) -> FloatArray:
        """(k,) the distances between the middles of triangles that share an edge, see `TriangleMesh.face_pairs`."""
        a, b, c = (rows_of(self.disk.vertices, self.disk.faces[:, corner]) for corner in range(3))
        first, second = (rows_of(a + b + c, faces) for faces in self.disk.face_pairs[0].T)
        steps = (first - second) / 3
        return np.hypot(steps[:, 0], steps[:, 1])

    def _dual(self, costs: FloatArray) -> MultiGraph:
        """Return the graph of the triangles, with the costs (k,) of steps between those that share an edge."""
        pairs, incident = self.disk.face_pairs
        return MultiGraph(len(self.piece), pairs, costs, incident)

    def _is_inside(self, index: int) -> BoolArray:
        """Return (k,) whether both triangles that share an edge are in a piece."""
        first, second = self.disk.face_pairs[0].T
        is_member = self.piece == index
        return is_member[first] & is_member[second]

    def _both_to_the_border(
        self, index: int, border: IntArray, first_set: BoolArray, second_set: BoolArray
    ) -> tuple[BoolArray, BoolArray] | None:
        """Return two sets, each extended by a path to the border, or None if this is impossible.

        A set that encloses the other is reduced to a single triangle. border: the triangles along the border.
        """
        for second, first in product((second_set, _single(second_set)), (first_set, _single(first_set))):
            wide = self._to_the_border(index, border, first, second)
            if wide is None:
                continue
            wider = self._to_the_border(index, border, second, wide)
            if wider is not None:
                return wide, wider
        return None

    def _to_the_border(
        self, index: int, border: IntArray, chosen: BoolArray, blocked: BoolArray
    ) -> BoolArray | None:
        """Return the chosen triangles, extended by the shortest path to the border if none of them is there.

        The result is None if every path leads through blocked triangles.
        """
        if chosen[border].any():
            return chosen
        is_open = self._is_inside(index) & ~has_any(blocked, self.disk.face_pairs[0])
        free = border[~blocked[border]]
        paths = self._dual(np.where(is_open, 1.0, np.inf)).shortest_paths(np.flatnonzero(chosen), free)
        nearest = free[np.argsort(paths.distance[free], kind="stable")[:1]]
        if not np.isfinite(paths.distance[nearest]).any():
            return None
        widened = chosen.copy()
        widened[paths.nodes_to(nearest)] = True
        return widened


def grown(paths: Paths, chosen: BoolArray, areas: FloatArray, min_area: float) -> BoolArray:
    """Return (m,) the chosen triangles and those whose nearest source they are, up to a total added area `min_area`."""
    gained = np.flatnonzero((paths.source >= 0) & chosen[paths.source])
    gained = gained[np.argsort(paths.distance[gained], kind="stable")]
    before = np.cumsum(areas[gained]) - areas[gained]
    grown = chosen.copy()
    grown[gained[before < min_area]] = True
    return grown


def _single(chosen: BoolArray) -> BoolArray:
    """Return (m,) flags with only the first of the chosen triangles."""
    first = np.zeros_like(chosen)
    first[np.argmax(chosen)] = True
    return first


def _between(border: IntArray, mark: IntArray) -> tuple[IntArray, IntArray]:
    """Return the border half-edges with tails between the sides marked 1 and 2, and those between 2 and 1.

    border: (b,) half-edges in order. mark: (b,) mark of each, 0 for none.
    """
    # Rotate so that the sides marked 1 come last; as both sets are connected, the marks do not alternate.
    marked = np.flatnonzero(mark)
    turn = marked[np.flatnonzero((mark[marked] == 1) & (mark[np.roll(marked, -1)] == 2))[0]] + 1
    border, mark = np.roll(border, -turn), np.roll(mark, -turn)
    twos, ones = np.flatnonzero(mark == 2), np.flatnonzero(mark == 1)
    return border[: twos[0] + 1], border[twos[-1] + 1 : ones[0] + 1]
