"""From flattened components to one result."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ._arrays import IntArray
from .distortion import curvature_errors, measure
from .figures import SolveFigures
from .inputs import InputMesh
from .layout import arrange
from .mesh import TriangleMesh
from .numbering import result_numbering, turn_corners
from .options import Options
from .result import Flattening
from .stages import Stages
from .validation import CheckedMesh

if TYPE_CHECKING:
    from .pipeline import Piece


def assemble(
    given: InputMesh,
    checked: CheckedMesh,
    parts: Sequence[tuple[TriangleMesh, IntArray, IntArray]],
    pieces: Sequence[Piece],
    options: Options,
    stages: Stages,
) -> Flattening:
    """Arrange the pieces in the unit square, number everything as in the input, and measure.

    Args:
        given, checked: the input, and what the check made of it.
        parts: for each component its mesh, and its vertices and faces in the checked mesh.
        pieces: the flattened components.
        options, stages: what the result tells about itself.
    """
    mesh = checked.mesh
    with stages("layout"):
        charts, scale = arrange([piece.points for piece in pieces])
        first = np.cumsum([0] + [len(chart) for chart in charts])
        uv_faces = np.empty_like(mesh.faces)
        for (_, _, faces), piece, start in zip(parts, pieces, first[:-1], strict=True):
            uv_faces[faces] = piece.corners + start
        uv = np.concatenate(charts)

    log_scale, target, curvature = (np.empty(len(mesh.vertices)) for _ in range(3))
    for (_, vertices, _), piece in zip(parts, pieces, strict=True):
        log_scale[vertices] = piece.log_scale
        target[vertices] = piece.target
        curvature[vertices] = piece.curvature
    cones = np.concatenate([v[p.cones] for (_, v, _), p in zip(parts, pieces, strict=True)])
    with stages("measure"):
        distortion = measure(mesh, uv[uv_faces], curvature_errors(target, curvature), cones)

    points = np.asarray(given.vertices, dtype=np.float64)
    number, vertex_origin = result_numbering(checked, len(points))
    every_log_scale, every_residual = np.full((2, len(vertex_origin)), np.nan)
    every_log_scale[number], every_residual[number] = log_scale, target - curvature
    seams = [vertices[piece.seams] for (_, vertices, _), piece in zip(parts, pieces, strict=True)]
    return Flattening(
        vertices=points[vertex_origin],
        faces=number[mesh.faces],
        uv=uv,
        uv_faces=uv_faces,
        uv_scale=scale,
        cones=number[cones],
        curvatures=target[cones],
        log_scale=every_log_scale,
        curvature_residual=every_residual,
        seams=number[np.concatenate(seams)],
        distortion=distortion,
        seconds=dict(stages.seconds),
        notes=checked.notes + tuple(piece.note for piece in pieces if piece.note),
        settings=options.as_dict(),
        solve=SolveFigures.of_all(piece.figures for piece in pieces),
        vertex_origin=vertex_origin,
        face_origin=checked.face_origin,
        face_corners=None if given.face_corners is None else turn_corners(checked, given.face_corners),
        source=given.source,
    )
