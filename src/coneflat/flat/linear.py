"""The paper's method: a linear system for the scale, lengths by an edge integral, layout by least squares."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._arrays import FloatArray, IntArray
from ..cones import ConeSolution
from ..errors import MetricError
from ..geometry import angle_defect, corner_angles, double_areas, is_broken
from ..geometry.planar import signed_double_areas
from ..layout import least_squares_layout
from ..mesh import NEXT, PREVIOUS, TriangleMesh
from ..quality.statistics import SolveStatistics
from .base import LaidOut, all_faces


@dataclass(frozen=True, eq=False)
class LinearFlatMetric:
    """Nearly flat lengths of the mesh's own triangles.

    Attributes:
        mesh: the mesh.
        cones: (s,) vertices.
        lengths: (m, 3) scaled side lengths, model units.
        log_scale, target: (n,) phi and the curvature it is to give.
    """

    mesh: TriangleMesh
    cones: IntArray
    lengths: FloatArray
    log_scale: FloatArray
    target: FloatArray

    def lay_out(self, disk: TriangleMesh, seams: IntArray) -> LaidOut:
        """Return the least squares reconstruction, at the scale of the metric."""
        points = least_squares_layout(disk, self.lengths)
        area = np.abs(signed_double_areas(points[disk.faces])).sum()
        return LaidOut(
            mesh=self.mesh,
            face_origin=all_faces(self.mesh),
            points=points * np.sqrt(double_areas(self.lengths).sum() / area),
            corners=disk.faces,
            cones=self.cones,
            seams=self.mesh.edges[seams],
            log_scale=self.log_scale,
            target=self.target,
            curvature=angle_defect(
                self.mesh.faces, corner_angles(self.lengths), self.mesh.is_boundary_vertex
            ),
            statistics=SolveStatistics(broken=int(is_broken(self.lengths).sum())),
        )


def linear_flattening(
    mesh: TriangleMesh, lengths: FloatArray, solution: ConeSolution, rule: str = "integral"
) -> LinearFlatMetric:
    """Return the paper's metric (Section 2.3) for cones and their log scale.

    Args:
        mesh: connected.
        lengths: (m, 3) side lengths, model units.
        solution: cones, target curvatures and the linear log scale.
        rule: as in `scaled_lengths`.

    Raises:
        MetricError: scales are so far apart that lengths overflow.
    """
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        scaled = scaled_lengths(lengths, mesh.faces, solution.log_scale, rule)
        shrink = float(np.sqrt(double_areas(lengths).sum() / double_areas(scaled).sum()))
        scaled *= shrink
    # Layouts square lengths.
    if not (np.isfinite(scaled).all() and scaled.min() > 1e-150):
        raise MetricError(
            f"the scale would vary by a factor of e^{np.ptp(solution.log_scale):.4g} over the mesh, more than numbers "
            f"can hold: {len(solution.cones)} cones are too few, or their curvatures too extreme"
        )
    log_scale = solution.log_scale + np.log(shrink)
    return LinearFlatMetric(mesh, solution.cones, scaled, log_scale, solution.target)


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
    small = np.abs(x) < 1e-3  # the next term of the series is below 1e-16 there
    safe = np.where(small, 1.0, x)
    result: FloatArray = np.where(small, 1 + x**2 / 6 * (1 + x**2 / 20), np.sinh(safe) / safe)
    return result
