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
from .measures.distortion import curvature_errors, measure
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
        of_parts: the index in the result of each vertex, for each component.
    """

    positions: FloatArray
    vertex_origin: IntArray
    of_checked: IntArray
    of_parts: list[IntArray]

    def spread(self, values: Sequence[FloatArray]) -> FloatArray:
        """Return (r,) the values of all components at the vertices of the result, NaN at unused vertices."""
        every = np.full(len(self.positions), np.nan)
        for ids, value in zip(self.of_parts, values, strict=True):
            every[ids] = value
        return every

    def renumber(self, vertices: Sequence[IntArray]) -> IntArray:
        """Return the indices in the result of vertices of the components, concatenated by component."""
        return np.concatenate([ids[own] for ids, own in zip(self.of_parts, vertices, strict=True)])


@dataclass(frozen=True, eq=False)
class _Packed:
    """The charts in the unit square.

    Attributes:
        uv: (u, 2) points.
        corners: (m, 3) the point of each triangle corner, in the order of the result.
        own: (m, 3) the same, concatenated by component.
        scale: UV units per unit of length of the checked mesh.
        efficiency: covered fraction of the square.
    """

    uv: FloatArray
    corners: IntArray
    own: IntArray
    scale: float
    efficiency: float


def evaluate(
    prepared: Prepared,
    layouts: Sequence[Layout],
    options: Options,
    overlaps: Overlaps | None = None,
) -> Flattening:
    """Return the result of a flattening: packed, in the input's numbering, measured, with notes on unmet guarantees.

    Args:
        prepared: the input.
        layouts: the layouts of its components.
        options: the options; the result records them.
        overlaps: overlapping pairs of the result's triangles; None to compute them.
    """
    checked = prepared.checked
    with stage("pack"):
        numbering, order, mesh = _result_mesh(prepared)
        layout = _pack(layouts, order, mesh, options)
    with stage("measure"):
        source, face_corners = prepared.input_mesh.source, prepared.input_mesh.face_corners
        if face_corners is not None and source is not None:
            face_corners = reorder_corners(checked, face_corners)
        target = numbering.spread([one.target for one in layouts])
        residual = target - numbering.spread([one.curvature for one in layouts])
        prescribed = numbering.spread([one.prescribed for one in layouts])
        # A vertex on a marked seam has several copies in the plane.
        prescribed[numbering.of_checked[prepared.seams]] = np.nan
        cones = numbering.renumber([one.cones for one in layouts])
        measured = partial(
            measure,
            mesh,
            curvature_error=curvature_errors(residual[np.isfinite(residual)]),
            cones=cones,
            prescribed=prescribed,
            lengths=prepared.user_lengths,
        )
        distortion = measured(rows_of(layout.uv, layout.corners), overlaps=overlaps)
        # In an atlas, triangles that overlap by rounding alone are separated.
        if options.charts == "atlas" and distortion.overlapping_pairs:
            separated, left = separate_touching(layout.uv, layout.corners)
            if len(left.pairs) < distortion.overlapping_pairs:
                layout = replace(layout, uv=separated)
                distortion = measured(separated[layout.corners], overlaps=left)
        rotations = _rotations(layouts, layout.uv[layout.own], options)
        combined = SolveStatistics.of_all(
            [one.statistics for one in layouts], [one.area if len(layouts) > 1 else 1.0 for one in layouts]
        )
    result = Flattening(
        vertices=numbering.positions,
        faces=mesh.faces,
        uv=layout.uv,
        uv_faces=layout.corners,
        uv_scale=float(np.ldexp(layout.scale, checked.exponent)),
        packing_efficiency=layout.efficiency,
        cones=cones,
        curvatures=target[cones],
        log_scale=numbering.spread([one.log_scale for one in layouts]),
        prescribed=prescribed,
        curvature_residual=residual,
        seams=np.concatenate(
            [numbering.of_checked[prepared.seams], numbering.renumber([one.seams for one in layouts])]
        ),
        distortion=distortion.rescaled(checked.exponent * np.log(2)),
        seconds=stage_seconds(),
        notes=(
            *checked.notes,
            *prepared.notes,
            *counted_notes([one.notes for one in layouts]),
        ),
        settings=settings(options),
        solve=combined,
        rotations=rotations,
        vertex_origin=numbering.vertex_origin,
        face_origin=checked.face_origin[
            np.sort(np.concatenate([component.faces for component in prepared.components]))
        ],
        face_corners=face_corners,
        source=source,
        lengths=None if prepared.user_lengths is None else np.ldexp(prepared.user_lengths, -checked.exponent),
    )
    return replace(result, notes=(*result.notes, *unmet_guarantees(result)))


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
    origin = np.concatenate([component.faces for component in prepared.components])
    order = np.argsort(origin, kind="stable")
    faces = rows_of(numbering.renumber([component.mesh.faces for component in prepared.components]), order)
    points = np.ldexp(numbering.positions, checked.exponent)
    return numbering, order, _known_or_new(checked.mesh, points, faces)


def _number_vertices(prepared: Prepared) -> _Numbering:
    """Return the numbering of the result's vertices."""
    points = np.asarray(prepared.input_mesh.vertices, dtype=np.float64)
    number, vertex_origin = result_numbering(prepared.checked, len(points))
    of_parts = [number[component.vertices] for component in prepared.components]
    return _Numbering(points[vertex_origin], vertex_origin, number, of_parts)


def _pack(layouts: Sequence[Layout], order: IntArray, mesh: TriangleMesh, options: Options) -> _Packed:
    """Return the packed charts of all components."""
    points, own, chart, component = _all_charts(layouts)
    corners = rows_of(own, order)
    heights = None if options.up is None else mesh.vertices[mesh.faces] @ options.up
    packed = arrange_charts(
        rows_of(points, corners),
        chart[order],
        component,
        heights,
        resolution=options.resolution,
        padding=options.padding,
        tiles=options.tiles,
        quantum=options.quantise,
        edge_halfedges=mesh.edge_halfedges,
    )
    uv = np.empty_like(points)
    # Assigning both coordinates as one complex number is several times as fast in NumPy.
    uv.view(np.complex128)[:, 0][corners] = packed.corner_uv.view(np.complex128)[..., 0]
    return _Packed(uv, corners, own, packed.scale, packed.efficiency)


def _rotations(layouts: Sequence[Layout], corner_uv: FloatArray, options: Options) -> Rotations | None:
    """Return how far seam rotations within components are from multiples of the quantum; None without a quantum.

    corner_uv: (m, 3, 2) points of the triangle corners, concatenated by component.
    """
    if options.quantise is None:
        return None
    flat = np.split(corner_uv, np.cumsum([len(one.corners) for one in layouts])[:-1])
    return Rotations.of_all(
        [measure_rotations(one.mesh, own, options.quantise) for one, own in zip(layouts, flat, strict=True)]
    )


def _known_or_new(known: TriangleMesh, positions: FloatArray, faces: IntArray) -> TriangleMesh:
    """Return a mesh of positions and faces; reuse the connectivity of a known mesh if the faces are equal."""
    is_known = len(known.vertices) == len(positions) and np.array_equal(known.faces, faces)
    return known.moved_to(positions) if is_known else TriangleMesh(positions, faces)


def _all_charts(layouts: Sequence[Layout]) -> tuple[FloatArray, IntArray, IntArray, IntArray]:
    """Return the points, corners and charts of all components, concatenated, and (k,) the component of each chart."""
    corners, charts, component, points, count = [], [], [], 0, 0
    for i, one in enumerate(layouts):
        found = int(one.chart.max()) + 1
        corners.append(one.corners + points)
        charts.append(one.chart + count)
        component += [i] * found
        points, count = points + len(one.points), count + found
    every = np.concatenate([one.points for one in layouts])
    return every, np.concatenate(corners), np.concatenate(charts), np.array(component, dtype=np.int64)
