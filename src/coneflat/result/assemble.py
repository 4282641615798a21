"""From flattened components to one result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from .._arrays import FloatArray, IntArray
from ..atlas import part_touching
from ..atlas.arrange import arrange_charts
from ..input.numbering import result_numbering, turn_corners
from ..input.polygons import Polygons
from ..layout.convex import make_convex
from ..mesh import TriangleMesh
from ..options import CONED, Options, settings
from ..progress import Stages
from ..quality.distortion import curvature_errors, measure
from ..quality.rotations import Rotations, measure_rotations
from ..quality.statistics import SolveStatistics
from .flattening import Flattening
from .promises import broken_promises

if TYPE_CHECKING:
    from ..flat import LaidOut
    from ..input.components import Component, Prepared


POLYGONS_LOST = (
    "The refinement has triangles of its own: polygons, groups and materials of the file are not kept."
)


def assemble(prepared: Prepared, laid_out: Sequence[LaidOut], options: Options, stages: Stages) -> Flattening:
    """Arrange the pieces in the unit square, number everything as in the input, and measure.

    Args:
        prepared: the input.
        laid_out: its flattened components.
        options, stages: what the result tells about itself.
    """
    given, checked, parts = prepared.given, prepared.checked, prepared.components
    points = np.asarray(given.vertices, dtype=np.float64)
    number, vertex_origin = result_numbering(checked, len(points))
    numbers, positions = _number_vertices(number, points[vertex_origin], parts, laid_out, checked.exponent)
    face_origin = np.concatenate(
        [part.faces[one.face_origin] for part, one in zip(parts, laid_out, strict=True)]
    )
    order = np.argsort(face_origin, kind="stable")
    faces = np.concatenate([ids[one.mesh.faces] for ids, one in zip(numbers, laid_out, strict=True)])[order]

    with stages("pack"):
        points, corners, chart, component = _all_charts(laid_out)
        own, corners, chart = corners, corners[order], chart[order]
        packed = arrange_charts(
            points[corners],
            chart,
            component,
            positions[faces],
            resolution=options.resolution,
            padding=options.padding,
            tiles=options.tiles,
            up=options.up,
            quantum=options.quantise,
        )
        uv = np.empty_like(points)
        uv[corners] = packed.corner_uv

    refined = any(one.statistics.refined_triangles for one in laid_out)
    face_corners = (
        None if refined or given.face_corners is None else turn_corners(checked, given.face_corners)
    )
    if face_corners is not None and given.source is not None:
        with stages("polygons"):
            uv = make_convex(uv, corners, Polygons(given.source.offsets, face_corners), positions[faces])

    def spread(values: Sequence[FloatArray]) -> FloatArray:
        every = np.full(len(positions), np.nan)
        for ids, value in zip(numbers, values, strict=True):
            every[ids] = value
        return every

    target = spread([one.target for one in laid_out])
    prescribed = spread([_prescribed(one, options) for one in laid_out])
    # What was opened there has several copies of a vertex.
    prescribed[number[prepared.seams]] = np.nan
    residual = target - spread([one.curvature for one in laid_out])
    cones = np.concatenate([ids[one.cones] for ids, one in zip(numbers, laid_out, strict=True)])
    with stages("measure"):
        scaled = _known_or_new(checked.mesh, np.ldexp(positions, checked.exponent), faces)
        errors = curvature_errors(residual[np.isfinite(residual)])
        measured = partial(measure, scaled, curvature_error=errors, cones=cones, prescribed=prescribed)
        distortion = measured(uv[corners])
        if options.charts == "atlas" and distortion.overlapping_pairs:
            parted, overlaps = part_touching(uv, corners)
            if len(overlaps.pairs) < distortion.overlapping_pairs:
                uv, distortion = parted, measured(parted[corners], overlaps=overlaps)
        rotations = _rotations(laid_out, uv[own], options)
    result = Flattening(
        vertices=positions,
        faces=faces,
        uv=uv,
        uv_faces=corners,
        uv_scale=float(np.ldexp(packed.scale, checked.exponent)),
        packing_efficiency=packed.efficiency,
        cones=cones,
        curvatures=target[cones],
        log_scale=spread([one.log_scale for one in laid_out]),
        prescribed=prescribed,
        curvature_residual=residual,
        seams=np.concatenate(
            [number[prepared.seams], *(ids[one.seams] for ids, one in zip(numbers, laid_out, strict=True))]
        ),
        distortion=distortion.rescaled(checked.exponent * np.log(2)),
        seconds=dict(stages.seconds),
        notes=(
            *checked.notes,
            *prepared.notes,
            *_distinct_notes(laid_out),
            *[POLYGONS_LOST] * (refined and given.source is not None),
        ),
        settings=settings(options),
        solve=SolveStatistics.of_all(
            [one.statistics for one in laid_out], [one.area if len(laid_out) > 1 else 1.0 for one in laid_out]
        ),
        rotations=rotations,
        vertex_origin=np.concatenate([vertex_origin, np.full(len(positions) - len(vertex_origin), -1)]),
        face_origin=checked.face_origin[face_origin[order]],
        face_corners=face_corners,
        source=given.source,
    )
    return replace(result, notes=(*result.notes, *broken_promises(result)))


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
    """Return a mesh, the known one if it is that: its edges have been found."""
    if np.array_equal(known.faces, faces) and np.array_equal(known.vertices, positions):
        return known
    return TriangleMesh(positions, faces)


def _distinct_notes(laid_out: Sequence[LaidOut]) -> tuple[str, ...]:
    """Return the notes on all components, each once."""
    return tuple(dict.fromkeys(note for one in laid_out for note in one.notes))


def _all_charts(laid_out: Sequence[LaidOut]) -> tuple[FloatArray, IntArray, IntArray, IntArray]:
    """Return the points, corners and charts of all components, numbered one after the other.

    And (k,) the component of each chart.
    """
    corners, charts, component, points, count = [], [], [], 0, 0
    for i, one in enumerate(laid_out):
        chart = np.zeros(len(one.corners), dtype=np.int64) if one.chart is None else one.chart
        corners.append(one.corners + points)
        charts.append(chart + count)
        component += [i] * (int(chart.max()) + 1)
        points, count = points + len(one.points), count + int(chart.max()) + 1
    every = np.concatenate([one.points for one in laid_out])
    return every, np.concatenate(corners), np.concatenate(charts), np.array(component, dtype=np.int64)


def _number_vertices(
    number: IntArray,
    positions: FloatArray,
    parts: Sequence[Component],
    laid_out: Sequence[LaidOut],
    exponent: int,
) -> tuple[list[IntArray], FloatArray]:
    """Return the number in the result of each vertex of each component, and the positions of all.

    Vertices that a refinement added come last.
    """
    numbers, blocks, count = [], [positions], len(positions)
    for part, one in zip(parts, laid_out, strict=True):
        added = one.mesh.vertices[len(part.vertices) :]
        numbers.append(np.concatenate([number[part.vertices], np.arange(count, count + len(added))]))
        blocks.append(np.ldexp(added, -exponent))
        count += len(added)
    return numbers, np.concatenate(blocks)
