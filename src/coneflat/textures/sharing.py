"""Triangles that share the texels of others: from the result for those that are unwrapped to the result for all."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..base import FloatArray, IntArray, mask_of
from ..mesh.connectivity import are_among
from ..result import Flattening
from ..source import Prepared, result_numbering


@dataclass(frozen=True, eq=False)
class SharedTexels:
    """Triangles of a checked mesh that share the texels of others.

    Attributes:
        corners: (c,) their corners, three for each triangle, as indices into all corners of the mesh.
        partners: (c,) the corner of an unwrapped triangle whose UV each of them has.
        has_own_points: whether they get UV points of their own at the same places; mirror images are charts of the
            other orientation, which have no points in common with those of the unwrapped triangles.
        note: a sentence for the user.
        settings: further entries of the result's settings.
    """

    corners: IntArray
    partners: IntArray
    has_own_points: bool
    note: str
    settings: dict[str, Any] = field(default_factory=dict)


def with_shared_texels(result: Flattening, shared: SharedTexels, prepared: Prepared) -> Flattening:
    """Return the result for all triangles; the measures remain those of the unwrapped ones.

    Args:
        result: the result for the components in `prepared`.
        shared: the triangles that share their texels.
        prepared: the input without these.
    """
    checked = prepared.checked
    number, _ = result_numbering(checked, len(np.asarray(prepared.input_mesh.vertices)))
    faces = number[checked.mesh.faces]
    unwrapped = np.sort(np.concatenate([component.faces for component in prepared.components]))
    row = np.full(len(faces), -1)
    row[unwrapped] = np.arange(len(unwrapped))
    row[shared.corners // 3] = row[shared.partners // 3]
    # The vertex of an unwrapped triangle whose values each vertex of the others has.
    partner = np.arange(len(result.vertices))
    partner[faces.ravel()[shared.corners]] = faces.ravel()[shared.partners]

    def at_vertices(values: FloatArray) -> FloatArray:
        return np.where(np.isnan(values), values[partner], values)

    cones, curvatures = _cones_of_all(result, faces, partner)
    measures = result.distortion
    return replace(
        result,
        faces=faces,
        face_origin=checked.face_origin,
        uv=np.concatenate([result.uv, result.uv]) if shared.has_own_points else result.uv,
        uv_faces=_uv_faces_of_all(result, unwrapped, len(faces), shared),
        cones=cones,
        curvatures=curvatures,
        seams=_seams_of_all(result, faces, shared),
        log_scale=at_vertices(result.log_scale),
        prescribed=at_vertices(result.prescribed),
        curvature_residual=at_vertices(result.curvature_residual),
        distortion=replace(measures, qc=measures.qc[row], log_area_scale=measures.log_area_scale[row]),
        notes=(*result.notes, shared.note),
        settings={**result.settings, **shared.settings},
    )


def _uv_faces_of_all(result: Flattening, unwrapped: IntArray, count: int, shared: SharedTexels) -> IntArray:
    """Return (count, 3) the UV points of all triangles; unwrapped: the indices of those in the result."""
    points = np.full((count, 3), -1)
    points[unwrapped] = result.uv_faces
    shift = len(result.uv) if shared.has_own_points else 0
    points.ravel()[shared.corners] = points.ravel()[shared.partners] + shift
    return points


def _cones_of_all(result: Flattening, faces: IntArray, partner: IntArray) -> tuple[IntArray, FloatArray]:
    """Return the cones of all triangles, and their curvatures.

    Args:
        result: the result.
        faces: (m, 3) all triangles.
        partner: (n,) the vertex whose values each vertex has.
    """
    is_cone, is_vertex = mask_of(len(partner), result.cones), mask_of(len(partner), faces)
    curvature = np.zeros(len(partner))
    curvature[result.cones] = result.curvatures
    cones = np.flatnonzero((is_cone | is_cone[partner]) & is_vertex)
    return cones, np.where(is_cone, curvature, curvature[partner])[cones]


def _seams_of_all(result: Flattening, faces: IntArray, shared: SharedTexels) -> IntArray:
    """Return (k, 2) the seams of the unwrapped triangles, and the edges of the others whose partners are seams.

    Args:
        result: the result for the unwrapped triangles, which may list edges of the others.
        faces: (m, 3) all triangles.
        shared: the triangles that share texels.
    """
    partner = np.full(faces.size, -1)
    partner[shared.corners] = shared.partners
    ends = _sides(shared.corners.reshape(-1, 3))
    edges, partner_edges = (np.sort(faces.ravel()[of], axis=1) for of in (ends, partner[ends]))
    seams = np.sort(result.seams, axis=1)
    seams = seams[are_among(seams, _sides(result.faces))]
    return np.unique(np.concatenate([seams, edges[are_among(partner_edges, seams)]]), axis=0)


def _sides(faces: IntArray) -> IntArray:
    """Return (3m, 2) the ends of the sides of faces (m, 3)."""
    return np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
