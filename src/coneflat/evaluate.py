"""From flattened components to one result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from .atlas import arrange_charts, part_touching
from .base.arrays import FloatArray, IntArray, rows_of
from .base.progress import Stopwatch
from .geometry.overlap import Overlaps
from .measure.distortion import Distortion, curvature_errors, measure
from .measure.guarantees import broken_promises
from .measure.seam_data import Rotations, measure_rotations
from .mesh.connectivity import TriangleMesh
from .options import Options, settings
from .result import Flattening
from .source.input_mesh import result_numbering, turn_corners
from .stages import SolveStatistics

if TYPE_CHECKING:
    from .source.parts import Prepared
    from .stages import Layout


@dataclass(frozen=True, eq=False)
class _Numbering:
    """The vertices of the result: those of the input as it numbers them, then those that a repair added.

    Attributes:
        positions: (r, 3).
        vertex_origin: (r,) the vertex of the input.
        of_checked: (n,) the number of each vertex of the checked mesh.
        of_parts: the number of each vertex of each component.
    """

    positions: FloatArray
    vertex_origin: IntArray
    of_checked: IntArray
    of_parts: list[IntArray]

    def spread(self, values: Sequence[FloatArray]) -> FloatArray:
        """Return (r,) values at the vertices of components, NaN at vertices that are of none."""
        every = np.full(len(self.positions), np.nan)
        for ids, value in zip(self.of_parts, values, strict=True):
            every[ids] = value
        return every

    def renumber(self, vertices: Sequence[IntArray]) -> IntArray:
        """Return the numbers of vertices of the components, one component after the other."""
        return np.concatenate([ids[own] for ids, own in zip(self.of_parts, vertices, strict=True)])


@dataclass(frozen=True, eq=False)
class _Triangles:
    """The triangles of the result, in the order of the input's faces.

    Attributes:
        order: (m,) which triangle each is, of those of all components; None where they are in order as they are.
        faces: (m, 3) vertices of the result.
        face_origin: (m,) the face of the input.
    """

    order: IntArray | None
    faces: IntArray
    face_origin: IntArray

    def sorted(self, values: IntArray) -> IntArray:
        """Return values, (m,) or (m, 3), of the triangles of all components in the order of the result."""
        return values if self.order is None else rows_of(values, self.order)


@dataclass(frozen=True, eq=False)
class _Layout:
    """The charts in the unit square.

    Attributes:
        uv: (u, 2) points.
        corners: (m, 3) the point of each triangle corner, in the order of the result.
        own: (m, 3) the same, component after component.
        scale: UV units per unit of length of the checked mesh.
        efficiency: part of the square that is covered.
    """

    uv: FloatArray
    corners: IntArray
    own: IntArray
    scale: float
    efficiency: float


@dataclass(frozen=True, eq=False)
class _Curvature:
    """Curvature at the vertices of the result, radians.

    Attributes:
        target: (r,) what was wanted of the metric.
        prescribed: (r,) what vertices are to have in the plane; NaN where it is free.
        residual: (r,) the target less what was reached.
    """

    target: FloatArray
    prescribed: FloatArray
    residual: FloatArray


def evaluate(
    prepared: Prepared,
    laid_out: Sequence[Layout],
    options: Options,
    watch: Stopwatch,
    overlaps: Overlaps | None = None,
) -> Flattening:
    """Return the result: charts packed, numbered as the input, measured, with a note on each unmet guarantee.

    Args:
        prepared: the input.
        laid_out: the layouts of its parts.
        options, watch: what the result tells about itself.
        overlaps: of its triangles; None where they are to be found.
    """
    checked = prepared.checked
    numbering = _number_vertices(prepared)
    triangles = _sort_triangles(prepared, numbering)
    mesh = _known_or_new(checked.mesh, np.ldexp(numbering.positions, checked.exponent), triangles.faces)
    with watch("pack"):
        layout = _pack(laid_out, triangles, numbering.positions, mesh, options)
    source, face_corners = prepared.given.source, prepared.given.face_corners
    if face_corners is not None and source is not None:
        face_corners = turn_corners(checked, face_corners)
    curvature = _curvature(prepared, laid_out, numbering)
    cones = numbering.renumber([one.cones for one in laid_out])
    with watch("measure"):
        layout, distortion = _measure(prepared, mesh, layout, curvature, cones, options, overlaps)
        rotations = _rotations(laid_out, layout.uv[layout.own], options)
    result = Flattening(
        vertices=numbering.positions,
        faces=triangles.faces,
        uv=layout.uv,
        uv_faces=layout.corners,
        uv_scale=float(np.ldexp(layout.scale, checked.exponent)),
        packing_efficiency=layout.efficiency,
        cones=cones,
        curvatures=curvature.target[cones],
        log_scale=numbering.spread([one.log_scale for one in laid_out]),
        prescribed=curvature.prescribed,
        curvature_residual=curvature.residual,
        seams=np.concatenate(
            [numbering.of_checked[prepared.seams], numbering.renumber([one.seams for one in laid_out])]
        ),
        distortion=distortion.rescaled(checked.exponent * np.log(2)),
        seconds=dict(watch.seconds),
        notes=(
            *checked.notes,
            *prepared.notes,
            *dict.fromkeys(note for one in laid_out for note in one.notes),
        ),
        settings=settings(options),
        solve=SolveStatistics.of_all(
            [one.statistics for one in laid_out], [one.area if len(laid_out) > 1 else 1.0 for one in laid_out]
        ),
        rotations=rotations,
        vertex_origin=numbering.vertex_origin,
        face_origin=triangles.face_origin,
        face_corners=face_corners,
        source=source,
        lengths=None if prepared.own_lengths is None else np.ldexp(prepared.own_lengths, -checked.exponent),
    )
    return replace(result, notes=(*result.notes, *broken_promises(result)))


def _number_vertices(prepared: Prepared) -> _Numbering:
    """Return the numbers of vertices."""
    points = np.asarray(prepared.given.vertices, dtype=np.float64)
    number, vertex_origin = result_numbering(prepared.checked, len(points))
    of_parts = [number[part.vertices] for part in prepared.parts]
    return _Numbering(points[vertex_origin], vertex_origin, number, of_parts)


def _sort_triangles(prepared: Prepared, numbering: _Numbering) -> _Triangles:
    """Return the triangles of all components in the order of the input's faces."""
    origin = np.concatenate([part.faces for part in prepared.parts])
    faces = numbering.renumber([part.mesh.faces for part in prepared.parts])
    order = None
    if not (origin[1:] >= origin[:-1]).all():
        order = np.argsort(origin, kind="stable")
        faces, origin = rows_of(faces, order), origin[order]
    return _Triangles(order, faces, prepared.checked.face_origin[origin])


def _pack(
    laid_out: Sequence[Layout],
    triangles: _Triangles,
    positions: FloatArray,
    mesh: TriangleMesh,
    options: Options,
) -> _Layout:
    """Return the charts of all components, packed."""
    points, own, chart, component = _all_charts(laid_out)
    corners = triangles.sorted(own)
    packed = arrange_charts(
        rows_of(points, corners),
        triangles.sorted(chart),
        component,
        None if options.up is None else rows_of(positions, triangles.faces),
        resolution=options.resolution,
        padding=options.padding,
        tiles=options.tiles,
        up=options.up,
        quantum=options.quantise,
        edge_halfedges=mesh.edge_halfedges,
    )
    uv = np.empty_like(points)
    # Both coordinates at once: so NumPy is several times as fast.
    uv.view(np.complex128)[:, 0][corners] = packed.corner_uv.view(np.complex128)[..., 0]
    return _Layout(uv, corners, own, packed.scale, packed.efficiency)


def _curvature(prepared: Prepared, laid_out: Sequence[Layout], numbering: _Numbering) -> _Curvature:
    """Return the curvature wanted, prescribed and missed."""
    target = numbering.spread([one.target for one in laid_out])
    prescribed = numbering.spread([one.prescribed for one in laid_out])
    # What was opened there has several copies of a vertex.
    prescribed[numbering.of_checked[prepared.seams]] = np.nan
    return _Curvature(target, prescribed, target - numbering.spread([one.curvature for one in laid_out]))


def _measure(
    prepared: Prepared,
    mesh: TriangleMesh,
    layout: _Layout,
    curvature: _Curvature,
    cones: IntArray,
    options: Options,
    overlaps: Overlaps | None,
) -> tuple[_Layout, Distortion]:
    """Return the measures of a layout, and the layout, in which triangles of an atlas that only touch are apart."""
    residual = curvature.residual
    measured = partial(
        measure,
        mesh,
        curvature_error=curvature_errors(residual[np.isfinite(residual)]),
        cones=cones,
        prescribed=curvature.prescribed,
        lengths=prepared.own_lengths,
    )
    distortion = measured(rows_of(layout.uv, layout.corners), overlaps=overlaps)
    if options.charts == "atlas" and distortion.overlapping_pairs:
        parted, left = part_touching(layout.uv, layout.corners)
        if len(left.pairs) < distortion.overlapping_pairs:
            return replace(layout, uv=parted), measured(parted[layout.corners], overlaps=left)
    return layout, distortion


def _rotations(laid_out: Sequence[Layout], corner_uv: FloatArray, options: Options) -> Rotations | None:
    """Return the rotations of seams against the quantum, if there is one; those between components turn freely.

    corner_uv: (m, 3, 2) points of the triangle corners, component after component.
    """
    if options.quantise is None:
        return None
    flat = np.split(corner_uv, np.cumsum([len(one.corners) for one in laid_out])[:-1])
    return Rotations.of_all(
        measure_rotations(one.mesh, own, options.quantise) for one, own in zip(laid_out, flat, strict=True)
    )


def _known_or_new(known: TriangleMesh, positions: FloatArray, faces: IntArray) -> TriangleMesh:
    """Return a mesh, with the edges of the known one if it is that: they have been found."""
    is_known = len(known.vertices) == len(positions) and np.array_equal(known.faces, faces)
    return known.moved_to(positions) if is_known else TriangleMesh(positions, faces)


def _all_charts(laid_out: Sequence[Layout]) -> tuple[FloatArray, IntArray, IntArray, IntArray]:
    """Return the points, corners and charts of all components, numbered one after the other.

    And (k,) the component of each chart.
    """
    corners, charts, component, points, count = [], [], [], 0, 0
    for i, one in enumerate(laid_out):
        found = int(one.chart.max()) + 1
        corners.append(one.corners + points)
        charts.append(one.chart + count)
        component += [i] * found
        points, count = points + len(one.points), count + found
    every = np.concatenate([one.points for one in laid_out])
    return every, np.concatenate(corners), np.concatenate(charts), np.array(component, dtype=np.int64)
