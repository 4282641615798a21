"""Quantities on a mesh that are shown as colours, also values given by the user, and their colour scales."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING
from zipfile import BadZipFile

import numpy as np

from ... import TriangleMesh
from ...base import FloatArray, IntArray, mask_of, short_repr
from ...errors import MeshFileError, OptionError
from ...geometry import angle_defect, corner_angles, double_areas, edge_lengths
from ...io import VALUES, read_vertex_values
from ...measures import quantile
from ...options import as_number
from .palettes import check_color_map, color_table

if TYPE_CHECKING:
    from ... import Flattening


#: Least range of a colour scale of factors; a shorter one would show noise as distortion.
MIN_RANGE = 0.05
#: Ends of the colour scale of strains; the smallest one is below what can be measured on cloth or paper.
STRAIN_ENDS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.03, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
#: Largest end of a colour scale; 32-bit numbers of pages have room for its square.
MAX_END = 1e15


@dataclass(frozen=True)
class ColorScale:
    """A map from numbers to colours.

    Attributes:
        low, high: numbers of the first and the last colour; numbers outside are clamped. For a signed logarithm, the
            smallest and the largest absolute value.
        colors: "sequential", "diverging" or, in figures, a colour map of matplotlib; see `color_table`.
        kind: "linear", "log", or "signed log": logarithmic in the absolute value, with opposite signs to both sides of
            the middle, where absolute values below `low` are mapped.
        ticks: numbers to be marked, with their labels.
    """

    low: float
    high: float
    colors: str
    kind: str
    ticks: tuple[tuple[float, str], ...]

    def position(self, values: FloatArray) -> FloatArray:
        """Return the positions of numbers on the scale, from 0 at the low end to 1 at the high end; NaN for NaN."""
        low, high = self.low, self.high
        if self.kind == "signed log":
            amount = np.clip(np.abs(values), low, high)
            return np.asarray(0.5 + np.sign(values) * 0.5 * np.log(amount / low) / np.log(high / low))
        values = np.clip(values, low, high)
        if self.kind == "log":
            low, high, values = np.log(low), np.log(high), np.log(values)
        return np.asarray((values - low) / (high - low))

    def rgb(self, values: FloatArray) -> FloatArray:
        """Return the (..., 3) colours of numbers; grey for NaN: triangles without area, boundary vertices."""
        position = self.position(values)
        table = color_table(self.colors)
        # As in matplotlib, each colour of the table has an equal part of the scale.
        rows = np.minimum((np.nan_to_num(position) * len(table)).astype(np.int64), len(table) - 1)
        return np.where(np.isnan(position)[..., None], 0.6, table[rows])


@dataclass(frozen=True, eq=False)
class Quantity:
    """Numbers on a mesh, with their colour scale and text format.

    Attributes:
        label: name of the quantity.
        values: (k,) numbers, one for each triangle or point; NaN if undefined.
        weights: (k,) weights in percentiles.
        scale: the colour scale.
        form: text format of a number, as of `format`.
        corners: (m, 3) index of the number at each triangle corner; None if there is one number for each triangle.
    """

    label: str
    values: FloatArray
    weights: FloatArray
    scale: ColorScale
    form: str
    corners: IntArray | None = None

    def colors(self) -> FloatArray:
        """Return the (m, 3) colours of the triangles, or the (m, 3, 3) colours of their corners."""
        colors = self.scale.rgb(self.values)
        return colors if self.corners is None else colors[self.corners]

    def counted(self) -> tuple[FloatArray, FloatArray]:
        """Return the defined numbers with positive weight, and their weights."""
        is_counted = np.isfinite(self.values) & (self.weights > 0.0)
        return self.values[is_counted], self.weights[is_counted]

    def percentile(self, percent: float) -> float:
        """Return the number below which the given percentage of the weight lies."""
        return quantile(*self.counted(), percent / 100)

    def text(self, percent: float) -> str:
        """Return the text of this number."""
        value = self.percentile(percent)
        return "0" if value == 0.0 else format(value, self.form)

    def recolored(self, colors: str | None) -> Quantity:
        """Return the quantity with another colour map of matplotlib; None keeps its own.

        Raises:
            OptionError: there is no such colour map.
        """
        if colors is None:
            return self
        check_color_map(colors)
        return replace(self, scale=replace(self.scale, colors=colors))


@dataclass(frozen=True)
class Ranges:
    """Ends of colour scales; None for ends that fit the values.

    Attributes:
        qc_max: QC distortion at the end of the scale, above 1.
        scale_max: scale at the end of the scale, above 1; at its beginning is the reciprocal.

    Raises:
        OptionError: an end is not above 1.
    """

    qc_max: float | None = None
    scale_max: float | None = None

    def __post_init__(self) -> None:
        for name, value in (("qc_max", self.qc_max), ("scale_max", self.scale_max)):
            if value is not None and not 1.0 < as_number(name, value) <= MAX_END:
                raise OptionError(f"{name} must be above 1 and at most {MAX_END:g}, got {value:g}")


def conformal_distortion(result: Flattening, qc_max: float | None = None) -> Quantity:
    """Return the quasi-conformal distortion of every triangle; qc_max: the end of the scale, if it is given."""
    qc, areas = result.distortion.qc, _areas(result)
    finite = np.isfinite(qc)
    excess = quantile(qc[finite], areas[finite], 0.95) - 1.0 if finite.any() else 0.0
    step = MIN_RANGE if excess < 0.5 else 0.5
    # The percentile is rounded up, with a tolerance for percentiles at a step.
    top = 1.0 + max(float(np.ceil(excess / step - 1e-9)) * step, MIN_RANGE) if qc_max is None else qc_max
    ticks = [(float(x), f"{x:.4g}") for x in np.linspace(1.0, top, 3)]
    scale = ColorScale(1.0, top, "sequential", "linear", tuple(ticks))
    return Quantity("QC distortion", qc, areas, scale, ".3f")


def stretch(result: Flattening, scale_max: float | None = None) -> Quantity:
    """Return the scale factor of lengths in every triangle, divided by the mean.

    scale_max: the end of the scale, if it is given.
    """
    log_scale, areas = result.distortion.log_area_scale, _areas(result)
    is_known = np.isfinite(log_scale)
    mean = np.average(log_scale[is_known], weights=areas[is_known]) if is_known.any() else 0.0
    factor = np.exp(log_scale - mean)
    extreme = quantile(np.abs(log_scale[is_known] - mean), areas[is_known], 0.95) if is_known.any() else 0.0
    reached = max(float(np.exp(extreme)), 1 + MIN_RANGE) * (1 - 1e-9)
    rounded = (1.05, 1.1, 1.2, 1.5, 2.0, 3.0, 5.0, 10.0, 100.0)
    top = next((limit for limit in rounded if limit >= reached), reached) if scale_max is None else scale_max
    ticks = ((1 / top, f"{1 / top:.3g}"), (1.0, "1"), (top, f"{top:.3g}"))
    return Quantity("Scale", factor, areas, ColorScale(1 / top, top, "diverging", "log", ticks), ".3f")


def largest_strain(result: Flattening, strain: FloatArray | None = None) -> Quantity:
    """Return the relative change of length of the side of every triangle that changes most.

    Args:
        result: the flattening.
        strain: (m,) the changes; by default those of its measures, see `Distortion`.
    """
    strain = result.distortion.strain if strain is None else strain
    areas, is_known = _areas(result), np.isfinite(strain)
    reached = quantile(np.abs(strain[is_known]), areas[is_known], 0.95) if is_known.any() else 0.0
    top = next((limit for limit in STRAIN_ENDS if limit >= reached * (1 - 1e-9)), STRAIN_ENDS[-1])
    ticks = ((-top, f"\N{MINUS SIGN}{100 * top:.3g}%"), (0.0, "0"), (top, f"+{100 * top:.3g}%"))
    return Quantity("Strain", strain, areas, ColorScale(-top, top, "diverging", "linear", ticks), "+.2%")


def curvature(result: Flattening, flat: bool) -> Quantity:
    """Return the absolute angle defect of every vertex, on the model or in the flat metric.

    In the flat metric, cones are excluded from percentiles.
    """
    values = angle_defects(result, flat)
    counts = np.isfinite(values).astype(np.float64)
    if flat:
        counts[result.cones] = 0.0
    ticks = tuple((10.0**k, f"$10^{{{k}}}$") for k in (-15, -10, -5, 0))
    scale = ColorScale(1e-16, 1.0, "sequential", "log", ticks)
    label = "|K| after, without cones" if flat else "|K| before"
    return Quantity(label, np.abs(values), counts, scale, ".1e", result.faces)


def angle_defects(result: Flattening, flat: bool, mesh: TriangleMesh | None = None) -> FloatArray:
    """Return the (n,) angle defects in radians: 2 pi minus the angle sum; NaN on the boundary.

    Args:
        result: the flattening.
        flat: whether to return those of the flat metric before layout; in the plane they are zero except at cuts.
        mesh: the mesh of the result, if its boundary has been computed already.
    """
    mesh = TriangleMesh(result.vertices, result.faces) if mesh is None else mesh
    inside = mask_of(len(mesh.vertices), mesh.faces)
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


def own_quantity(result: Flattening, name: str, archive: Path | None = None) -> Quantity:
    """Return values given by the user as a quantity; its scale is diverging if they have both signs.

    Args:
        result: the flattening on which they are shown.
        name: name of a vertex property in the file of the mesh (PLY) or of an array in `archive`; path of a .npy file,
            or of values of a brain such as lh.sulc; or FILE.npz:NAME. There is one value for each vertex, or for each
            triangle, of the result or of the input.
        archive: the .npz file that the result was read from, if any.

    Raises:
        OptionError: there is no such property, or the number of values does not fit the mesh.
        MeshFileError: the file cannot be read.
    """
    if not isinstance(name, str):
        raise OptionError(f"color must be the name of a property or of a file, got {short_repr(name)}")
    label, values = _named(result, name, archive)
    if values.dtype.kind not in "fiub" or values.ndim != 1:
        raise OptionError(
            f"{label}: expected one number for each vertex or triangle, got an array of shape {values.shape} and type "
            f"{values.dtype}"
        )
    values, corners = _fitted(result, label, values.astype(np.float64))
    values = np.where(np.isfinite(values), values, np.nan)
    if corners is None:
        weights = _areas(result)
    else:
        weights = np.bincount(corners.ravel(), minlength=len(values)).astype(np.float64)
    is_known = np.isfinite(values) & (weights > 0)
    if not is_known.any():
        raise OptionError(f"{label} has no finite number on this mesh")
    return Quantity(label, values, weights, _scale(values[is_known], weights[is_known]), ".4g", corners)


def _named(result: Flattening, name: str, archive: Path | None) -> tuple[str, FloatArray]:
    """Return the label of the numbers, and the numbers."""
    properties = {} if result.source is None else result.source.properties
    if name in properties:
        return name, np.asarray(properties[name])
    path, _, array = name.rpartition(":") if ".npz:" in name.lower() else (name, "", "")
    if Path(path).suffix.lower() in (".npy", ".npz"):
        return array or Path(path).stem, _read(Path(path), array)
    if Path(name).suffix.lower() in VALUES and Path(name).is_file():
        return Path(name).name, read_vertex_values(name)
    if archive is not None:
        return name, _read(archive, name)
    has = "it has " + ", ".join(properties) if properties else "it has none"
    raise OptionError(f"the mesh has no vertex property {short_repr(name)}; {has}")


def _read(path: Path, array: str) -> FloatArray:
    try:
        loaded = np.load(path, allow_pickle=False)
        if isinstance(loaded, np.ndarray):
            return loaded
        with loaded:
            if array in loaded.files:
                return np.asarray(loaded[array])
            has = ", ".join(loaded.files) or "none"
    except (OSError, ValueError, TypeError, EOFError, BadZipFile) as error:
        raise MeshFileError(f"cannot read numbers from {path}: {' '.join(str(error).split())}") from error
    raise OptionError(f"{path} has no array {short_repr(array)}: it has {has}")


def _fitted(result: Flattening, label: str, values: FloatArray) -> tuple[FloatArray, IntArray | None]:
    """Return the numbers of vertices and the (m, 3) indices of corners into them; or those of triangles and None."""
    count, origin = len(values), result.vertex_origin
    inputs = -1 if result.source is None else len(result.source.vertices)
    if origin is not None and count == inputs:
        return values[origin], result.faces
    if count == len(result.vertices):
        return values, result.faces
    if count == len(result.faces):
        return values, None
    if result.source is None and origin is not None and count > origin.max(initial=0):  # from an archive
        return values[origin], result.faces
    raise OptionError(
        f"{label} has {count:,} numbers, but there are {len(result.vertices):,} vertices and "
        f"{len(result.faces):,} triangles"
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
    # Each is halved first, so that the sum of large numbers does not overflow.
    ticks = tuple((x, f"{x:.3g}") for x in (low, low / 2 + high / 2, high))
    return ColorScale(low, high, "diverging" if is_signed else "sequential", "linear", ticks)
