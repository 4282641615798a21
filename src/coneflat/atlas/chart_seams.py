"""A mesh laid out in charts, and the seams between and within them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import FloatArray, IntArray
from ..mesh.charts import both_sides, point_seams
from ..mesh.connectivity import TriangleMesh, label_components


@dataclass(frozen=True, eq=False)
class ChartLayout:
    """A layout in charts, which have no points in common and may lie over each other.

    Attributes:
        points: (u, 2) of the plane.
        corners: (m, 3) index of a point for each triangle corner.
        chart: (m,) the chart of each triangle.
        seams: edges of the mesh among which are all whose two sides have different points; None if that is not known.
    """

    points: FloatArray
    corners: IntArray
    chart: IntArray
    seams: IntArray | None = None

    @property
    def places(self) -> NDArray[np.complex128]:
        """(u,) the points as complex numbers."""
        return np.ascontiguousarray(self.points).view(np.complex128)[:, 0]

    def split(self, chart: IntArray) -> ChartLayout:
        """Return the layout in other charts, parts of these, with points of their own."""
        keys = chart[:, None] * len(self.points) + self.corners
        used, corners = numbered(keys)
        return ChartLayout(self.points[used % len(self.points)], corners, chart)

    def joined(self, pairs: IntArray) -> ChartLayout:
        """Return the layout with pairs of points (k, 2) made one, whichever has the smallest index."""
        return ChartLayout(
            self.points, same_points(len(self.points), pairs)[self.corners], self.chart, self.seams
        )

    def numbered_anew(self) -> ChartLayout:
        """Return the layout without unused points, charts counted from 0."""
        used, corners = numbered(self.corners)
        chart = numbered(self.chart)[1]
        return ChartLayout(self.points[used], corners, chart, self.seams)


def numbered(values: IntArray) -> tuple[IntArray, IntArray]:
    """Return the different values, upwards, and for each value its place among them."""
    used, places = np.unique(values, return_inverse=True)
    return used, places.reshape(values.shape)


def same_points(count: int, pairs: IntArray) -> IntArray:
    """Return (count,) for each point the smallest of those that it is one with, by a chain of pairs (k, 2)."""
    same = np.arange(count)
    used, index = np.unique(pairs, return_inverse=True)
    _, label = label_components(len(used), *index.reshape(-1, 2).T)
    _, first = np.unique(label, return_index=True)
    same[used] = used[first[label]]
    return same


class Seams:
    """The inner edges whose two sides have different points.

    Attributes:
        edges: (k,) of the mesh.
        here, there: (k, 2) points at the ends of an edge, as the faces of its two half-edges have them.
        charts: (k, 2) of these faces.
    """

    def __init__(self, mesh: TriangleMesh, layout: ChartLayout) -> None:
        self.edges = point_seams(mesh, layout.corners, layout.seams)
        self.here, self.there = both_sides(mesh, self.edges, layout.corners)
        self.charts = layout.chart[mesh.edge_halfedges[self.edges] // 3]

    def within(self, *charts: int) -> IntArray:
        """Return which of the edges have both sides in given charts."""
        return np.flatnonzero(np.isin(self.charts, charts).all(axis=1))

    def coinciding(self, places: NDArray[np.complex128], chosen: IntArray, tolerance: float) -> IntArray:
        """Return pairs of points (k, 2) at the ends of chosen edges whose sides lie on each other.

        places: of all points. tolerance: relative to the length of the edge.
        """
        here, there = places[self.here[chosen]], places[self.there[chosen]]
        gap = np.abs(here - there).max(axis=1, initial=0.0)
        same = gap <= tolerance * np.abs(here[:, 1] - here[:, 0])
        return np.stack([self.here[chosen][same].ravel(), self.there[chosen][same].ravel()], axis=1)

    def stretches(self, mesh: TriangleMesh) -> IntArray:
        """Return (k,) the stretch that each edge is part of: a chain between the same two charts, without branches."""
        at = mesh.edges[self.edges].ravel()
        low, high = self.charts.min(axis=1), self.charts.max(axis=1)
        order = np.argsort(at, kind="stable")
        meet = at[order[1:]] == at[order[:-1]]
        one, two = order[:-1][meet] // 2, order[1:][meet] // 2
        goes_on = np.bincount(at, minlength=len(mesh.vertices))[at[order[:-1][meet]]] == 2
        goes_on &= (low[one] == low[two]) & (high[one] == high[two])
        return label_components(len(self.edges), one[goes_on], two[goes_on])[1]
