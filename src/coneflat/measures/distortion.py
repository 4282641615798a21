"""Measures of a parameterization, from the mesh and its UVs alone."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import BoolArray, FloatArray, IntArray, as_faces, as_floats
from ..base.text import list_some, short_repr
from ..errors import ArrayShapeError, NonFiniteError, OptionError
from ..geometry import double_areas
from ..geometry.intrinsic import check_lengths
from ..geometry.overlap import Overlaps, overlaps_of_mesh
from ..geometry.straight import place_triangles
from ..mesh.charts import joined_edges, label_charts
from ..mesh.connectivity import TriangleMesh
from ..stages import Layout
from .seam_sides import seam_measures, seam_motion_mismatch
from .strain import strain_of
from .triangles import measure_triangles, sum_angles
from .weighted import quantile, quantiles, weighted_mean


@dataclass(frozen=True, eq=False)
class Distortion:
    """Quality of a flattening.

    Quasi-conformal distortion (QC) is the ratio of the singular values of a triangle's map, 1 where it is
    conformal (Kharevych et al. 2006); means and quantiles are weighted by the area on the model.

    Attributes:
        qc: (m,) QC of each triangle; NaN where the triangle is degenerate on the model or in the plane.
        log_area_scale: (m,) log of sqrt(UV area / area on the model); NaN for the same triangles.
        strain: (m,) relative change of the length of the side that changes most, at the scale of `strain_mean`; NaN for
            triangles without area on the model.
        qc_mean, qc_p95, qc_max: mean, 95th percentile and maximum of the quasi-conformal distortion, the ratio of
            the singular values of a triangle's map.
        area_std: standard deviation of log sqrt(UV area / area on the model).
        energy: symmetric Dirichlet energy, the sum of the squares of both singular values and of their inverses,
            averaged by area, at the scale where it is least; 4 for an isometry. Orientation does not count.
        strain_max, strain_mean: relative change of the lengths of edges: largest, at the scale where it is least; mean,
            weighted by length, at the scale that keeps the total length. Both sides of a seam count.
        flipped: number of triangles whose orientation is opposite to that of their chart.
        degenerate, degenerate_input: number of triangles without area in the plane that have area on the model; number
            of triangles without area on the model.
        charts, mirrored_charts: number of charts of the layout; number of those whose orientation is reversed.
        seam_length: length on the model of all seams, each counted once, divided by the square root of the area.
        seam_mismatch, seam_mismatch_max: relative difference of the two UV lengths of a seam edge: mean, weighted by
            length; maximum.
        seam_motion_mismatch: deviation of the two sides of a seam from being related by one rigid motion: largest
            change of the rotation between them from one seam edge to the next, radians. Vertices where seams branch or
            end, and cones, are not compared.
        density_spread: 95th percentile of the texel density (texels per length on the model) divided by the 5th.
        overlap, overlapping_pairs: fraction of the covered area that is covered more than once; number of pairs of
            triangles with common interior points, computed exactly.
        curvature_error, curvature_error_max: ||target - K||_2 / n of the metric (Table 1 of the paper), and the largest
            |target - K|, in units of pi.
        angle_sum_error: largest difference, radians, between the angle sum at a vertex in the plane and its target,
            2 pi (pi on the boundary) minus the prescribed curvature; NaN if unknown.

    Examples:
        >>> vertices = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
        >>> faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
        >>> found = coneflat.flatten(vertices, faces).distortion
        >>> found.flipped, found.overlapping_pairs, found.charts
        (0, 0, 1)
        >>> round(found.qc_mean, 6), round(found.strain_max, 6)  # a polyhedron opens without distortion
        (1.0, 0.0)
    """

    qc: FloatArray
    log_area_scale: FloatArray
    strain: FloatArray
    qc_mean: float
    qc_p95: float
    qc_max: float
    area_std: float
    energy: float
    strain_max: float
    strain_mean: float
    flipped: int
    degenerate: int
    degenerate_input: int
    charts: int
    mirrored_charts: int
    seam_length: float
    seam_mismatch: float
    seam_mismatch_max: float
    seam_motion_mismatch: float
    density_spread: float
    overlap: float
    overlapping_pairs: int
    curvature_error: float = float("nan")
    curvature_error_max: float = float("nan")
    angle_sum_error: float = float("nan")

    def rescaled(self, log_factor: float) -> Distortion:
        """Return the measures of the layout scaled by exp(log_factor).

        Args:
            log_factor: logarithm of the factor of lengths in the plane.
        """
        return replace(self, log_area_scale=self.log_area_scale + log_factor)


def curvature_errors(residual: FloatArray) -> tuple[float, float]:
    """Return ||target - K||_2 / n as in Table 1 of the paper, and the largest |target - K|, both over pi.

    residual: (n,) target - K, radians.
    """
    return (
        float(np.linalg.norm(residual) / len(residual) / np.pi),
        float(np.abs(residual).max() / np.pi),
    )


def measure(
    mesh: TriangleMesh,
    corner_uv: FloatArray,
    curvature_error: tuple[float, float] = (np.nan, np.nan),
    cones: IntArray | None = None,
    prescribed: FloatArray | None = None,
    overlaps: Overlaps | None = None,
    lengths: ArrayLike | None = None,
) -> Distortion:
    """Return the measures of a UV map.

    Args:
        mesh: the mesh.
        corner_uv: (m, 3, 2) the UV point of every triangle corner.
        curvature_error: the values of `curvature_errors` for the metric.
        cones: (s,) vertices at which the rotation between the sides of a seam changes.
        prescribed: (n,) prescribed curvature in the plane, radians; NaN where it is free.
        overlaps: the result of `find_overlaps`; None to compute it.
        lengths: (m, 3) side lengths of the metric that is mapped, column i opposite corner i; None for the distances
            between the vertices.

    Returns:
        The measures.

    Raises:
        ArrayShapeError, NonFiniteError: the arrays do not fit the mesh, or UVs are not finite.
        FaceIndexError: a face has the index of a vertex that does not exist.
        OptionError: cones are not vertices.
        LengthError: the lengths are not a metric.

    Examples:
        >>> square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]]
        >>> mesh = coneflat.check_mesh(*square).mesh
        >>> stretched = mesh.vertices[mesh.faces][:, :, :2] * [2, 1]
        >>> found = coneflat.measure(mesh, stretched)
        >>> round(found.qc_mean, 6), found.flipped
        (2.0, 0)
    """
    corner_uv = as_floats("corner_uv", corner_uv)
    prescribed = None if prescribed is None else as_floats("prescribed", prescribed)
    _check_arrays(mesh, corner_uv, cones, prescribed)
    flat_lengths = None if lengths is None else check_lengths(mesh, lengths, flat=True)
    measured = measure_map(mesh, corner_uv, curvature_error, cones, flat_lengths)
    overlap = overlaps_of_mesh(mesh.edge_halfedges, corner_uv) if overlaps is None else overlaps
    if prescribed is not None:
        errors = np.abs(angle_sum_errors(mesh, corner_uv, prescribed)[0])
        measured = replace(measured, angle_sum_error=float(np.nanmax(errors, initial=0.0)))
    return replace(measured, overlap=overlap.fraction, overlapping_pairs=len(overlap.pairs))


def _check_arrays(
    mesh: TriangleMesh, corner_uv: FloatArray, cones: IntArray | None, prescribed: FloatArray | None
) -> None:
    """Raise an error for invalid arrays, with which compiled loops would read out of bounds."""
    if not isinstance(mesh, TriangleMesh):
        raise ArrayShapeError(
            f"mesh must be a TriangleMesh, for example check_mesh(vertices, faces).mesh, got {short_repr(mesh)}"
        )
    as_faces(mesh.faces, len(mesh.vertices))
    if not np.isfinite(corner_uv).all():
        raise NonFiniteError("corner_uv has points that are NaN or infinite")
    bad = [] if cones is None else [v for v in np.asarray(cones).tolist() if not 0 <= v < len(mesh.vertices)]
    if bad:
        raise OptionError(f"cones are not vertices of the mesh: {list_some(bad)}")
    count = (len(mesh.vertices),)
    for name, shape, expected in (
        ("corner_uv", np.shape(corner_uv), (*np.shape(mesh.faces), 2)),
        ("prescribed", count if prescribed is None else np.shape(prescribed), count),
    ):
        if shape != expected:
            raise ArrayShapeError(f"{name} must have the shape {expected}, to match the mesh, got {shape}")


def angle_sum_errors(
    mesh: TriangleMesh, corner_uv: FloatArray, prescribed: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return (n,) the angle sum at each vertex minus its target, radians, and (n,) its sensitivity to rounding.

    Args:
        mesh: the mesh.
        corner_uv: (m, 3, 2) the UV point of every triangle corner.
        prescribed: (n,) prescribed curvature in the plane, radians; where it is NaN, so is the error.

    Returns:
        (n,) errors in radians, and (n,) their change per displacement of points, as `sum_angles` returns it.
    """
    uv = np.ascontiguousarray(corner_uv, dtype=np.float64)
    sums, change = sum_angles(mesh.faces, uv, len(mesh.vertices))
    full = np.where(mesh.is_boundary_vertex, np.pi, 2 * np.pi)
    return sums - full + prescribed, change


def measure_map(
    mesh: TriangleMesh,
    corner_uv: FloatArray,
    curvature_error: tuple[float, float] = (np.nan, np.nan),
    cones: IntArray | None = None,
    lengths: FloatArray | None = None,
    texture: IntArray | None = None,
) -> Distortion:
    """Return all measures except those of overlaps; arguments are those of `measure`.

    texture: (m,) the texture of each triangle; edges between different ones are seams.
    """
    corner_uv = np.ascontiguousarray(corner_uv, dtype=np.float64)
    shapes = (mesh.vertices, mesh.faces) if lengths is None else _place_separately(lengths)
    area, has_area, uv_area, has_uv_area, qc = measure_triangles(*shapes, corner_uv)
    joined = joined_edges(mesh, corner_uv)
    if texture is not None:
        joined &= texture[mesh.edge_faces[:, 0]] == texture[mesh.edge_faces[:, 1]]
    seams = np.flatnonzero(~joined & ~mesh.is_boundary_edge)
    strain = strain_of(*shapes, corner_uv, has_area, joined[mesh.halfedge_edges])
    return Distortion(
        qc=qc,
        **_scale_measures(qc, area, uv_area, has_area & has_uv_area),
        strain=strain.of_triangles,
        strain_max=strain.largest,
        strain_mean=strain.mean,
        degenerate=int((has_area & ~has_uv_area).sum()),
        degenerate_input=int((~has_area).sum()),
        **_orientation_measures(mesh, joined, np.where(has_uv_area, uv_area, 0)),
        **seam_measures(mesh, corner_uv, seams, lengths, float(area.sum() / 2)),
        seam_motion_mismatch=seam_motion_mismatch(mesh, corner_uv, seams, cones),
        overlap=float("nan"),
        overlapping_pairs=0,
        curvature_error=curvature_error[0],
        curvature_error_max=curvature_error[1],
    )


def mean_qc(layout: Layout) -> float:
    """Return the mean quasi-conformal distortion of a layout by area, over positively oriented triangles."""
    is_positive = np.isfinite(layout.qc)
    if not is_positive.any():
        return math.inf
    return weighted_mean(layout.qc[is_positive], double_areas(layout.lengths)[is_positive])


def _scale_measures(
    qc: FloatArray, area: FloatArray, uv_area: FloatArray, is_valid: BoolArray
) -> dict[str, Any]:
    """Return the measures of the singular values of the triangles that have area on the model and in the plane.

    Args:
        qc: (m,) QC of each triangle.
        area, uv_area: (m,) twice the areas on the model, and twice the signed areas in the plane.
        is_valid: (m,) whether both are nonzero.
    """
    # In most meshes all triangles are valid; a slice then avoids copies.
    chosen = slice(None) if is_valid.all() else is_valid
    weights, ratios = area[chosen], qc[chosen]
    scales = np.log(np.abs(uv_area[chosen]) / weights) / 2
    log_area_scale = np.full(len(area), np.nan)
    log_area_scale[chosen] = scales
    low, high = quantiles(scales, weights, (0.05, 0.95))
    return {
        "log_area_scale": log_area_scale,
        "qc_mean": weighted_mean(ratios, weights),
        "qc_p95": quantile(ratios, weights, 0.95),
        "qc_max": float(ratios.max()) if len(weights) else float("nan"),
        "area_std": float(np.sqrt(weighted_mean((scales - weighted_mean(scales, weights)) ** 2, weights))),
        "energy": _symmetric_dirichlet(ratios, scales, weights),
        "density_spread": float(np.exp(high - low)),
    }


def _orientation_measures(mesh: TriangleMesh, joined: BoolArray, uv_area: FloatArray) -> dict[str, Any]:
    """Return the numbers of charts, of mirrored charts and of flipped triangles.

    Args:
        mesh: the mesh.
        joined: (e,) whether the layout is connected at an edge.
        uv_area: (m,) twice the signed area of each triangle in the plane; 0 if it has none.
    """
    charts, chart = label_charts(mesh, joined)
    majority = np.sign(np.bincount(chart, weights=uv_area, minlength=charts))
    against = np.sign(uv_area) * majority[chart] < 0
    return {"flipped": int(against.sum()), "charts": charts, "mirrored_charts": int((majority < 0).sum())}


def _symmetric_dirichlet(qc: FloatArray, log_scale: FloatArray, weights: FloatArray) -> float:
    """Return the mean symmetric Dirichlet energy at the best scale, from QC distortions and log conformal factors."""
    ratio = qc + 1 / qc
    squares, inverses = (weighted_mean(ratio * np.exp(sign * 2 * log_scale), weights) for sign in (1, -1))
    return 2 * float(np.sqrt(squares * inverses))


def _place_separately(lengths: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return separate triangles with the given side lengths: positions (3m, 3), and (m, 3) indices of them."""
    sides = np.empty(lengths.size, dtype=np.complex128)
    place_triangles(lengths.ravel(), sides)
    along = sides.reshape(-1, 3)
    corners = np.stack([np.zeros(len(along)), along[:, 2], along[:, 2] + along[:, 0]], axis=1).ravel()
    positions = np.stack([corners.real, corners.imag, np.zeros(len(corners))], axis=1)
    return positions, np.arange(len(corners)).reshape(-1, 3)
