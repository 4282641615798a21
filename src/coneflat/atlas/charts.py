"""Charts of triangles in the plane, and their outlines."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import FloatArray, IntArray, as_floats, mask_of
from ..errors import ArrayShapeError, NonFiniteError, OptionError
from ..geometry.coverage import cancel_sides
from ..geometry.planar import bounds
from ..mesh.charts import both_sides, open_sides, point_seams
from ..mesh.connectivity import NEXT, PREVIOUS, TriangleMesh, label_components

# Area relative to the square of the extent. A chart below this is a line, up to rounding.
NO_AREA = 1e-6


@dataclass(frozen=True, eq=False)
class Charts:
    """The m triangles of k charts.

    Attributes:
        corners: (m, 3) corner positions as complex numbers u + iv.
        chart: (m,) chart index of each triangle, from 0.
        count: number of charts k; every chart has at least one triangle.
        edge_halfedges: (e, 2) the half-edges of each edge, see `TriangleMesh`; None if the connectivity of the
            triangles is not known.
    """

    corners: NDArray[np.complex128]
    chart: IntArray
    count: int
    edge_halfedges: IntArray | None = None

    @cached_property
    def areas(self) -> FloatArray:
        """Return (m,) the signed areas of the triangles."""
        first_side, second_side = (
            self.corners[:, 1] - self.corners[:, 0],
            self.corners[:, 2] - self.corners[:, 0],
        )
        return (np.conj(first_side) * second_side).imag / 2

    def sums(self, values: FloatArray) -> FloatArray:
        """Return (k,) the sum over each chart of (m,) values per triangle."""
        return np.bincount(self.chart, weights=values, minlength=self.count).astype(np.float64)

    @cached_property
    def has_area(self) -> NDArray[np.bool_]:
        """Return (k,) flags, False for charts that are degenerate to lines or points."""
        low, high = bounds(self.places)
        lowest, highest = np.full((self.count, 2), np.inf), np.full((self.count, 2), -np.inf)
        np.minimum.at(lowest, self.chart, low)
        np.maximum.at(highest, self.chart, high)
        return np.abs(self.sums(self.areas)) > NO_AREA * (highest - lowest).max(axis=1) ** 2

    @property
    def places(self) -> FloatArray:
        """Return (m, 3, 2) the corner positions as coordinates."""
        return np.ascontiguousarray(self.corners).view(np.float64).reshape(-1, 3, 2)

    def outlines(self) -> Outlines:
        """Return the outline of each chart; its winding number at a point counts the triangles that cover the point.

        Two sides with opposite directions between the same points cancel. Interior sides whose two copies of a
        point differ by rounding may remain; this is harmless. Flipped triangles are reversed, so that the area that
        they cover also counts.
        """
        corners, chart, is_flipped = self.corners, self.chart, self.areas < 0
        # The sides, each starting at its corner, that are not known to cancel in pairs.
        is_outline = np.ones(corners.shape, dtype=bool)
        if self.edge_halfedges is not None:
            group = np.where(is_flipped, -1, chart)
            is_outline = open_sides(self.edge_halfedges, self.places, group).reshape(-1, 3)[:, PREVIOUS]
        if is_flipped.any():
            corners = np.where(is_flipped[:, None], corners[:, [0, 2, 1]], corners)
        triangle, corner = np.nonzero(is_outline)
        sides = np.stack([corners[triangle, corner], corners[triangle, NEXT[corner]]], axis=1)
        label, balance = cancel_sides(sides, chart[triangle])
        is_outline[triangle, corner] = balance[label] != 0
        # If all sides of a chart cancel, it has no area: all its sides are used as the outline.
        is_outline |= (np.bincount(chart, weights=is_outline.any(axis=1), minlength=self.count) == 0)[chart][
            :, None
        ]
        triangle, corner = np.nonzero(is_outline)
        order = np.argsort(chart[triangle], kind="stable")
        triangle, corner = triangle[order], corner[order]
        sides = np.stack([corners[triangle, corner], corners[triangle, NEXT[corner]]], axis=1)
        return Outlines(sides, np.searchsorted(chart[triangle], np.arange(self.count + 1)))

    def rotated(self, angles: FloatArray) -> Charts:
        """Return the charts rotated about the origin, each by its angle in (k,), radians."""
        return replace(self, corners=self.corners * np.exp(1j * angles)[self.chart][:, None])

    def moved(self, factors: NDArray[np.complex128], shifts: NDArray[np.complex128]) -> FloatArray:
        """Return (m, 3, 2) the corners, multiplied by the complex factor (k,) of their chart, plus its shift (k,)."""
        moved = self.corners * factors[self.chart][:, None] + shifts[self.chart][:, None]
        return replace(self, corners=moved).places


def read_charts(corner_uv: ArrayLike, chart_of_triangle: ArrayLike | None) -> Charts:
    """Return validated charts.

    Args:
        corner_uv: (m, 3, 2) positions of the triangle corners.
        chart_of_triangle: (m,) chart index of each triangle; None for a single chart.

    Raises:
        ArrayShapeError, NonFiniteError, OptionError: as in `pack_charts`.
    """
    uv = as_floats("corner_uv", corner_uv)
    if uv.ndim != 3 or uv.shape[1:] != (3, 2) or not len(uv):
        raise ArrayShapeError(f"corner_uv must have shape (triangles, 3, 2), got {uv.shape}")
    if not np.isfinite(uv).all():
        bad = np.flatnonzero(~np.isfinite(uv).all(axis=(1, 2)))
        raise NonFiniteError(f"{len(bad):,} triangles have no finite UVs, the first is {bad[0]}")
    if chart_of_triangle is None:
        chart = np.zeros(len(uv), dtype=np.int64)
    else:
        as_floats("chart_of_triangle", chart_of_triangle)
        chart = np.asarray(chart_of_triangle)
    if chart.shape != (len(uv),) or chart.dtype.kind not in "iu":
        raise ArrayShapeError(
            f"chart_of_triangle must have one integer for each of {len(uv):,} triangles, got shape "
            f"{chart.shape} and type {chart.dtype}"
        )
    triangles = np.bincount(chart) if chart.min() >= 0 and chart.max() < len(chart) else np.zeros(1)
    if not triangles.all():
        raise OptionError(
            f"chart_of_triangle must number charts from 0 without gaps, got {len(np.unique(chart)):,} different "
            f"numbers from {chart.min()} to {chart.max()}"
        )
    charts = Charts(uv.view(np.complex128)[..., 0], chart.astype(np.int64), len(triangles))
    total = charts.sums(charts.areas)
    mirrored = np.flatnonzero((total < 0) & charts.has_area) if (total < 0).any() else total[:0]
    if len(mirrored):
        raise OptionError(
            f"{len(mirrored):,} of {charts.count:,} charts are mirrored, the first is {mirrored[0]} "
            f"with area {total[mirrored[0]]:.3g}: mirror them before packing"
        )
    return charts


@dataclass(frozen=True, eq=False)
class Outlines:
    """The outlines of k charts.

    Attributes:
        sides: (s, 2) start and end point of each side as complex numbers, sorted by chart.
        start: (k + 1,) the index of the first side of each chart.
    """

    sides: NDArray[np.complex128]
    start: IntArray

    def __len__(self) -> int:
        return len(self.start) - 1

    def times(self, factors: NDArray[np.complex128]) -> Outlines:
        """Return the outlines rotated and scaled, each by its complex factor in (k,)."""
        return Outlines(self.sides * np.repeat(factors, np.diff(self.start))[:, None], self.start)

    def points(self, chart: int) -> NDArray[np.complex128]:
        """Return the end points of the sides of a chart."""
        return self.sides[self.start[chart] : self.start[chart + 1]].ravel()


@dataclass(frozen=True, eq=False)
class ChartLayout:
    """A layout split into charts, which share no points and may overlap each other.

    Attributes:
        points: (u, 2) positions in the plane.
        corners: (m, 3) point index of each triangle corner.
        chart: (m,) the chart of each triangle.
        seams: mesh edges that include every edge whose two sides have different points; None if unknown.
    """

    points: FloatArray
    corners: IntArray
    chart: IntArray
    seams: IntArray | None = None

    @property
    def places(self) -> NDArray[np.complex128]:
        """Return (u,) the points as complex numbers."""
        return np.ascontiguousarray(self.points).view(np.complex128)[:, 0]

    def split(self, chart: IntArray) -> ChartLayout:
        """Return the layout split into smaller charts, (m,) the chart of each triangle, with separate points."""
        keys = chart[:, None] * len(self.points) + self.corners
        distinct, corners = np.unique(keys, return_inverse=True)
        return ChartLayout(self.points[distinct % len(self.points)], corners.reshape(keys.shape), chart)

    def joined(self, pairs: IntArray) -> ChartLayout:
        """Return the layout with pairs of points (k, 2) merged into the point with the smallest index."""
        return ChartLayout(
            self.points, same_points(len(self.points), pairs)[self.corners], self.chart, self.seams
        )

    def renumbered(self) -> ChartLayout:
        """Return the layout without unused points and with charts numbered from 0."""
        indices, corners = numbered(self.corners)
        return ChartLayout(self.points[indices], corners, numbered(self.chart)[1], self.seams)


def numbered(values: IntArray) -> tuple[IntArray, IntArray]:
    """Return the sorted distinct values, small integers from 0, and the index of each value among them."""
    is_used = mask_of(int(values.max()) + 1, values)
    return np.flatnonzero(is_used), (np.cumsum(is_used) - 1)[values]


def same_points(count: int, pairs: IntArray) -> IntArray:
    """Return (count,) for each point the smallest index among the points that pairs (k, 2) merge with it."""
    representative = np.arange(count)
    merged, index = np.unique(pairs, return_inverse=True)
    _, label = label_components(len(merged), *index.reshape(-1, 2).T)
    _, first = np.unique(label, return_index=True)
    representative[merged] = merged[first[label]]
    return representative


class Seams:
    """The inner edges whose two sides have different points.

    Attributes:
        edges: (k,) edge indices in the mesh.
        first_points, second_points: (k, 2) the points at the two ends of each edge, in the faces of its first and
            second half-edge.
        charts: (k, 2) the charts of these two faces.
    """

    def __init__(self, mesh: TriangleMesh, layout: ChartLayout) -> None:
        self.edges = point_seams(mesh, layout.corners, layout.seams)
        self.first_points, self.second_points = both_sides(mesh, self.edges, layout.corners)
        self.charts = layout.chart[mesh.edge_halfedges[self.edges] // 3]

    def within(self, *charts: int) -> IntArray:
        """Return the indices of the seam edges whose two sides are both in the given charts."""
        return np.flatnonzero(np.isin(self.charts, charts).all(axis=1))

    def coinciding(self, places: NDArray[np.complex128], chosen: IntArray, tolerance: float) -> IntArray:
        """Return (k, 2) pairs of points at the ends of chosen edges whose two sides coincide.

        Args:
            places: (u,) positions of all points as complex numbers.
            chosen: indices of seam edges.
            tolerance: largest distance of coinciding points, relative to the length of the edge.
        """
        first_places, second_places = places[self.first_points[chosen]], places[self.second_points[chosen]]
        gap = np.abs(first_places - second_places).max(axis=1, initial=0.0)
        coincides = gap <= tolerance * np.abs(first_places[:, 1] - first_places[:, 0])
        return np.stack(
            [self.first_points[chosen][coincides].ravel(), self.second_points[chosen][coincides].ravel()],
            axis=1,
        )

    def stretches(self, mesh: TriangleMesh) -> IntArray:
        """Return (k,) the stretch of each edge: a chain of seam edges between the same two charts, without branches."""
        at = mesh.edges[self.edges].ravel()
        low, high = self.charts.min(axis=1), self.charts.max(axis=1)
        order = np.argsort(at, kind="stable")
        meet = at[order[1:]] == at[order[:-1]]
        before, after = order[:-1][meet] // 2, order[1:][meet] // 2
        goes_on = np.bincount(at, minlength=len(mesh.vertices))[at[order[:-1][meet]]] == 2
        goes_on &= (low[before] == low[after]) & (high[before] == high[after])
        return label_components(len(self.edges), before[goes_on], after[goes_on])[1]
