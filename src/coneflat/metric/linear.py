"""The linear metric of the paper: phi solves a linear system, and lengths are integrals of exp(phi) along edges."""

from __future__ import annotations

import numpy as np

from ..base.arrays import FloatArray, IntArray
from ..errors import MetricError
from ..geometry import double_areas, is_broken
from ..mesh.connectivity import NEXT, PREVIOUS, TriangleMesh
from ..stages import ConeSolution, FlatMetric, SolveStatistics

# Smallest length whose square, which layouts need, does not underflow in double precision.
MIN_LENGTH = 1e-150
# |x| below which three terms of the series equal sinh(x) / x up to rounding.
SERIES = 1e-3


def linear_flat_metric(
    mesh: TriangleMesh, lengths: FloatArray, solution: ConeSolution, rule: str = "integral"
) -> FlatMetric:
    """Return the linear metric of the paper (Section 2.3) for cones and their phi, with the area of the input.

    Args:
        mesh: connected.
        lengths: (m, 3) side lengths, model units.
        solution: cones, target curvatures and the linear log conformal factor.
        rule: as in `scaled_lengths`.

    Raises:
        MetricError: the range of the scale is so large that lengths overflow or underflow.

    Notes:
        phi solves L phi = target - K (Eq. 1). A side from i to j is multiplied by the integral of exp(phi) along it,
        (e^phi_j - e^phi_i) / (phi_j - phi_i). The metric is flat to first order only, and some triangles may break
        the triangle inequality, so that the layout is a least squares problem.

    See Also:
        exact_metric: the metric whose curvature is exactly the target.
        least_squares_layout: lays out this metric.
    """
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        scaled = scaled_lengths(lengths, mesh.faces, solution.log_scale, rule)
        shrink = float(np.sqrt(double_areas(lengths).sum() / double_areas(scaled).sum()))
        scaled *= shrink
    if not (np.isfinite(scaled).all() and scaled.min() > MIN_LENGTH):
        raise MetricError(
            f"the scale would vary by a factor of e^{np.ptp(solution.log_scale):.4g} over the mesh, which overflows "
            f"double precision: {len(solution.cones)} cones are too few, or their curvatures too extreme"
        )
    return FlatMetric(
        mesh=mesh,
        lengths=lengths,
        cones=solution.cones,
        target=solution.target,
        log_scale=solution.log_scale + np.log(shrink),
        is_open=mesh.is_boundary_vertex,
        is_fixed=np.zeros(len(mesh.vertices), dtype=bool),
        statistics=SolveStatistics(broken=int(is_broken(scaled).sum())),
        flat_lengths=scaled,
    )


def scaled_lengths(
    lengths: FloatArray, faces: IntArray, log_scale: FloatArray, rule: str = "integral"
) -> FloatArray:
    """Return (m, 3) side lengths after conformal scaling.

    Args:
        lengths: (m, 3) side lengths, model units.
        faces: (m, 3) vertex indices.
        log_scale: (n,) log conformal factor phi.
        rule: "integral" scales a side by the mean of exp(phi) along it, phi being linear there (Section
            2.3 of the paper); "mean" by exp of the mean of phi, which is the conformal equivalence of
            Springborn, Schroeder and Pinkall 2008.
    """
    tail, head = log_scale[faces[:, NEXT]], log_scale[faces[:, PREVIOUS]]
    scaled: FloatArray = lengths * np.exp((tail + head) / 2)
    if rule == "integral":
        # (e^b - e^a) / (b - a) = e^((a + b) / 2) sinh(d) / d with d = (b - a) / 2: no cancellation.
        scaled *= _sinhc((head - tail) / 2)
    return scaled


def _sinhc(x: FloatArray) -> FloatArray:
    """Return sinh(x) / x."""
    small = np.abs(x) < SERIES
    safe = np.where(small, 1.0, x)
    return np.where(small, 1 + x**2 / 6 * (1 + x**2 / 20), np.sinh(safe) / safe)
