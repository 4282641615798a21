"""UVs that a file has, as a flattening that pages and figures show."""

from __future__ import annotations

import numpy as np

from ...base import unit_exponent
from ...errors import MeshFileError, MissingUVError
from ...geometry import double_areas, edge_lengths
from ...io import Joined, Mapped, cell_side, of_file
from ...measure import angle_sum_errors, as_rows
from ...mesh import uv_seams
from ...result import Flattening
from ...stages import SolveStatistics
from ..measure_uv import measure_mapped, uv_points

#: The `method` in the settings of what was not made but found in the file.
OWN = "the file's own UVs"
#: UVs that pages, whose numbers have 32 bits, and pictures can show: squares of larger ones are none.
LARGEST = 1e15
#: Rows of a report that say nothing of a map that no search for cones has led to.
_OF_A_SEARCH = ("cones", "curvature error", "of the metric")


def own_flattening(source: Joined, *, strict: bool = False) -> Flattening | None:
    """Return the UVs that a file has as a flattening; None if no triangle has any.

    Triangles without UVs are left out, with a note, and so is nothing else: what is not manifold is repaired.

    Raises:
        MeshError: the triangles are not a mesh.
        MeshFileError: UVs are too large to be shown.
    """
    try:
        return flattening_of(of_file(source), strict=strict)
    except MissingUVError:
        return None


def flattening_of(mapped: Mapped, *, strict: bool = False) -> Flattening:
    """Return a map as a flattening without cones, whose curvature residuals are those of the plane it makes.

    Raises:
        MissingUVError: no triangle has UVs.
        MeshError: the triangles are not a mesh.
        MeshFileError: UVs are too large to be shown.
    """
    measured = measure_mapped(mapped, strict=strict)
    largest = float(np.abs(measured.corner_uv).max())
    if largest > LARGEST:
        raise MeshFileError(
            f"UVs of up to {largest:.3g} are too large to be shown: `coneflat measure` measures them, --again flattens "
            "the mesh anew"
        )
    mesh = measured.mesh
    uv, uv_faces = uv_points(mesh, measured.corner_uv)
    exponent = unit_exponent(mesh.vertices)
    area = float(double_areas(edge_lengths(np.ldexp(mesh.vertices, -exponent), mesh.faces)).sum()) / 2
    scale = cell_side(uv, uv_faces, 1.0) / np.sqrt(area) if area > 0 else float("nan")
    return Flattening(
        vertices=mesh.vertices,
        faces=mesh.faces,
        uv=uv,
        uv_faces=uv_faces,
        uv_scale=float(np.ldexp(scale, -exponent)),
        packing_efficiency=measured.counts["packing_efficiency"],
        cones=np.empty(0, dtype=np.int64),
        curvatures=np.empty(0),
        log_scale=np.full(len(mesh.vertices), np.nan),
        prescribed=np.full(len(mesh.vertices), np.nan),
        curvature_residual=angle_sum_errors(mesh, measured.corner_uv, np.zeros(len(mesh.vertices)))[0],
        seams=mesh.edges[uv_seams(mesh, measured.corner_uv)],
        distortion=measured.distortion,
        seconds={},
        notes=measured.notes,
        settings={"method": OWN},
        solve=SolveStatistics(),
        source=mapped.source,
    )


def is_own(result: Flattening) -> bool:
    """Return whether a flattening is what a file had."""
    return getattr(result, "settings", {}).get("method") == OWN


def shown_rows(result: Flattening) -> list[tuple[str, str, str]]:
    """Return the rows of a result's report that say something of it."""
    return [row for row in as_rows(result) if not (is_own(result) and row[0] in _OF_A_SEARCH)]
