"""Quantities on a mesh that are shown by colours, the user's own among them, and their colour scales."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING
from zipfile import BadZipFile

import numpy as np

from ... import TriangleMesh
from ...base import FloatArray, IntArray, shown
from ...errors import MeshFileError, OptionError
from ...geometry import angle_defect, corner_angles, double_areas, edge_lengths
from ...measure import quantile

if TYPE_CHECKING:
    from ... import Flattening


#: A colour scale of factors that is shorter would show noise as if it were distortion.
LEAST_RANGE = 0.05


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
        """Return the colours (..., 3) of numbers; grey of NaN: triangles without area, vertices of the boundary."""
        from matplotlib import colormaps

        position = self.position(values)
        colors = np.asarray(colormaps[self.colors](np.nan_to_num(position)))[..., :3]
        colors[np.isnan(position)] = 0.6
        return colors


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
    finite = np.isfinite(qc)
    excess = quantile(qc[finite], areas[finite], 0.95) - 1.0 if finite.any() else 0.0
    step = LEAST_RANGE if excess < 0.5 else 0.5
    # The percentile rounded up, less a little: one at a step, up to rounding, stays there.
    top = 1.0 + max(float(np.ceil(excess / step - 1e-9)) * step, LEAST_RANGE)
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
    reached = max(float(np.exp(extreme)), 1 + LEAST_RANGE) * (1 - 1e-9)
    rounded = (1.05, 1.1, 1.2, 1.5, 2.0, 3.0, 5.0, 10.0, 100.0)
    top = next((each for each in rounded if each >= reached), reached)
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


def _areas(result: Flattening) -> FloatArray:
    return double_areas(edge_lengths(result.vertices, result.faces)) / 2


def check_color_map(name: str) -> None:
    """Raise OptionError if matplotlib has no such colour map."""
    from matplotlib import colormaps

    if name not in colormaps:
        raise OptionError(f"matplotlib has no colour map {name!r}; try viridis, cividis or magma")


def own_quantity(result: Flattening, name: str, archive: Path | None = None) -> Quantity:
    """Return numbers of the user's own, with a scale: from dark to light, or to both sides of 0 where there are both.

    Args:
        result: on which they are shown.
        name: of a property of the vertices in the mesh's file (PLY); of an array in the result's archive; a file .npy;
            or a file and an array in it, FILE.npz:NAME. There is one for each vertex, or for each triangle, of the
            result or of the input.
        archive: the .npz file that the result was read from, if any.

    Raises:
        OptionError: there is no such property, or its numbers do not fit the mesh.
        MeshFileError: the file cannot be read.
    """
    if not isinstance(name, str):
        raise OptionError(f"color must be the name of a property, or of a file, not {shown(name)}")
    label, values = _named(result, name, archive)
    if values.dtype.kind not in "fiub" or values.ndim != 1:
        raise OptionError(
            f"{label}: colours are made of one number for each vertex or triangle, not of an array of shape "
            f"{values.shape} and type {values.dtype}"
        )
    values, corners = _fitted(result, label, values.astype(np.float64))
    values = np.where(np.isfinite(values), values, np.nan)
    if corners is None:
        weights = _areas(result)
    else:
        weights = np.bincount(corners.ravel(), minlength=len(values)).astype(np.float64)
    known = np.isfinite(values) & (weights > 0)
    if not known.any():
        raise OptionError(f"{label} has no finite number on this mesh to be shown")
    return Quantity(label, values, weights, _scale(values[known], weights[known]), ".4g", corners)


def _named(result: Flattening, name: str, archive: Path | None) -> tuple[str, FloatArray]:
    """Return what numbers are called, and the numbers."""
    properties = {} if result.source is None else result.source.properties
    if name in properties:
        return name, np.asarray(properties[name])
    path, _, array = name.rpartition(":") if ".npz:" in name.lower() else (name, "", "")
    if Path(path).suffix.lower() in (".npy", ".npz"):
        return array or Path(path).stem, _read(Path(path), array)
    if archive is not None:
        return name, _read(archive, name)
    has = "it has " + ", ".join(properties) if properties else "it has none"
    raise OptionError(f"the mesh has no property {shown(name)} at its vertices to take colours from; {has}")


def _read(path: Path, array: str) -> FloatArray:
    try:
        found = np.load(path, allow_pickle=False)
        if isinstance(found, np.ndarray):
            return found
        with found:
            if array in found.files:
                return np.asarray(found[array])
            has = ", ".join(found.files) or "none"
    except (OSError, ValueError, TypeError, EOFError, BadZipFile) as error:
        raise MeshFileError(f"cannot read numbers from {path}: {' '.join(str(error).split())}") from error
    raise OptionError(f"{path} has no array {shown(array)}: it has {has}")


def _fitted(result: Flattening, label: str, values: FloatArray) -> tuple[FloatArray, IntArray | None]:
    """Return numbers of the result's vertices and the corners' indices into them; or of its triangles and None."""
    count, origin = len(values), result.vertex_origin
    inputs = -1 if result.source is None else len(result.source.vertices)
    if origin is not None and count == inputs:
        return values[origin], result.faces
    if count == len(result.vertices):
        return values, result.faces
    if count == len(result.faces):
        return values, None
    raise OptionError(
        f"{label} has {count:,} numbers, which fits neither the {len(result.vertices):,} vertices nor the "
        f"{len(result.faces):,} triangles of the mesh"
    )


def _scale(values: FloatArray, weights: FloatArray) -> ColorScale:
    low, high = quantile(values, weights, 0.01), quantile(values, weights, 0.99)
    is_signed = low < 0 < high
    if is_signed:
        high = max(-low, high)
        low = -high
    elif low == high:
        reach = 0.5 * (abs(low) or 1.0)
        low, high = low - reach, high + reach
    # By halves, so that the largest numbers do not overflow.
    ticks = tuple((x, f"{x:.3g}") for x in (low, low / 2 + high / 2, high))
    return ColorScale(low, high, "PuOr_r" if is_signed else "viridis_r", "linear", ticks)
