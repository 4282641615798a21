"""Measures of seams: their length, and how much their two sides differ."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.arrays import FloatArray, IntArray, dots
from ..mesh.charts import both_sides
from ..mesh.connectivity import TriangleMesh
from .weighted import weighted_mean


def seam_measures(
    mesh: TriangleMesh, corner_uv: FloatArray, seams: IntArray, lengths: FloatArray | None, area: float
) -> dict[str, Any]:
    """Return the length of the seams, and how much the lengths of their two sides differ.

    Args:
        mesh: the mesh.
        corner_uv: (m, 3, 2) the UV point of every triangle corner.
        seams: numbers of the seam edges.
        lengths: (m, 3) side lengths of the metric that is mapped; None for the distances between the vertices.
        area: area of the model.
    """
    seam_lengths, mismatches = _seam_mismatch(mesh, corner_uv, seams)
    if lengths is not None:
        seam_lengths = lengths.ravel()[mesh.edge_halfedges[seams, 0]]
    return {
        "seam_length": float(seam_lengths.sum() / np.sqrt(area)) if area > 0 else 0.0,
        "seam_mismatch": weighted_mean(mismatches, seam_lengths) if len(seams) else 0.0,
        "seam_mismatch_max": float(mismatches.max()) if len(seams) else 0.0,
    }


def _seam_mismatch(
    mesh: TriangleMesh, corner_uv: FloatArray, seams: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Return (k,) the length on the model of each seam edge, and (k,) the relative difference of its UV lengths."""
    first, second = (_side_lengths(ends) for ends in both_sides(mesh, seams, corner_uv))
    ends = mesh.vertices[mesh.edges[seams]]
    return _side_lengths(ends), np.abs(first - second) / np.maximum(
        (first + second) / 2, np.finfo(float).tiny
    )


def _side_lengths(ends: FloatArray) -> FloatArray:
    side = ends[:, 1] - ends[:, 0]
    return np.sqrt(dots(side, side))


def seam_motion_mismatch(
    mesh: TriangleMesh, corner_uv: FloatArray, seams: IntArray, cones: IntArray | None
) -> float:
    """Return the largest change of the rotation between the two sides of a seam along the seam, radians."""
    sides, twin_sides = both_sides(mesh, seams, corner_uv)
    first_step = (sides[:, 1] - sides[:, 0]) @ np.array([1, 1j])
    second_step = (twin_sides[:, 1] - twin_sides[:, 0]) @ np.array([1, 1j])
    # `sides` are those of the first half-edge, which may be either side of the seam. The rotation of each edge is
    # from its left side to its right side, in the direction of its first half-edge.
    rotation = first_step * np.conj(second_step)
    rotation = rotation / np.maximum(np.abs(rotation), np.finfo(float).tiny)
    starts, ends = mesh.ends_of(mesh.edge_halfedges[seams, 0])
    degree = np.bincount(np.concatenate([starts, ends]), minlength=len(mesh.vertices))
    passed = (degree == 2) & ~mesh.is_boundary_vertex
    if cones is not None:
        passed[cones] = False
    # The two seam edges at each vertex that a seam passes, and whether each of them starts there.
    at = np.concatenate([starts, ends])
    leaves = np.repeat([True, False], len(seams))
    edge = np.tile(np.arange(len(seams)), 2)
    order = np.argsort(at, kind="stable")
    order = order[passed[at[order]]].reshape(-1, 2)
    if not len(order):
        return 0.0
    first, second = rotation[edge[order[:, 0]]], rotation[edge[order[:, 1]]]
    # Two edges that both start or both end at the vertex have opposite directions; their left and right are exchanged.
    opposed = leaves[order[:, 0]] == leaves[order[:, 1]]
    change = np.where(opposed, first * second, first * np.conj(second))
    return float(np.abs(np.angle(change)).max())
