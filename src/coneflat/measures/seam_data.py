"""The cut as arrays: both sides of every seam edge, and the motion that maps one side to the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from ..base.arrays import BoolArray, ComplexArray, FloatArray, IntArray, unit_exponent
from ..geometry import double_areas, edge_lengths, sides_between
from ..geometry.handles import difference_from_multiple, handle_loops
from ..mesh.charts import label_charts, point_seams
from ..mesh.connectivity import TriangleMesh, end_corners
from .distortion import angle_sum_errors

if TYPE_CHECKING:
    from ..result import Flattening


@dataclass(frozen=True, eq=False)
class SeamData:
    """The cut of a flattening: k seam edges, s cones, n vertices, m triangles, u points in the plane.

    Seams are the inner edges that were cut, between two charts or within one, without boundary edges of the model. Side
    0 of a seam edge is on the left of the direction from its first vertex to its second, seen from outside, and side 1
    on the right. A similarity maps side 0 to side 1: with a point of the plane as a complex number z = u + iv,

        z_1 = seam_scale * exp(i seam_rotation) * z_0 + seam_translation.

    With the exact metric it is a rigid motion: `seam_scale` is 1 up to rounding. All values are measured on the UVs, in
    their units; translations divided by `uv_scale` are in model units. A side can be missing in files, but not in
    flattenings; it has indices -1. The motion is NaN if a side is missing or has no length.

    Names, types and shapes are the same in a result written as .npz. All indices are int64, all numbers float64.

    Attributes:
        seams: (k, 2) the vertices of each seam edge, as in `Flattening.seams`.
        seam_faces: (k, 2) the triangle on each side.
        seam_corners: (k, 2) the corner of that triangle opposite the edge: 0, 1 or 2.
        seam_points: (k, 2, 2) index into `uv` on each side of each end, the ends in the order of `seams`.
        seam_charts: (k, 2) the chart on each side.
        seam_rotation: (k,) radians, above -pi and up to pi. On a counterclockwise loop around an inner vertex, the
            rotations of the crossed seams sum to its curvature in the plane, e.g. that of a cone, up to full turns; a
            rotation crossed from side 1 to side 0 counts as negative.
        seam_translation: (k, 2) UV units.
        seam_scale: (k,) length of side 1 divided by that of side 0.
        face_chart: (m,) the chart of each triangle, from 0, in the order of their first triangles. Triangles are in the
            same chart if they are connected across edges with the same points on both sides.
        cones: (s,) cone vertices.
        cone_angles: (s,) angle sum at each cone in the plane, radians; 2 pi minus its curvature.
        vertex_log_scale: (n,) log of the length scale from the model to the plane, UV units per model unit: half the
            log of the ratio of the areas of the triangles around the vertex, in the plane over the model. NaN where
            none has area.
        log_area_scale: (m,) the same for each triangle, as in `Distortion`.

    Examples:
        >>> vertices = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
        >>> faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
        >>> cut = coneflat.flatten(vertices, faces).seam_data
        >>> cut.seams.shape, cut.seam_faces.shape, cut.seam_points.shape
        ((3, 2), (3, 2), (3, 2, 2))
        >>> bool(np.allclose(cut.seam_scale, 1.0)), bool(np.allclose(cut.cone_angles, np.pi))
        (True, True)
    """

    seams: IntArray
    seam_faces: IntArray
    seam_corners: IntArray
    seam_points: IntArray
    seam_charts: IntArray
    seam_rotation: FloatArray
    seam_translation: FloatArray
    seam_scale: FloatArray
    face_chart: IntArray
    cones: IntArray
    cone_angles: FloatArray
    vertex_log_scale: FloatArray
    log_area_scale: FloatArray

    def as_arrays(self) -> dict[str, FloatArray | IntArray]:
        """Return the arrays by name."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


def seam_data(result: Flattening) -> SeamData:
    """Return the cut of a result as arrays, measured on its UVs."""
    mesh = TriangleMesh(result.vertices, result.faces)
    seams = np.asarray(result.seams, dtype=np.int64).reshape(-1, 2)
    halfedges = _sides(mesh, seams)
    exists = halfedges >= 0
    start, end = end_corners(halfedges)
    # The ends in the order of `seams`: in the direction of the half-edge on side 0, against it on side 1.
    ends = np.stack([np.stack([start[:, 0], end[:, 0]], 1), np.stack([end[:, 1], start[:, 1]], 1)], axis=1)
    points = np.where(exists[:, :, None], result.uv_faces.ravel()[ends], -1)
    joined = ~mesh.is_boundary_edge
    joined[point_seams(mesh, result.uv_faces)] = False
    chart = label_charts(mesh, joined)[1]
    faces = np.where(exists, halfedges // 3, -1)
    ratio = _ratios(mesh, result.corner_uv, halfedges)
    middles = result.uv[points].mean(axis=2) @ np.array([1, 1j])
    shift = middles[:, 1] - ratio * middles[:, 0]
    full = np.where(mesh.is_boundary_vertex, np.pi, 2 * np.pi)
    errors, _ = angle_sum_errors(mesh, result.corner_uv, np.zeros(len(full)))
    return SeamData(
        seams=seams,
        seam_faces=faces,
        seam_corners=np.where(exists, halfedges % 3, -1),
        seam_points=points,
        seam_charts=np.where(exists, chart[faces], -1),
        seam_rotation=np.angle(ratio),
        seam_translation=np.stack([shift.real, shift.imag], axis=1),
        seam_scale=np.abs(ratio),
        face_chart=chart,
        cones=result.cones,
        cone_angles=(errors + full)[result.cones],
        vertex_log_scale=_vertex_scales(mesh, result.distortion.log_area_scale, result.lengths),
        log_area_scale=result.distortion.log_area_scale,
    )


def _sides(mesh: TriangleMesh, seams: IntArray) -> IntArray:
    """Return (k, 2) the half-edges on the left and right of seams (k, 2); -1 where a side is missing."""
    count = len(mesh.vertices)
    # Edges are sorted by their ends.
    keys, seam_keys = mesh.edges @ [count, 1], np.sort(seams, axis=1) @ [count, 1]
    edge = np.minimum(np.searchsorted(keys, seam_keys), len(keys) - 1)
    sides = np.where((keys[edge] == seam_keys)[:, None], mesh.edge_halfedges[edge], -1)
    is_left = (sides >= 0) & (mesh.tails[sides] == seams[:, :1])
    is_right = (sides >= 0) & ~is_left
    return np.stack([np.where(is_side, sides, -1).max(axis=1) for is_side in (is_left, is_right)], axis=1)


def _ratios(mesh: TriangleMesh, corner_uv: FloatArray, halfedges: IntArray) -> ComplexArray:
    """Return (k,) the ratio of side 1 to side 0 as complex numbers; NaN where one is missing or has no length."""
    ratios = np.full(len(mesh.edges), np.nan, dtype=np.complex128)
    ratios[~mesh.is_boundary_edge] = ratios_across(mesh, corner_uv)
    edge = mesh.halfedge_edges[halfedges.max(axis=1)]
    edge_ratios = ratios[edge]
    with np.errstate(divide="ignore", invalid="ignore"):
        edge_ratios = np.where(halfedges[:, 0] == mesh.edge_halfedges[edge, 0], edge_ratios, 1 / edge_ratios)
    is_known = (halfedges >= 0).all(axis=1) & np.isfinite(edge_ratios) & (edge_ratios != 0)
    return np.where(is_known, edge_ratios, complex(np.nan, np.nan))


def _vertex_scales(mesh: TriangleMesh, log_area_scale: FloatArray, lengths: FloatArray | None) -> FloatArray:
    """Return (n,) half the log of the ratio of the areas around each vertex, in the plane over the model."""
    # Scaling to unit size avoids underflow and overflow of squares; the factors cancel.
    if lengths is None:
        lengths = edge_lengths(np.ldexp(mesh.vertices, -unit_exponent(mesh.vertices[mesh.faces])), mesh.faces)
    else:
        lengths = np.ldexp(lengths, -unit_exponent(lengths))
    is_finite = np.isfinite(log_area_scale)
    corners, areas = mesh.faces[is_finite].ravel(), np.repeat(double_areas(lengths[is_finite]), 3)
    largest = log_area_scale[is_finite].max(initial=-np.inf)
    flat = areas * np.exp(2 * np.repeat(log_area_scale[is_finite] - largest, 3))
    on_model, in_plane = (np.bincount(corners, weights, len(mesh.vertices)) for weights in (areas, flat))
    with np.errstate(divide="ignore", invalid="ignore"):
        scales: FloatArray = np.log(in_plane / on_model) / 2 + largest
    return np.where(np.isfinite(scales), scales, np.nan)


@dataclass(frozen=True)
class Rotations:
    """Deviation of rotations from multiples of a quantum, radians.

    Attributes:
        quantum: the angle.
        worst: largest deviation of the rotation across a seam edge.
        handles: deviation of the holonomy along each generator of the handles, two per handle.
    """

    quantum: float
    worst: float
    handles: tuple[float, ...]

    @classmethod
    def of_all(cls, parts: Sequence[Rotations]) -> Rotations:
        """Return the combined deviations of components."""
        handles = tuple(angle for part in parts for angle in part.handles)
        return cls(parts[0].quantum, max(part.worst for part in parts), handles)

    def binds(self, off: FloatArray) -> BoolArray:
        """Return which edges with the given deviations are constrained; marked seams and joined components are not."""
        return np.asarray(off <= self.worst * (1 + 1e-6) + 1e-12)


def measure_rotations(mesh: TriangleMesh, corner_uv: FloatArray, quantum: float) -> Rotations:
    """Return the deviations of seams and handles in a layout of a connected mesh.

    Args:
        mesh: the connected mesh.
        corner_uv: (m, 3, 2) points of the triangle corners.
        quantum: radians.
    """
    pairs = mesh.edge_halfedges[~mesh.is_boundary_edge]
    turns = _rotations(mesh, corner_uv)
    across = np.zeros(mesh.faces.size)
    across[pairs[:, 0]], across[pairs[:, 1]] = turns, -turns
    off = np.abs(difference_from_multiple(turns, quantum))
    handles = difference_from_multiple(np.array([across[loop].sum() for loop in handle_loops(mesh)]), quantum)
    return Rotations(quantum, float(off.max(initial=0.0)), tuple(handles.tolist()))


def seam_rotations(mesh: TriangleMesh, corner_uv: FloatArray, quantum: float) -> FloatArray:
    """Return (k,) the deviation of the rotation across each inner edge from a multiple of a quantum, radians."""
    return np.abs(difference_from_multiple(_rotations(mesh, corner_uv), quantum))


def ratios_across(mesh: TriangleMesh, corner_uv: FloatArray) -> ComplexArray:
    """Return (k,) the ratio of the second to the first side of each inner edge, as complex numbers.

    The ratio combines rotation and scale. It is not finite where the first side has no length.
    """
    sides = sides_between(corner_uv).ravel()
    pairs = mesh.edge_halfedges[~mesh.is_boundary_edge]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios: ComplexArray = -sides[pairs[:, 1]] / sides[pairs[:, 0]]
    return ratios


def _rotations(mesh: TriangleMesh, corner_uv: FloatArray) -> FloatArray:
    """Return (k,) the rotation between the two sides of each inner edge, radians; 0 where a side has no length."""
    ratios = ratios_across(mesh, corner_uv)
    # The argument of an infinite complex number is finite.
    return np.where(np.isfinite(ratios) & (ratios != 0), np.angle(ratios), 0.0)
