"""Charts as given: triangles in the plane, and which chart each is of."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import FloatArray, IntArray, as_floats
from ..errors import ArrayShapeError, NonFiniteError, OptionError
from .outline import Outlines, find_outlines

# Of the area, relative to the square of the extent: less is a line, but for rounding.
NO_AREA = 1e-6


@dataclass(frozen=True, eq=False)
class Charts:
    """m triangles of k charts.

    Attributes:
        corners: (m, 3) as complex numbers u + iv.
        chart: (m,) chart of each triangle, from 0.
        count: k; every chart has a triangle.
    """

    corners: NDArray[np.complex128]
    chart: IntArray
    count: int

    @cached_property
    def areas(self) -> FloatArray:
        """(m,) signed areas of the triangles."""
        one, two = self.corners[:, 1] - self.corners[:, 0], self.corners[:, 2] - self.corners[:, 0]
        return (np.conj(one) * two).imag / 2

    def sums(self, values: FloatArray) -> FloatArray:
        """Return (k,) the sum of values of triangles over each chart."""
        sums: FloatArray = np.bincount(self.chart, weights=values, minlength=self.count).astype(np.float64)
        return sums

    @cached_property
    def has_area(self) -> NDArray[np.bool_]:
        """(k,) False for charts that are lines or points."""
        extent = np.zeros((2, self.count))
        for part, of in zip(extent, (self.corners.real, self.corners.imag), strict=True):
            low, high = np.full(self.count, np.inf), np.full(self.count, -np.inf)
            one, two, three = of.T
            np.minimum.at(low, self.chart, np.minimum(np.minimum(one, two), three))
            np.maximum.at(high, self.chart, np.maximum(np.maximum(one, two), three))
            part[:] = high - low
        return np.abs(self.sums(self.areas)) > NO_AREA * extent.max(axis=0) ** 2

    def outlines(self) -> Outlines:
        """Return the outline of each chart."""
        return find_outlines(self.corners, self.areas < 0, self.chart, self.count)

    def moved(
        self, factors: NDArray[np.complex128], shifts: NDArray[np.complex128] | None = None
    ) -> FloatArray:
        """Return (m, 3, 2) corners times the complex factor of each chart, plus its shift."""
        moved = self.corners * factors[self.chart][:, None]
        if shifts is not None:
            moved += shifts[self.chart][:, None]
        return moved.view(np.float64).reshape(-1, 3, 2)


def read_charts(corner_uv: ArrayLike, chart_of_triangle: ArrayLike | None) -> Charts:
    """Return checked charts.

    Raises:
        ArrayShapeError, NonFiniteError, OptionError: as in `pack_charts`.
    """
    uv = as_floats("corner_uv", corner_uv)
    if uv.ndim != 3 or uv.shape[1:] != (3, 2) or not len(uv):
        raise ArrayShapeError(f"corner_uv has shape {uv.shape}, not (triangles, 3, 2)")
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
            f"chart_of_triangle has shape {chart.shape} and type {chart.dtype}, not one whole number for each "
            f"of {len(uv):,} triangles"
        )
    triangles = np.bincount(chart) if chart.min() >= 0 and chart.max() < len(chart) else np.zeros(1)
    if not triangles.all():
        raise OptionError(
            f"chart_of_triangle must count charts from 0 without gaps: it has {len(np.unique(chart)):,} different "
            f"numbers from {chart.min()} to {chart.max()}"
        )
    charts = Charts(uv.view(np.complex128)[..., 0], chart.astype(np.int64), len(triangles))
    total = charts.sums(charts.areas)
    mirrored = np.flatnonzero((total < 0) & charts.has_area)
    if len(mirrored):
        raise OptionError(
            f"{len(mirrored):,} of {charts.count:,} charts are mirrored, the first is {mirrored[0]} "
            f"with area {total[mirrored[0]]:.3g}: turn them over before they are packed"
        )
    return charts
