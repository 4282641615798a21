"""Discrete Ricci flow by circle packings with inversive distances."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from .._arrays import FloatArray, IntArray
from ..compiled import compiled
from ..cones import ConeSolution
from ..geometry import is_broken
from ..geometry.delaunay import make_delaunay
from ..geometry.triangles import slacks
from ..mesh import NEXT, TriangleMesh
from ..text import plural
from .base import failure_notes, off_by
from .exact.flatten import ExactFlatMetric, at_own_area
from .exact.metric import exact_metric
from .exact.newton import ConformalProblem, add_angles, centred


def ricci_flow(
    mesh: TriangleMesh,
    lengths: FloatArray,
    solution: ConeSolution,
    best_effort: bool = False,
) -> ExactFlatMetric:
    """Return the flat metric of a circle packing with the inversive distances of the input's.

    Args:
        mesh: connected.
        lengths: (m, 3) side lengths, model units.
        solution: cones with their curvatures; on the boundary, which is free, radii stay as they are.
        best_effort: return a metric that did not converge.

    Raises:
        ConvergenceError: no metric was found, unless `best_effort`.
        CurvatureError: no metric has the curvatures.

    Notes:
        M. Jin, J. Kim, X. Gu, "Discrete surface Ricci flow: theory and applications", 2007, minimised by Newton's
        method; inversive distances after R. Guo, "Local rigidity of inversive distance circle packing", 2011,
        and F. Luo, "Rigidity of polyhedral surfaces III", 2011; flips after A. Bobenko and C. Lutz, "Decorated
        discrete conformal maps and convex polyhedral cusps", 2023: as first published, on the input's own triangles, a
        solution need not exist.
    """
    solved = exact_metric(
        mesh,
        lengths,
        np.where(mesh.is_boundary_vertex, 0.0, solution.target),
        fixed=mesh.is_boundary_vertex,
        start=solution.log_scale,
        kind=PackingProblem,
    )
    failure = None
    if not solved.converged:
        broken = int(is_broken(solved.triangulation.length.reshape(-1, 3)).sum())
        failure = (
            f"the Ricci flow did not converge: after {plural(solved.steps, 'step')} the curvature is "
            f"{off_by(solved.residual)}, and {plural(broken, 'triangle')} broke the triangle inequality"
        )
    return at_own_area(
        mesh,
        lengths,
        solution,
        solved,
        failure_notes(failure, best_effort and bool(np.isfinite(solved.residual))),
    )


@dataclass(eq=False)
class PackingProblem(ConformalProblem):
    """Find u, so that circles of radii g_i exp(u_i) with the inversive distances of the input have the curvature.

    K(u) - target is the gradient of the Ricci energy (Jin, Kim, Gu 2007), convex for disjoint circles (Guo 2011;
    Luo 2011), whose Hessian is the Laplacian with the weights h / l of the radical centres. Flipped to weighted
    Delaunay by flips that keep the inversive distances, it has a minimum for all curvatures that sum to what
    they must (Bobenko, Lutz 2023).

    Attributes:
        radii: (n,) g, model units; set by `prepare`, from when on the triangulation has inversive distances for
            lengths.
    """

    radii: FloatArray = field(default_factory=lambda: np.empty(0))

    def prepare(self, delaunay: bool, flipped: IntArray | None = None) -> int:
        """Put circles on the input, made Delaunay and then weighted Delaunay, if so wanted; return the number of flips.

        Neither changes the surface, and circles in the triangles around their centres do not overlap whatever
        the triangles.
        """
        flips = super().prepare(delaunay, flipped)
        self.radii = packed_radii(self.triangulation.length.reshape(-1, 3), self.triangulation.faces)
        if delaunay:
            self.records.append(make_delaunay(self.triangulation, radii=self.radii))
            flips += len(self.records[-1])
        one, two = self._ends(self.radii)
        gap, both = self.triangulation.length - (one + two), self.triangulation.length + (one + two)
        self.triangulation.length = 1 + gap * both / (2 * (one * two))
        return flips

    def flat_lengths(self, log_scale: FloatArray) -> FloatArray:
        """Return (3m,) the lengths for the radii, the same bits on both sides of an edge."""
        one, two = self._ends(self.radii * np.exp(log_scale))
        product = one * two
        lengths: FloatArray = np.sqrt((one**2 + two**2) + 2 * self.triangulation.length * product)
        return lengths

    def sum_angles(self, log_scale: FloatArray, sums: FloatArray, cots: FloatArray) -> int:
        """Fill the (n,) angle sums and (3m,) weights for the radii; return the number of broken triangles."""
        radii = self.radii * np.exp(centred(log_scale))
        return sum_packing_angles(self.triangulation.tail, self.triangulation.length, radii, sums, cots)

    def flip(self, log_scale: FloatArray, suspects: IntArray) -> IntArray:
        """Flip to weighted Delaunay for the radii, from some half-edges; return the half-edges flipped."""
        radii = self.radii * np.exp(centred(log_scale))
        return make_delaunay(self.triangulation, radii=radii, has_lengths=False, suspects=suspects)

    def _ends(self, radii: FloatArray) -> tuple[FloatArray, FloatArray]:
        tail = self.triangulation.tail
        return radii[tail], radii[tail.reshape(-1, 3)[:, NEXT].ravel()]


def packed_radii(lengths: FloatArray, faces: IntArray) -> FloatArray:
    """Return (n,) the radii of circles at the vertices of which no two of a triangle overlap.

    Each is the least, over the triangles around, of the radius in the packing of the triangle's three tangent circles,
    (l_ij + l_ki - l_jk) / 2: inversive distances are 1 and more.
    """
    radii = np.full(int(faces.max()) + 1, np.inf)
    np.minimum.at(radii, faces.ravel(), slacks(lengths).ravel() / 2)
    return radii


@compiled
def sum_packing_angles(
    tail: IntArray, inversive: FloatArray, radius: FloatArray, angle_sum: FloatArray, weights: FloatArray
) -> int:
    """Fill the angle sum at each vertex and twice the derivative of angles opposite each half-edge.

    With circles of radii g about the corners, raising log g_j turns the angle at i by h_k / l_k, where h_k is the
    height of the radical centre over the side between them (Guo 2011; Glickenstein 2011):

        2 h_k / l_k = cot a_k + (g_i^2 cot a_j + g_j^2 cot a_i) / l_k^2 - g_k^2 / (2 A)

    Where the triangle inequality is broken the angles are pi and 0, as in the convex extension of the energy
    (Luo, "Rigidity of polyhedral surfaces III", 2011), and there are no weights. Returns the number of broken
    triangles.
    """
    broken = 0
    angle_sum[:] = 0.0
    for h in range(0, len(tail), 3):
        # The corner opposite side i is at the tail of side i + 2.
        j, k, i = tail[h], tail[h + 1], tail[h + 2]
        largest = max(radius[i], radius[j], radius[k])
        gi, gj, gk = radius[i] / largest, radius[j] / largest, radius[k] / largest
        a = math.sqrt(gj * gj + gk * gk + 2 * inversive[h] * (gj * gk))
        b = math.sqrt(gk * gk + gi * gi + 2 * inversive[h + 1] * (gk * gi))
        c = math.sqrt(gi * gi + gj * gj + 2 * inversive[h + 2] * (gi * gj))
        is_broken, root, cot_i, cot_j, cot_k = add_angles(i, j, k, a, b, c, angle_sum)
        if is_broken:
            broken += 1
            weights[h] = weights[h + 1] = weights[h + 2] = 0.0
            continue
        gi, gj, gk = gi * gi, gj * gj, gk * gk
        weights[h] = cot_i + (gj * cot_k + gk * cot_j) / (a * a) - 2 * gi / root
        weights[h + 1] = cot_j + (gk * cot_i + gi * cot_k) / (b * b) - 2 * gj / root
        weights[h + 2] = cot_k + (gi * cot_j + gj * cot_i) / (c * c) - 2 * gk / root
    return broken
