"""Surfaces with several layers, such as the two sides of cloth: which half-edges of crowded edges are glued.

An edge with more than two faces is crowded. Faces on the same three vertices are twins: the two sides of a sheet, or a
face that is given twice. At a crowded edge, a half-edge continues into one of the opposite direction whose face is not
its twin. If all candidates are twins of each other, with one orientation, the choice is unambiguous. In this way the
front of a doubled sheet is glued to the front, and the back to the back. Where the two sides have other diagonals, they
have no twins; then two layers continue where the surface bends least, if that is clear.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray, dots, mask_of
from .connectivity import NEXT, PREVIOUS, corner_fans, end_corners, sort_pairs

# Difference of the sums of two cosines, each 1 where a surface continues straight on and -1 where it folds back, from
# which one of two ways to connect two layers is clear.
CLEAR_BEND = 1.0
# Cosine of the angle between two faces, 18 degrees, below which one is folded back onto the other.
FOLDED = 0.95


@dataclass(frozen=True, eq=False)
class EdgeGroups:
    """Half-edges that are grouped by their two vertices.

    Attributes:
        halfedges: (3m,) half-edges by edge, ascending within each.
        starts: (e,) where the half-edges of each edge start.
        sizes: (e,) number of half-edges of each edge.
    """

    halfedges: IntArray
    starts: IntArray
    sizes: IntArray

    @classmethod
    def of(cls, faces: IntArray, count: int) -> EdgeGroups:
        """Return the groups of (m, 3) faces with vertices below `count`."""
        halfedges, is_first = sort_pairs(faces[:, NEXT].ravel(), faces[:, PREVIOUS].ravel(), count)
        starts = np.flatnonzero(is_first)
        return cls(halfedges, starts, np.diff(np.append(starts, len(halfedges))))

    @property
    def crowded(self) -> IntArray:
        """(c,) the first half-edge of each crowded edge."""
        return self.halfedges[self.starts[self.sizes > 2]]

    @property
    def pairs(self) -> IntArray:
        """(k, 2) the half-edges of edges with two faces."""
        first = self.starts[self.sizes == 2]
        return np.stack([self.halfedges[first], self.halfedges[first + 1]], axis=1)


@dataclass(frozen=True, eq=False)
class GluedLayers:
    """The half-edges of a mesh that are glued.

    Attributes:
        pairs: (k, 2) half-edges.
        separated: number of crowded edges at which a face is separated from others.
        stacked: number of faces with a twin in another layer, without the first of each set of twins.
    """

    pairs: IntArray
    separated: int
    stacked: int


def glue_layers(vertices: FloatArray, faces: IntArray, groups: EdgeGroups) -> GluedLayers:
    """Return which half-edges are glued: those of edges with two faces, and layers that continue at crowded edges.

    Each half-edge is in one pair at most. After `split_vertices`, no edge has more than two faces.

    Args:
        vertices: (n, 3) positions.
        faces: (m, 3) vertex indices, three different ones in each face.
        groups: the half-edges of each edge.
    """
    apexes, pairs = faces.ravel(), groups.pairs
    are_twins = apexes[pairs[:, 0]] == apexes[pairs[:, 1]]
    plain, between_twins = pairs[~are_twins], pairs[are_twins]
    crowded = CrowdedEdges.of(faces, groups)
    continued = crowded.opposed_pairs()
    straight = crowded.straight_pairs(continued, vertices)
    if len(straight):
        # The two sides end at the border of the sheet, where one folds back onto the other.
        away = [away_from_edge(vertices, faces, halfedges) for halfedges in plain.T]
        plain = plain[dots(*away) < FOLDED]
    continued = np.concatenate([continued, straight])
    continued = np.concatenate([continued, crowded.turned_pairs(continued)])
    continued = continued[~crowded.closes_again(plain, continued)]
    glued = np.concatenate([plain, continued])
    # Two twins without any other neighbour are a closed surface; between layers, the border of a sheet is open.
    is_attached = mask_of(len(faces), glued // 3)
    is_closed = ~is_attached[between_twins // 3].any(axis=1)
    open_twins = between_twins[~is_closed, 0]
    return GluedLayers(
        np.concatenate([glued, between_twins[is_closed]]),
        crowded.count_separated(continued),
        crowded.count_stacked() + int(np.count_nonzero(_is_opposite_largest(faces, open_twins))),
    )


@dataclass(frozen=True, eq=False)
class CrowdedEdges:
    """The k half-edges of crowded edges, sorted by edge, apex, and direction.

    Attributes:
        faces: (m, 3) vertex indices.
        halfedges: (k,) half-edges, ascending within each kind.
        edge: (k,) crowded edge of each, from 0.
        apex: (k,) the vertex opposite each.
        is_forward: (k,) whether each runs from its smaller to its larger vertex.
    """

    faces: IntArray
    halfedges: IntArray
    edge: IntArray
    apex: IntArray
    is_forward: BoolArray

    @classmethod
    def of(cls, faces: IntArray, groups: EdgeGroups) -> CrowdedEdges:
        """Return the crowded edges of a mesh."""
        is_crowded = groups.sizes > 2
        halfedges = groups.halfedges[np.repeat(is_crowded, groups.sizes)]
        sizes = groups.sizes[is_crowded]
        edge = np.repeat(np.arange(len(sizes)), sizes)
        flat, (start, end) = faces.ravel(), end_corners(halfedges)
        apex, is_forward = flat[halfedges], flat[start] < flat[end]
        order = np.lexsort((is_forward, apex, edge))
        return cls(faces, halfedges[order], edge[order], apex[order], is_forward[order])

    def opposed_pairs(self) -> IntArray:
        """Return (p, 2) half-edges of opposite directions that continue into each other unambiguously.

        A class consists of the half-edges of twins with one direction. It is paired with its only candidate, unless
        that is also the only candidate of another class, as where three single sheets meet.
        """
        first = _run_starts(self.edge, self.apex, self.is_forward)
        sizes = np.diff(np.append(first, len(self.edge)))
        edge, apex, count = self.edge[first], self.apex[first], len(first)
        # The two classes of an apex follow one another.
        before = np.flatnonzero((edge[1:] == edge[:-1]) & (apex[1:] == apex[:-1]))
        reverse = np.full(count, -1)
        reverse[before], reverse[before + 1] = before + 1, before
        has_reverse = reverse >= 0
        # The number and the sum of the classes of the other direction without this apex: the sum of one is the class.
        side, sides = 2 * edge + self.is_forward[first], 2 * int(edge.max(initial=-1)) + 2
        numbers, sums = (
            np.bincount(side, weights, sides)[side ^ 1] for weights in (np.ones(count), np.arange(count))
        )
        decided = np.flatnonzero(numbers - has_reverse == 1)
        candidate = (sums - np.where(has_reverse, reverse, 0)).astype(np.int64)[decided]
        is_uncontested = np.bincount(candidate, minlength=count)[candidate] == 1
        low, high = np.sort(np.stack([decided, candidate])[:, is_uncontested], axis=0)
        # Two classes that are the only candidates of each other are one pair.
        low, high = np.divmod(np.unique(low * count + high), max(count, 1))
        return _zipped(self.halfedges, first[low], first[high], np.minimum(sizes[low], sizes[high]))

    def straight_pairs(self, pairs: IntArray, vertices: FloatArray) -> IntArray:
        """Return (p, 2) half-edges, two of each direction left over at an edge, that continue with the least bend.

        Args:
            pairs: (q, 2) half-edges that are paired already.
            vertices: (n, 3) positions.
        """
        unpaired = np.flatnonzero(~np.isin(self.halfedges, pairs))
        forward, backward = unpaired[self.is_forward[unpaired]], unpaired[~self.is_forward[unpaired]]
        count = int(self.edge.max(initial=-1)) + 1
        has_two = (np.bincount(self.edge[forward], minlength=count) == 2) & (
            np.bincount(self.edge[backward], minlength=count) == 2
        )
        # Sorted by edge, so that the two of an edge follow one another.
        forward, backward = (side[has_two[self.edge[side]]] for side in (forward, backward))
        ahead, back = forward.reshape(-1, 2), backward.reshape(-1, 2)
        away = away_from_edge(vertices, self.faces, self.halfedges)
        straight, crossed = (
            -dots(away[ahead[:, 0]], away[back[:, k]]) - dots(away[ahead[:, 1]], away[back[:, 1 - k]])
            for k in (0, 1)
        )
        is_straight, is_crossed = straight >= crossed + CLEAR_BEND, crossed >= straight + CLEAR_BEND
        chosen = [
            np.stack([ahead[is_clear, i], back[is_clear, i ^ k]], axis=1)
            for k, is_clear in ((0, is_straight), (1, is_crossed))
            for i in (0, 1)
        ]
        return self.halfedges[np.concatenate(chosen)]

    def turned_pairs(self, pairs: IntArray) -> IntArray:
        """Return (p, 2) half-edges of one direction that are left over at edges between two apexes.

        There a doubled sheet is not consistently oriented.

        Args:
            pairs: (q, 2) half-edges that are paired already.
        """
        unpaired = np.flatnonzero(~np.isin(self.halfedges, pairs))
        first = _run_starts(self.edge[unpaired], self.apex[unpaired])
        sizes, edge = np.diff(np.append(first, len(unpaired))), self.edge[unpaired][first]
        run = np.flatnonzero((edge[1:] == edge[:-1]) & (self._apex_counts()[edge[1:]] == 2))
        counts = np.minimum(sizes[run], sizes[run + 1])
        return _zipped(self.halfedges[unpaired], first[run], first[run + 1], counts)

    def closes_again(self, plain: IntArray, pairs: IntArray) -> BoolArray:
        """Return (p,) whether more than two half-edges would lie between the same two vertices after `split_vertices`.

        That is so where layers are also connected around both ends of an edge.

        Args:
            plain: (q, 2) half-edges of other edges that are glued.
            pairs: (p, 2) half-edges of these edges.
        """
        fans, fan = corner_fans(self.faces, *np.concatenate([plain, pairs]).T)
        ends = np.stack(end_corners(self.halfedges))
        low, high = fan.ravel()[np.where(self.is_forward, ends, ends[::-1])]
        _, number, counts = np.unique(low * fans + high, return_inverse=True, return_counts=True)
        is_shared = mask_of(self.faces.size, self.halfedges[counts[number] > 2])
        return is_shared[pairs[:, 0]]

    def count_separated(self, pairs: IntArray) -> int:
        """Return the number of edges between several apexes with a half-edge that is not in the pairs (p, 2)."""
        edge = self.edge[~np.isin(self.halfedges, pairs)]
        return len(np.unique(edge[self._apex_counts()[edge] > 1]))

    def count_stacked(self) -> int:
        """Return the number of faces with a twin, without the first of each set of twins, by their first edge."""
        is_counted = _is_opposite_largest(self.faces, self.halfedges)
        first = _run_starts(self.edge, self.apex)
        return int(np.count_nonzero(is_counted) - np.count_nonzero(is_counted[first]))

    def _apex_counts(self) -> IntArray:
        """Return (e,) the number of apexes of each edge."""
        return np.bincount(self.edge[_run_starts(self.edge, self.apex)])


def away_from_edge(vertices: FloatArray, faces: IntArray, halfedges: IntArray) -> FloatArray:
    """Return (k, 3) unit vectors in the face of each half-edge (k,), at right angles to it, from it to the apex."""
    start, end = (vertices[faces.ravel()[corners]] for corners in end_corners(halfedges))
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        along = end - start
        across = vertices[faces.ravel()[halfedges]] - start
        across = across - along * (dots(across, along) / dots(along, along))[:, None]
        across = across / np.sqrt(dots(across, across))[:, None]
    return np.nan_to_num(across, nan=0.0, posinf=0.0, neginf=0.0)


def _run_starts(*columns: IntArray | BoolArray) -> IntArray:
    """Return the first position of each run of equal rows of columns (k,)."""
    if not len(columns[0]):
        return np.empty(0, dtype=np.int64)
    is_first = np.any([column[1:] != column[:-1] for column in columns], axis=0)
    return np.flatnonzero(np.append(True, is_first))


def _is_opposite_largest(faces: IntArray, halfedges: IntArray) -> BoolArray:
    """Return (k,) whether half-edges are opposite the largest vertex of their face, which has one such half-edge."""
    return faces.ravel()[halfedges] == faces[halfedges // 3].max(axis=1)


def _zipped(halfedges: IntArray, starts: IntArray, other_starts: IntArray, sizes: IntArray) -> IntArray:
    """Return (p, 2) half-edges of runs in pairs: the first of a run with the first of the other, and so on.

    Args:
        halfedges: (k,) half-edges.
        starts, other_starts: (r,) where the two runs of each pair of runs start.
        sizes: (r,) the number of pairs of half-edges of each.
    """
    rank = np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    return np.stack([halfedges[np.repeat(first, sizes) + rank] for first in (starts, other_starts)], axis=1)
