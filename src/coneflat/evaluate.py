"""Assembly of the result from the layouts of all components: numbering, packing and measures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from .atlas import arrange_charts, separate_touching
from .base.arrays import FloatArray, IntArray, rows_of
from .base.notes import counted_notes
from .base.progress import stage, stage_seconds
from .geometry.overlap import Overlaps
from .measures.distortion import Distortion, curvature_errors, measure
from .measures.guarantees import unmet_guarantees
from .measures.seam_data import Rotations, measure_rotations
from .mesh.connectivity import TriangleMesh
from .options import Options, settings
from .result import Flattening
from .source.input_mesh import reorder_corners, result_numbering
from .stages import SolveStatistics

if TYPE_CHECKING:
    from .source.components import Prepared
    from .stages import Layout


@dataclass(frozen=True, eq=False)
class _Numbering:
    """The r vertices of the result: those of the input in its order, then the vertices that a repair added.

    Attributes:
        positions: (r, 3).
        vertex_origin: (r,) the input vertex of each.
        of_checked: (n,) the index in the result of each vertex of the checked mesh.
        of_components: the index in the result of each vertex, for each component.
    """

    positions: FloatArray
    vertex_origin: IntArray
    of_checked: IntArray
    of_components: list[IntArray]

    def spread(self, values: Sequence[FloatArray]) -> FloatArray:
        """Return (r,) the values of all components at the vertices of the result, NaN at unused vertices."""
        spread = np.full(len(self.positions), np.nan)
        for vertices, component_values in zip(self.of_components, values, strict=True):
            spread[vertices] = component_values
        return spread

    def renumber(self, vertices: Sequence[IntArray]) -> IntArray:
        """Return the indices in the result of vertices of the components, concatenated by component."""
        return np.concatenate(
            [numbers[indices] for numbers, indices in zip(self.of_components, vertices, strict=True)]
        )


@dataclass(frozen=True, eq=False)
class _Packed:
    """The charts in the unit square.

    Attributes:
        uv: (u, 2) points.
        corners: (m, 3) the point of each triangle corner, in the order of the result.
        component_corners: (m, 3) the same, concatenated by component.
        scale: UV units per unit of length of the checked mesh.
        efficiency: covered fraction of the square.
    """

    uv: FloatArray
    corners: IntArray
    component_corners: IntArray
    scale: float
    efficiency: float


def evaluate(
    prepared: Prepared,
    layouts: Sequence[Layout],
    options: Options,
    overlaps: Overlaps | None = None,
    notes: Sequence[str] = (),
) -> Flattening:
    """Return the result of a flattening: packed, in the input's numbering, measured, with notes on unmet guarantees.

    Args:
        prepared: the input.
        layouts: the layouts of its components.
        options: the options; the result records them.
        overlaps: overlapping pairs of the result's triangles; None to compute them.
        notes: further notes.
    """
    checked = prepared.checked
    with stage("pack"):
        numbering, order, mesh = _result_mesh(prepared)
        packed = _pack(layouts, order, mesh, options)
    with stage("measure"):
        curvatures = _Curvatures.of(prepared, layouts, numbering)
        cones = numbering.renumber([layout.cones for layout in layouts])
        packed, distortion = _separated_and_measured(
            prepared, mesh, cones, curvatures, packed, options, overlaps
        )
        rotations = _rotations(layouts, packed, options)
        statistics = _statistics(layouts)
        face_corners = _face_corners(prepared)
    lengths = prepared.user_lengths
    result = Flattening(
        vertices=numbering.positions,
        faces=mesh.faces,
        uv=packed.uv,
        uv_faces=packed.corners,
        uv_scale=float(np.ldexp(packed.scale, checked.exponent)),
        packing_efficiency=packed.efficiency,
        cones=cones,
        curvatures=curvatures.target[cones],
        log_scale=numbering.spread([layout.log_scale for layout in layouts]),
        prescribed=curvatures.prescribed,
        curvature_residual=curvatures.residual,
        seams=_seams(prepared, layouts, numbering),
        distortion=distortion.rescaled(checked.exponent * np.log(2)),
        seconds=stage_seconds(),
        notes=(*checked.notes, *prepared.notes, *counted_notes([layout.notes for layout in layouts]), *notes),
        settings=settings(options),
        solve=statistics,
        rotations=rotations,
        vertex_origin=numbering.vertex_origin,
        face_origin=checked.face_origin[np.sort(_component_faces(prepared))],
        face_corners=face_corners,
        source=prepared.input_mesh.source,
        lengths=None if lengths is None else np.ldexp(lengths, -checked.exponent),
    )
    return replace(result, notes=(*result.notes, *unmet_guarantees(result, mesh=mesh)))


def _component_faces(prepared: Prepared) -> IntArray:
    """Return (m,) the triangles of the checked mesh that are in the result, concatenated by component."""
    return np.concatenate([component.faces for component in prepared.components])


def _face_corners(prepared: Prepared) -> IntArray | None:
    """Return (m, 3) the polygon corner at each corner of the result's triangles, or None if the input has none."""
    input_mesh = prepared.input_mesh
    if input_mesh.face_corners is None or input_mesh.source is None:
        return input_mesh.face_corners
    return reorder_corners(prepared.checked, input_mesh.face_corners)


def _seams(prepared: Prepared, layouts: Sequence[Layout], numbering: _Numbering) -> IntArray:
    """Return (k, 2) the seams, as pairs of vertices of the result: the marked ones first."""
    layout_seams = numbering.renumber([layout.seams for layout in layouts])
    return np.concatenate([numbering.of_checked[prepared.seams], layout_seams])


def _statistics(layouts: Sequence[Layout]) -> SolveStatistics:
    """Return the statistics of all components, means weighted by their areas."""
    weights = [layout.area if len(layouts) > 1 else 1.0 for layout in layouts]
    return SolveStatistics.of_all([layout.statistics for layout in layouts], weights)


@dataclass(frozen=True, eq=False)
class _Curvatures:
    """Curvatures at the r vertices of the result, radians, NaN at unused vertices.

    Attributes:
        target: (r,) target curvature.
        residual: (r,) target minus curvature of the flat metric.
        prescribed: (r,) prescribed curvature in the plane, NaN where none is prescribed.
    """

    target: FloatArray
    residual: FloatArray
    prescribed: FloatArray

    @classmethod
    def of(cls, prepared: Prepared, layouts: Sequence[Layout], numbering: _Numbering) -> _Curvatures:
        """Return the curvatures of the layouts of all components."""
        target = numbering.spread([layout.target for layout in layouts])
        residual = target - numbering.spread([layout.curvature for layout in layouts])
        prescribed = numbering.spread([layout.prescribed for layout in layouts])
        # A vertex on a marked seam has several copies in the plane.
        prescribed[numbering.of_checked[prepared.seams]] = np.nan
        return cls(target, residual, prescribed)


def _separated_and_measured(
    prepared: Prepared,
    mesh: TriangleMesh,
    cones: IntArray,
    curvatures: _Curvatures,
    packed: _Packed,
    options: Options,
    overlaps: Overlaps | None,
) -> tuple[_Packed, Distortion]:
    """Return the charts and their measures; in an atlas, triangles that overlap by rounding alone are separated.

    Args:
        prepared, mesh, cones, curvatures: the input, and the mesh of the result with its cones and curvatures.
        packed: the charts.
        options, overlaps: as of `evaluate`.
    """
    residual = curvatures.residual
    measure_places = partial(
        measure,
        mesh,
        curvature_error=curvature_errors(residual[np.isfinite(residual)]),
        cones=cones,
        prescribed=curvatures.prescribed,
        lengths=prepared.user_lengths,
    )
    distortion = measure_places(rows_of(packed.uv, packed.corners), overlaps=overlaps)
    if options.charts == "atlas" and distortion.overlapping_pairs:
        separated, remaining = separate_touching(packed.uv, packed.corners)
        if len(remaining.pairs) < distortion.overlapping_pairs:
            packed = replace(packed, uv=separated)
            distortion = measure_places(separated[packed.corners], overlaps=remaining)
    return packed, distortion


def packed_scale(prepared: Prepared, layouts: Sequence[Layout], options: Options) -> Callable[[int], float]:
    """Return the function from a resolution to the `uv_scale` that `evaluate` packs charts with.

    The function raises OptionError if the padding leaves no space for charts.
    """
    _, order, mesh = _result_mesh(prepared)

    def scale_at(resolution: int) -> float:
        packed = _pack(layouts, order, mesh, replace(options, resolution=resolution))
        return float(np.ldexp(packed.scale, prepared.checked.exponent))

    return scale_at


def _result_mesh(prepared: Prepared) -> tuple[_Numbering, IntArray, TriangleMesh]:
    """Return the numbering of the result's vertices, (m,) the triangles of all components in its order, and its mesh.

    Triangles are sorted in the order of the input's faces.
    """
    checked, numbering = prepared.checked, _number_vertices(prepared)
    order = np.argsort(_component_faces(prepared), kind="stable")
    faces = rows_of(numbering.renumber([component.mesh.faces for component in prepared.components]), order)
    points = np.ldexp(numbering.positions, checked.exponent)
    return numbering, order, _with_connectivity(checked.mesh, points, faces)


def _number_vertices(prepared: Prepared) -> _Numbering:
    """Return the numbering of the result's vertices."""
    points = np.asarray(prepared.input_mesh.vertices, dtype=np.float64)
    number, vertex_origin = result_numbering(prepared.checked, len(points))
    of_components = [number[component.vertices] for component in prepared.components]
    return _Numbering(points[vertex_origin], vertex_origin, number, of_components)


def _pack(layouts: Sequence[Layout], order: IntArray, mesh: TriangleMesh, options: Options) -> _Packed:
    """Return the packed charts of all components."""
    points, component_corners, chart, component = _all_charts(layouts)
    corners = rows_of(component_corners, order)
    heights = None if options.up is None else mesh.vertices[mesh.faces] @ options.up
    packed = arrange_charts(
        rows_of(points, corners),
        chart[order],
        component,
        heights,
        resolution=options.resolution,
        padding=options.padding,
        tiles=options.tiles,
        block_size=options.block_size,
        quantum=options.quantise,
        edge_halfedges=mesh.edge_halfedges,
    )
    uv = np.empty_like(points)
    # Assigning both coordinates as one complex number is several times as fast in NumPy.
    uv.view(np.complex128)[:, 0][corners] = packed.corner_uv.view(np.complex128)[..., 0]
    return _Packed(uv, corners, component_corners, packed.scale, packed.efficiency)


def _rotations(layouts: Sequence[Layout], packed: _Packed, options: Options) -> Rotations | None:
    """Return how far seam rotations within components are from multiples of the quantum; None without a quantum."""
    if options.quantise is None:
        return None
    corner_uv = rows_of(packed.uv, packed.component_corners)
    places_of_components = np.split(corner_uv, np.cumsum([len(layout.corners) for layout in layouts])[:-1])
    return Rotations.of_all(
        [
            measure_rotations(layout.mesh, places, options.quantise)
            for layout, places in zip(layouts, places_of_components, strict=True)
        ]
    )


def _with_connectivity(checked: TriangleMesh, positions: FloatArray, faces: IntArray) -> TriangleMesh:
    """Return a mesh of positions and faces; reuse the connectivity of the checked mesh if the faces are equal."""
    is_equal = len(checked.vertices) == len(positions) and np.array_equal(checked.faces, faces)
    return checked.moved_to(positions) if is_equal else TriangleMesh(positions, faces)


def _all_charts(layouts: Sequence[Layout]) -> tuple[FloatArray, IntArray, IntArray, IntArray]:
    """Return the points, corners and charts of all components, concatenated, and (k,) the component of each chart."""
    chart_counts = [int(layout.chart.max()) + 1 for layout in layouts]
    first_charts = np.cumsum([0, *chart_counts])
    first_points = np.cumsum([0, *(len(layout.points) for layout in layouts)])
    points = np.concatenate([layout.points for layout in layouts])
    corners = [layout.corners + first for layout, first in zip(layouts, first_points, strict=False)]
    charts = [layout.chart + first for layout, first in zip(layouts, first_charts, strict=False)]
    components = np.arange(len(layouts)).repeat(chart_counts)
    return points, np.concatenate(corners), np.concatenate(charts), components
