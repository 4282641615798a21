"""Conversion of the UVs of a file to a flattening, for pages and figures."""

from __future__ import annotations

import numpy as np

from ...base import unit_exponent
from ...errors import MeshFileError, MissingUVError
from ...geometry import double_areas, edge_lengths
from ...io import Joined, UVMesh, cell_side, uv_mesh_of
from ...measures import angle_sum_errors, as_rows
from ...mesh import uv_seams
from ...result import Flattening
from ...stages import SolveStatistics
from ..uv_measures import measure_mapped, uv_points

#: The `method` in the settings of a flattening that was read from the UVs of a file.
FILE_UVS = "the file's own UVs"
#: Largest UV that pages and pictures can show: pages have 32-bit numbers, in which squares of larger ones overflow.
MAX_UV = 1e15
#: Rows of a report that do not apply to a map without a cone search.
_SEARCH_ROWS = ("cones", "curvature error", "of the metric")


def own_flattening(source: Joined, *, strict: bool = False) -> Flattening | None:
    """Return the UVs of a mesh file as a flattening; None if no triangle has UVs.

    Triangles without UVs are left out, with a note. A mesh that is not manifold is repaired.

    Raises:
        MeshError: the triangles are not a valid mesh.
        MeshFileError: UVs are too large to be shown.
    """
    try:
        return uv_flattening(uv_mesh_of(source), strict=strict)
    except MissingUVError:
        return None


def uv_flattening(mapped: UVMesh, *, strict: bool = False) -> Flattening:
    """Return a UV map as a flattening without cones; its curvature residuals are the angle errors in the plane.

    Raises:
        MissingUVError: no triangle has UVs.
        MeshError: the triangles are not a valid mesh.
        MeshFileError: UVs are too large to be shown.
    """
    measured = measure_mapped(mapped, strict=strict)
    largest = float(np.abs(measured.corner_uv).max())
    if largest > MAX_UV:
        raise MeshFileError(
            f"UVs of up to {largest:.3g} are too large to be shown: `coneflat measure` measures them, --again flattens "
            "the mesh again"
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
        settings={"method": FILE_UVS},
        solve=SolveStatistics(),
        source=mapped.source,
        face_corners=measured.face_corners,
    )


def is_from_file(result: Flattening) -> bool:
    """Return whether a flattening was read from the UVs of a file."""
    return result.settings.get("method") == FILE_UVS


def shown_rows(result: Flattening) -> list[tuple[str, str, str]]:
    """Return the rows of the report that apply to a result."""
    return [row for row in as_rows(result) if not (is_from_file(result) and row[0] in _SEARCH_ROWS)]
