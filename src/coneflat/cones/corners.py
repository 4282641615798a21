"""The corners of a polyhedron as cones: it then unfolds without distortion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..base.arrays import FloatArray
from ..base.defaults import TYPED_TOLERANCE
from ..geometry import angle_defect, corner_angles
from ..mesh.connectivity import TriangleMesh
from ..stages import ConeSpec, VertexCurvatures

# Largest number of corners of a polyhedron that all become cones though the search finds cones within the bound.
MAX_POLYHEDRON_CORNERS = 24


def with_corners(
    mesh: TriangleMesh, lengths: FloatArray, spec: ConeSpec, largest_count: int
) -> ConeSpec | None:
    """Return a specification of the corners as cones, with their curvatures; None if they cannot all be cones.

    A corner is an inner vertex whose angle sum is not 2 pi.

    Args:
        mesh, lengths: a connected mesh and its (m, 3) side lengths, with which every triangle has area.
        spec: what is required of the cones.
        largest_count: largest number of corners.
    """
    if spec.strategy != "auto" or spec.needs_sparse_search or spec.searches_corners:
        return None
    curvature = angle_defect(mesh.faces, corner_angles(lengths), mesh.is_boundary_vertex)
    corners = np.flatnonzero((np.abs(curvature) > TYPED_TOLERANCE) & ~mesh.is_boundary_vertex)
    angles = 2 * np.pi - curvature[corners]
    if spec.max_count is not None:
        largest_count = min(largest_count, spec.max_count)
    if not 0 < len(corners) <= largest_count or not spec.is_allowed[corners].all():
        return None
    if angles.min() < spec.min_angle or angles.max() > (spec.max_angle or np.inf):
        return None
    return replace(spec, strategy="prescribed", prescribed=VertexCurvatures(corners, curvature[corners]))
