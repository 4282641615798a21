"""What a layout tells of the metric that it has, for methods that do not say."""

from __future__ import annotations

import numpy as np

from .._arrays import FloatArray, IntArray
from ..cones import ConeSolution
from ..figures import SolveFigures
from ..geometry import double_areas, edge_lengths
from ..geometry.planar import signed_double_areas
from ..mesh import TriangleMesh
from .base import LaidOut, all_faces, laid_out_curvature

# Areas below so much of the mean are taken as so much, where a logarithm is wanted.
TINY = 1e-12


def laid_out_at(
    points: FloatArray,
    mesh: TriangleMesh,
    disk: TriangleMesh,
    seams: IntArray,
    solution: ConeSolution,
    figures: SolveFigures | None = None,
    notes: tuple[str, ...] = (),
) -> LaidOut:
    """Return a layout of a mesh's own triangles, at the mesh's area, with the scale and curvature that it has.

    Args:
        points: (c, 2) of the disk's vertices, at any scale, not upside down.
        mesh: connected.
        disk: the mesh cut open.
        seams: (k,) the edges along which it was cut.
        solution: the cones and what was asked of them.
        figures, notes: how it was found, and what falls short.
    """
    corners = points[disk.faces]
    doubles = np.abs(signed_double_areas(corners))
    before = double_areas(edge_lengths(mesh.vertices, mesh.faces))
    factor = float(np.sqrt(before.sum() / doubles.sum()))
    curvature = laid_out_curvature(mesh, corners)
    return LaidOut(
        mesh=mesh,
        face_origin=all_faces(mesh),
        points=points * factor,
        corners=disk.faces,
        cones=solution.cones,
        seams=mesh.edges[seams],
        log_scale=_log_scale(mesh, before, doubles * factor**2),
        # The boundary is free: what comes out there is what was wanted.
        target=np.where(mesh.is_boundary_vertex, curvature, solution.target),
        curvature=curvature,
        figures=SolveFigures() if figures is None else figures,
        notes=notes,
    )


def _log_scale(mesh: TriangleMesh, before: FloatArray, after: FloatArray) -> FloatArray:
    """Return (n,) half the log of the ratio of areas around each vertex."""
    ratio = []
    for areas in (before, after):
        around = np.bincount(mesh.faces.ravel(), np.repeat(areas, 3), minlength=len(mesh.vertices))
        ratio.append(np.maximum(around, TINY * around.mean()))
    log_scale: FloatArray = np.log(ratio[1] / ratio[0]) / 2
    return log_scale
