"""From flattened components to one result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ._arrays import FloatArray, IntArray
from .atlas import Packed, orient_charts, pack_charts, part_touching
from .distortion import curvature_errors, measure
from .figures import SolveFigures
from .geometry.planar import signed_double_areas
from .mesh import TriangleMesh
from .numbering import result_numbering, turn_corners
from .options import Options
from .result import Flattening
from .rotations import Rotations
from .stages import Stages

if TYPE_CHECKING:
    from .methods import LaidOut
    from .prepare import Component, Prepared


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
        points, corners, chart = _all_charts(laid_out)
        corners, chart = corners[order], chart[order]
        uv, packed = _packed(points, corners, chart, positions[faces], options)

    def spread(values: Sequence[FloatArray]) -> FloatArray:
        every = np.full(len(positions), np.nan)
        for ids, value in zip(numbers, values, strict=True):
            every[ids] = value
        return every

    target = spread([one.target for one in laid_out])
    residual = target - spread([one.curvature for one in laid_out])
    cones = np.concatenate([ids[one.cones] for ids, one in zip(numbers, laid_out, strict=True)])
    with stages("measure"):
        scaled = _known_or_new(checked.mesh, np.ldexp(positions, checked.exponent), faces)
        errors = curvature_errors(residual[np.isfinite(residual)])
        distortion = measure(scaled, uv[corners], errors, cones).rescaled(checked.exponent * np.log(2))
        if options.charts == "atlas" and distortion.overlapping_pairs:
            uv, overlaps = part_touching(uv, corners)
            distortion = replace(distortion, overlap=overlaps.fraction, overlapping_pairs=len(overlaps.pairs))
    refined = any(one.figures.refined_triangles for one in laid_out)
    lost: tuple[str, ...] = ()
    if refined and given.source is not None:
        lost = (
            "The refinement has triangles of its own: polygons, groups and materials of the file are not kept.",
        )
    face_corners = (
        None if refined or given.face_corners is None else turn_corners(checked, given.face_corners)
    )
    return Flattening(
        vertices=positions,
        faces=faces,
        uv=uv,
        uv_faces=corners,
        uv_scale=float(np.ldexp(packed.scale, checked.exponent)),
        packing_efficiency=packed.efficiency,
        cones=cones,
        curvatures=target[cones],
        log_scale=spread([one.log_scale for one in laid_out]),
        curvature_residual=residual,
        seams=np.concatenate(
            [number[prepared.seams], *(ids[one.seams] for ids, one in zip(numbers, laid_out, strict=True))]
        ),
        distortion=distortion,
        seconds=dict(stages.seconds),
        notes=(*checked.notes, *prepared.notes, *_distinct_notes(laid_out), *lost),
        settings=options.as_dict(),
        solve=SolveFigures.of_all(
            [one.figures for one in laid_out], [one.area if len(laid_out) > 1 else 1.0 for one in laid_out]
        ),
        rotations=Rotations.of_all(one.rotations for one in laid_out),
        vertex_origin=np.concatenate([vertex_origin, np.full(len(positions) - len(vertex_origin), -1)]),
        face_origin=checked.face_origin[face_origin[order]],
        face_corners=face_corners,
        source=given.source,
    )


def _known_or_new(known: TriangleMesh, positions: FloatArray, faces: IntArray) -> TriangleMesh:
    """Return a mesh, the known one if it is that: its edges have been found."""
    if np.array_equal(known.faces, faces) and np.array_equal(known.vertices, positions):
        return known
    return TriangleMesh(positions, faces)


def _distinct_notes(laid_out: Sequence[LaidOut]) -> tuple[str, ...]:
    """Return the notes on all components, each once."""
    return tuple(dict.fromkeys(note for one in laid_out for note in one.notes))


def _all_charts(laid_out: Sequence[LaidOut]) -> tuple[FloatArray, IntArray, IntArray]:
    """Return the points, corners and charts of all components, numbered one after the other."""
    corners, charts, points, count = [], [], 0, 0
    for one in laid_out:
        chart = np.zeros(len(one.corners), dtype=np.int64) if one.chart is None else one.chart
        corners.append(one.corners + points)
        charts.append(chart + count)
        points, count = points + len(one.points), count + int(chart.max()) + 1
    return np.concatenate([one.points for one in laid_out]), np.concatenate(corners), np.concatenate(charts)


def _packed(
    points: FloatArray, corners: IntArray, chart: IntArray, space: FloatArray, options: Options
) -> tuple[FloatArray, Packed]:
    """Return the points with the charts in their places in the texture, and what came of it.

    space: (m, 3, 3) the triangles' corners on the model.
    """
    flat, rotate = _upright(points[corners], chart), "any"
    if options.up is not None:
        flat, rotate = orient_charts(flat, chart, corners=space, up=options.up), "none"
    packed = pack_charts(
        flat,
        chart,
        resolution=options.resolution,
        padding=options.padding,
        tiles=options.tiles,
        rotate=rotate,
    )
    uv = np.empty_like(points)
    uv[corners] = packed.corner_uv
    return uv, packed


def _upright(flat: FloatArray, chart: IntArray) -> FloatArray:
    """Return (m, 3, 2) charts, those turned over of which more area is upside down than not."""
    is_mirrored = np.bincount(chart, weights=signed_double_areas(flat)) < 0
    if is_mirrored.any():
        flat[is_mirrored[chart], :, 1] *= -1
    return flat


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
