"""Quantities on a mesh that are shown by colours, and their colour scales."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from .._arrays import FloatArray, IntArray
from ..errors import OptionError
from ..geometry import angle_defect, corner_angles, edge_lengths
from ..geometry.triangles import double_areas
from ..mesh import TriangleMesh
from ..quality.distortion import quantile

if TYPE_CHECKING:
    from matplotlib.cm import ScalarMappable

    from ..result.flattening import Flattening

LEAST_QC_RANGE = 0.05
"""A colour scale shorter than this would show noise as if it were distortion."""

LEAST_STRETCH = 1.05
"""The same for factors of scale."""

UNDEFINED_COLOR = (0.6, 0.6, 0.6)
"""Of what has no value: triangles without area, vertices of the boundary."""

ROUND_FACTORS = (1.0, 1.01, 1.02, 1.05, 1.1, 1.2, 1.5, 2.0, 3.0, 5.0, 10.0, 100.0)


@dataclass(frozen=True)
class ColorScale:
    """A map from numbers to colours.

    Attributes:
        low, high: what the first and the last colour stand for; beyond them nothing changes. Of a signed logarithm,
            the smallest and the largest amount.
        colors: name of a colour map of matplotlib; in a page, "sequential" or "diverging".
        kind: "linear"; "log", where equal factors are equal steps; "signed log", which is so to both sides of a
            middle where less than `low` is zero.
        ticks: numbers to be marked, and what to write there.
    """

    low: float
    high: float
    colors: str
    kind: str
    ticks: tuple[tuple[float, str], ...]

    def position(self, values: FloatArray) -> FloatArray:
        """Return where numbers are on the scale, 0 at its low end and 1 at its high one; NaN of NaN."""
        low, high = self.low, self.high
        if self.kind == "signed log":
            amount = np.clip(np.abs(values), low, high)
            return np.asarray(0.5 + np.sign(values) * 0.5 * np.log(amount / low) / np.log(high / low))
        values = np.clip(values, low, high)
        if self.kind == "log":
            low, high, values = np.log(low), np.log(high), np.log(values)
        return np.asarray((values - low) / (high - low))

    def rgb(self, values: FloatArray) -> FloatArray:
        """Return the colours (..., 3) of numbers, grey of NaN."""
        from matplotlib import colormaps

        position = self.position(values)
        colors = np.asarray(colormaps[self.colors](np.nan_to_num(position)))[..., :3]
        colors[np.isnan(position)] = UNDEFINED_COLOR
        return colors

    def mappable(self) -> ScalarMappable:
        """Return what `Figure.colorbar` of matplotlib makes a colour bar of."""
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import LogNorm, Normalize

        return ScalarMappable(
            (LogNorm if self.kind == "log" else Normalize)(self.low, self.high), self.colors
        )


@dataclass(frozen=True, eq=False)
class Quantity:
    """Numbers on a mesh, and how to show them.

    Attributes:
        label: what they are.
        values: (k,) one for each triangle, or for each of some points; NaN where there is none.
        weights: (k,) how much each counts in percentiles.
        scale: the colours.
        form: how to write one, as `format` takes it.
        corners: (m, 3) of numbers at points, that of each triangle corner; of numbers of triangles None.
    """

    label: str
    values: FloatArray
    weights: FloatArray
    scale: ColorScale
    form: str
    corners: IntArray | None = None

    def colors(self) -> FloatArray:
        """Return the colours (m, 3) of the triangles, or (m, 3, 3) of their corners."""
        colors = self.scale.rgb(self.values)
        return colors if self.corners is None else colors[self.corners]

    def counted(self) -> tuple[FloatArray, FloatArray]:
        """Return the numbers that there are, and their weights."""
        known = np.isfinite(self.values) & (self.weights > 0.0)
        return self.values[known], self.weights[known]

    def percentile(self, percent: float) -> float:
        """Return the number below which lie so many per cent of the weight."""
        return quantile(*self.counted(), percent / 100)

    def text(self, percent: float) -> str:
        """Return this number as it is to be written."""
        value = self.percentile(percent)
        return "0" if value == 0.0 else format(value, self.form)

    def recolored(self, colors: str | None) -> Quantity:
        """Return the same in another colour map of matplotlib; None for its own.

        Raises:
            OptionError: there is no such colour map.
        """
        if colors is None:
            return self
        check_color_map(colors)
        return replace(self, scale=replace(self.scale, colors=colors))


def conformal_distortion(result: Flattening) -> Quantity:
    """Return the quasi-conformal distortion of every triangle."""
    qc, areas = result.distortion.qc, _areas(result)
    top = qc_top(qc, areas)
    ticks = [(float(x), f"{x:.4g}") for x in np.linspace(1.0, top, 3)]
    scale = ColorScale(1.0, top, "viridis_r", "linear", tuple(ticks))
    return Quantity("QC distortion", qc, areas, scale, ".3f")


def stretch(result: Flattening) -> Quantity:
    """Return by how much lengths of every triangle are scaled, over the mean."""
    log_scale, areas = result.distortion.log_area_scale, _areas(result)
    known = np.isfinite(log_scale)
    mean = np.average(log_scale[known], weights=areas[known]) if known.any() else 0.0
    factor = np.exp(log_scale - mean)
    extreme = quantile(np.abs(log_scale[known] - mean), areas[known], 0.95) if known.any() else 0.0
    reached = max(float(np.exp(extreme)), LEAST_STRETCH) * (1 - 1e-9)
    top = next((each for each in ROUND_FACTORS if each >= reached), reached)
    ticks = ((1 / top, f"{1 / top:.3g}"), (1.0, "1"), (top, f"{top:.3g}"))
    return Quantity("Scale", factor, areas, ColorScale(1 / top, top, "PuOr_r", "log", ticks), ".3f")


def curvature(result: Flattening, flat: bool) -> Quantity:
    """Return how much the angles around each vertex miss a full turn, on the model or in the flat metric.

    Cones, which keep their curvature, do not count in percentiles.
    """
    values = missing_angles(result, flat)
    counts = np.isfinite(values).astype(np.float64)
    if flat:
        counts[result.cones] = 0.0
    ticks = tuple((10.0**k, f"$10^{{{k}}}$") for k in (-15, -10, -5, 0))
    scale = ColorScale(1e-16, 1.0, "YlGnBu", "log", ticks)
    label = "|K| after, cones aside" if flat else "|K| before"
    return Quantity(label, np.abs(values), counts, scale, ".1e", result.faces)


def missing_angles(result: Flattening, flat: bool, mesh: TriangleMesh | None = None) -> FloatArray:
    """Return (n,) by how much the angles around each vertex miss a full turn, radians; NaN on the boundary.

    Args:
        result: which tells.
        flat: those of the metric, before it is laid out: in the plane no angle is ever missing but where it was cut.
        mesh: that of the result, where its borders have been found already.
    """
    mesh = TriangleMesh(result.vertices, result.faces) if mesh is None else mesh
    inside = np.zeros(len(mesh.vertices), dtype=bool)
    inside[mesh.faces] = True
    inside &= ~mesh.is_boundary_vertex
    if flat:
        values = -result.curvature_residual
        values[result.cones] += result.curvatures
    else:
        angles = corner_angles(edge_lengths(mesh.vertices, mesh.faces))
        values = angle_defect(mesh.faces, angles, mesh.is_boundary_vertex)
    return np.where(inside, values, np.nan)


def qc_top(qc: FloatArray, weights: FloatArray) -> float:
    """Return the upper end of the colour scale: the 95th percentile rounded up, at least 1.05."""
    finite = np.isfinite(qc)
    excess = quantile(qc[finite], weights[finite], 0.95) - 1.0 if finite.any() else 0.0
    step = LEAST_QC_RANGE if excess < 0.5 else 0.5
    # Less a little: a percentile at a step, up to rounding, stays there.
    return 1.0 + max(float(np.ceil(excess / step - 1e-9)) * step, LEAST_QC_RANGE)


def _areas(result: Flattening) -> FloatArray:
    return double_areas(edge_lengths(result.vertices, result.faces)) / 2


def check_color_map(name: str) -> None:
    """Raise OptionError if matplotlib has no such colour map."""
    from matplotlib import colormaps

    if name not in colormaps:
        raise OptionError(f"matplotlib has no colour map {name!r}; try viridis, cividis or magma")
