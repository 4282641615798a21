"""From flattened components to one result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from .._arrays import FloatArray, IntArray, rows_of
from ..atlas import part_touching
from ..atlas.arrange import arrange_charts
from ..atlas.chart_seams import numbered
from ..atlas.mirrored import ChartMirrors, mirrors_of
from ..geometry.overlap import Overlaps
from ..geometry.planar import sides_between
from ..input.numbering import result_numbering, turn_corners
from ..input.polygons import Polygons
from ..input.split_file import CutTriangles, cut_file
from ..layout.convex import make_convex
from ..mesh import TriangleMesh
from ..options import CONED, Options, settings
from ..progress import Stages
from ..quality.distortion import Distortion, curvature_errors, measure
from ..quality.rotations import Rotations, measure_rotations
from ..quality.statistics import SolveStatistics
from .flattening import Flattening
from .promises import broken_promises
from .symmetry import mirror_symmetry

if TYPE_CHECKING:
    from ..flat import LaidOut
    from ..input.components import Prepared
    from ..input.mesh_file import MeshFile

# Of the longest side in the plane: how far one side of a model is off the other that it lies on, so that readers who
# join what is within a millionth of a side see two charts, not one that is folded.
# And at least so much of the texture, far above the rounding of 32-bit numbers, far below a texel.
APART, LEAST_APART = 4e-6, 1e-6
POLYGONS_LOST = "The refinement has its own triangles: polygons, groups and materials are not kept."


@dataclass(frozen=True, eq=False)
class _Numbering:
    """The vertices of the result: those of the input as it numbers them, then those that were added.

    Attributes:
        positions: (r, 3).
        vertex_origin: (r,) the vertex of the input, -1 for those that a refinement added.
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
        checked: (m,) the face of the checked mesh.
        face_origin: (m,) the face of the input.
    """

    order: IntArray | None
    faces: IntArray
    checked: IntArray
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


def assemble(
    prepared: Prepared,
    laid_out: Sequence[LaidOut],
    options: Options,
    stages: Stages,
    overlaps: Overlaps | None = None,
) -> Flattening:
    """Arrange the pieces in the unit square, number everything as in the input, and measure.

    Args:
        prepared: the input.
        laid_out: its flattened components.
        options, stages: what the result tells about itself.
        overlaps: of its triangles; None where they are to be found.
    """
    checked = prepared.checked
    numbering = _number_vertices(prepared, laid_out)
    triangles = _sort_triangles(prepared, laid_out, numbering)
    mesh = _known_or_new(checked.mesh, np.ldexp(numbering.positions, checked.exponent), triangles.faces)
    with stages("pack"):
        mirrors = [mirrors_of(one) for one in laid_out]
        layout = _pack(laid_out, mirrors, triangles, numbering.positions, mesh, options)
    source, face_corners = _polygons(prepared, laid_out, numbering, triangles)
    if face_corners is not None and source is not None:
        polygons = Polygons(source.offsets, face_corners)
        with stages("polygons"):
            in_space = rows_of(numbering.positions, triangles.faces)
            uv = make_convex(layout.uv, layout.corners, polygons, in_space)
            layout = replace(layout, uv=uv)
    curvature = _curvature(prepared, laid_out, numbering, options)
    cones = numbering.renumber([one.cones for one in laid_out])
    with stages("measure"):
        layout, distortion = _measure(prepared, laid_out, mesh, layout, curvature, cones, options, overlaps)
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
        seconds=dict(stages.seconds),
        notes=(
            *checked.notes,
            *prepared.notes,
            *dict.fromkeys(note for one in laid_out for note in one.notes),
            *[POLYGONS_LOST] * (source is not None and face_corners is None),
        ),
        settings=settings(options),
        solve=SolveStatistics.of_all(
            [one.statistics for one in laid_out], [one.area if len(laid_out) > 1 else 1.0 for one in laid_out]
        ),
        rotations=rotations,
        symmetry=tuple(
            found
            for one, charts in zip(laid_out, mirrors, strict=True)
            if (found := mirror_symmetry(one, charts.off, checked.exponent)) is not None
        ),
        vertex_origin=numbering.vertex_origin,
        face_origin=triangles.face_origin,
        face_corners=face_corners,
        source=source,
        lengths=None if prepared.own_lengths is None else np.ldexp(prepared.own_lengths, -checked.exponent),
    )
    return replace(result, notes=(*result.notes, *broken_promises(result)))


def _polygons(
    prepared: Prepared, laid_out: Sequence[LaidOut], numbering: _Numbering, triangles: _Triangles
) -> tuple[MeshFile | None, IntArray | None]:
    """Return the file with the polygons of the result, and its polygon corner at each triangle corner, if there is one.

    Where a few triangles were cut, the file is one with their pieces. A refinement of everything has no polygons, nor
    has one of the scene of a glTF file.
    """
    given, checked = prepared.given, prepared.checked
    source, is_cut = given.source, any(one.cuts is not None for one in laid_out)
    if source is None or given.face_corners is None:
        return source, None
    corners = turn_corners(checked, given.face_corners)
    if not is_cut:
        return source, corners
    if source.scene is not None or any(one.statistics.refined_triangles for one in laid_out):
        return source, None
    added = [
        np.arange(len(part.vertices), len(one.mesh.vertices))
        for part, one in zip(prepared.components, laid_out, strict=True)
    ]
    none = np.empty((0, 2))
    vertices = numbering.renumber(added)
    cut = CutTriangles(
        faces=triangles.faces,
        origin=triangles.checked,
        origin_faces=numbering.of_checked[checked.mesh.faces][triangles.checked],
        origin_corners=corners[triangles.checked],
        added=vertices,
        ends=numbering.renumber(
            [none.astype(np.int64) if one.cuts is None else one.cuts.ends for one in laid_out]
        ),
        weights=np.concatenate([none if one.cuts is None else one.cuts.weights for one in laid_out]),
        positions=numbering.positions[vertices],
    )
    return cut_file(source, cut, numbering.vertex_origin)


def _number_vertices(prepared: Prepared, laid_out: Sequence[LaidOut]) -> _Numbering:
    """Return the numbers of vertices; those that a refinement added come last."""
    checked, points = prepared.checked, np.asarray(prepared.given.vertices, dtype=np.float64)
    number, vertex_origin = result_numbering(checked, len(points))
    of_parts, blocks, count = [], [points[vertex_origin]], len(vertex_origin)
    for part, one in zip(prepared.components, laid_out, strict=True):
        added = one.mesh.vertices[len(part.vertices) :]
        of_parts.append(np.concatenate([number[part.vertices], np.arange(count, count + len(added))]))
        blocks.append(np.ldexp(added, -checked.exponent))
        count += len(added)
    vertex_origin = np.concatenate([vertex_origin, np.full(count - len(vertex_origin), -1)])
    return _Numbering(np.concatenate(blocks), vertex_origin, number, of_parts)


def _sort_triangles(prepared: Prepared, laid_out: Sequence[LaidOut], numbering: _Numbering) -> _Triangles:
    """Return the triangles of all components in the order of the input's faces."""
    origin = np.concatenate(
        [part.faces[one.face_origin] for part, one in zip(prepared.components, laid_out, strict=True)]
    )
    faces = numbering.renumber([one.mesh.faces for one in laid_out])
    order = None
    if not (origin[1:] >= origin[:-1]).all():
        order = np.argsort(origin, kind="stable")
        faces, origin = rows_of(faces, order), origin[order]
    return _Triangles(order, faces, origin, prepared.checked.face_origin[origin])


def _pack(
    laid_out: Sequence[LaidOut],
    mirrors: Sequence[ChartMirrors],
    triangles: _Triangles,
    positions: FloatArray,
    mesh: TriangleMesh,
    options: Options,
) -> _Layout:
    """Return the charts of all components, packed."""
    points, own, chart, component, lies_on = _all_charts(laid_out)
    corners = triangles.sorted(own)
    # What lies on other points is not packed.
    is_whole = np.array_equal(lies_on, np.arange(len(lies_on)))
    below = slice(None) if is_whole else (lies_on[corners] == corners).all(axis=1)
    of_all, of_below = numbered(triangles.sorted(chart)[below], int(chart.max()) + 1)
    packed = arrange_charts(
        rows_of(points, corners[below]),
        of_below,
        component[of_all],
        None if options.up is None else rows_of(positions, triangles.faces[below]),
        resolution=options.resolution,
        padding=options.padding,
        tiles=options.tiles,
        up=options.up,
        quantum=options.quantise,
        mirrors=mirrors if is_whole else (),
        edge_halfedges=mesh.edge_halfedges if is_whole else None,
    )
    uv = np.empty_like(points)
    # Both coordinates at once: so NumPy is several times as fast.
    uv.view(np.complex128)[:, 0][corners[below]] = packed.corner_uv.view(np.complex128)[..., 0]
    if not is_whole:
        uv = _laid_on(uv, lies_on, max(APART * _longest_side(packed.corner_uv), LEAST_APART))
    return _Layout(uv, corners, own, packed.scale, packed.efficiency)


def _curvature(
    prepared: Prepared, laid_out: Sequence[LaidOut], numbering: _Numbering, options: Options
) -> _Curvature:
    """Return the curvature wanted, prescribed and missed."""
    target = numbering.spread([one.target for one in laid_out])
    prescribed = numbering.spread([_prescribed(one, options) for one in laid_out])
    # What was opened there has several copies of a vertex.
    prescribed[numbering.of_checked[prepared.seams]] = np.nan
    return _Curvature(target, prescribed, target - numbering.spread([one.curvature for one in laid_out]))


def _measure(
    prepared: Prepared,
    laid_out: Sequence[LaidOut],
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
    is_meant = any(one.lies_on is not None for one in laid_out)
    if options.charts == "atlas" and distortion.overlapping_pairs and not is_meant:
        parted, left = part_touching(layout.uv, layout.corners)
        if len(left.pairs) < distortion.overlapping_pairs:
            return replace(layout, uv=parted), measured(parted[layout.corners], overlaps=left)
    return layout, distortion


def _rotations(laid_out: Sequence[LaidOut], corner_uv: FloatArray, options: Options) -> Rotations | None:
    """Return the rotations of seams against the quantum, if there is one; those between components turn freely.

    corner_uv: (m, 3, 2) points of the triangle corners, component after component.
    """
    if options.quantise is None:
        return None
    flat = np.split(corner_uv, np.cumsum([len(one.corners) for one in laid_out])[:-1])
    return Rotations.of_all(
        measure_rotations(one.mesh, own, options.quantise) for one, own in zip(laid_out, flat, strict=True)
    )


def _prescribed(one: LaidOut, options: Options) -> FloatArray:
    """Return (n,) the curvature that vertices are to have in the plane, NaN where none is prescribed."""
    is_free = one.mesh.is_boundary_vertex & (not options.prescribes_boundary)
    if options.method not in CONED:
        is_free[one.seams] = True
    return np.where(is_free, np.nan, one.target)


def _known_or_new(known: TriangleMesh, positions: FloatArray, faces: IntArray) -> TriangleMesh:
    """Return a mesh, with the edges of the known one if it is that: they have been found."""
    is_known = len(known.vertices) == len(positions) and np.array_equal(known.faces, faces)
    return known.moved_to(positions) if is_known else TriangleMesh(positions, faces)


def _all_charts(laid_out: Sequence[LaidOut]) -> tuple[FloatArray, IntArray, IntArray, IntArray, IntArray]:
    """Return the points, corners and charts of all components, numbered one after the other.

    And (k,) the component of each chart, and the point that each lies on.
    """
    corners, charts, component, points, count = [], [], [], 0, 0
    lies_on = []
    for i, one in enumerate(laid_out):
        chart = np.zeros(len(one.corners), dtype=np.int64) if one.chart is None else one.chart
        corners.append(one.corners + points)
        lies_on.append(points + (np.arange(len(one.points)) if one.lies_on is None else one.lies_on))
        charts.append(chart + count)
        component += [i] * (int(chart.max()) + 1)
        points, count = points + len(one.points), count + int(chart.max()) + 1
    every = np.concatenate([one.points for one in laid_out])
    of_charts = np.array(component, dtype=np.int64)
    return every, np.concatenate(corners), np.concatenate(charts), of_charts, np.concatenate(lies_on)


def _laid_on(uv: FloatArray, lies_on: IntArray, apart: float) -> FloatArray:
    """Return points (u, 2) of which some lie on others, but for a little, inside the texture."""
    placed = uv[lies_on]
    inside = apart if placed.max() + apart <= np.ceil(placed.max()) else -apart
    return np.asarray(placed + inside * (lies_on != np.arange(len(uv)))[:, None])


def _longest_side(corner_uv: FloatArray) -> float:
    return float(np.abs(sides_between(corner_uv)).max())
