"""Boundary first flattening (R. Sawhney, K. Crane 2017)."""

from __future__ import annotations

import numpy as np

from coneflat import TriangleMesh
from coneflat.base import ComplexArray, FloatArray, IntArray
from coneflat.cones import GroundedLaplacian
from coneflat.geometry import angle_defect, corner_angles, cotangent_laplacian, cotangents
from coneflat.layout import closed_chain
from coneflat.metric import linear_flat_metric
from coneflat.stages import ConeSolution, Cut, Embedding, FlatMetric

from .disk_maps import embedding_metric

# Largest relative change of lengths, root mean square, for which both sides of a seam get equal lengths. Equal lengths
# have little effect on the gap of the curve if the two sides are nearly parallel; they then get separate lengths.
MAX_CHANGE = 0.1


def boundary_first(mesh: TriangleMesh, lengths: FloatArray, solution: ConeSolution) -> FlatMetric:
    """Return the boundary first flattening for given cones.

    Args:
        mesh: a connected mesh.
        lengths: (m, 3) side lengths, model units.
        solution: cones and the linear log conformal factor, which solves the discrete Cherrier problem of the paper:
            L u is target minus curvature at inner vertices, u = 0 on the boundary.

    Raises:
        MetricError: scales differ so much that lengths overflow.

    References:
        R. Sawhney, K. Crane, "Boundary first flattening", 2017.
    """
    scaled = linear_flat_metric(mesh, lengths, solution, "mean").flat_lengths
    assert scaled is not None

    def embed(cut: Cut) -> Embedding:
        """Return the harmonic extension of the boundary curve in both coordinates, as in the paper for cones.

        This preserves the curve, so that both sides of seams are equal, but increases angle distortion. The other
        extension, by a conjugate harmonic function (used in the paper for free boundaries), needs another
        factorization. Measured mean QC distortion and seam mismatch: fandisk 1.063, 0 and 1.034, 0.026; bunny 1.056, 0
        and 1.029, 0.054. Without seams the results are similar: a face 1.02676 and 1.02675.
        """
        disk = cut.mesh
        border = disk.boundary_walks()[0]
        inside = HarmonicExtension(disk, lengths)
        log_scale = np.empty(len(disk.vertices))
        log_scale[disk.faces] = solution.log_scale[mesh.faces]
        tangents = np.exp(1j * np.cumsum(inside.boundary_curvature(log_scale)[disk.tails[border]]))
        target_lengths = scaled.ravel()[border]
        # Half-edges have the same numbers in the cut mesh: both sides of a seam belong to one original edge.
        closing_lengths = best_fit_lengths(
            target_lengths, lengths.ravel()[border], tangents, mesh.halfedge_edges[border]
        )
        corners = closed_chain(closing_lengths * tangents)
        # A very large change of lengths can reverse the orientation of the curve.
        if (np.conj(corners) * np.roll(corners, -1)).sum().imag < 0:
            corners = np.conj(corners)
        curve = np.zeros((2, len(disk.vertices)))
        curve[:, disk.tails[border]] = corners.real, corners.imag
        points = np.stack([inside.extend(curve[0]), inside.extend(curve[1])], axis=1)
        notes: tuple[str, ...] = ()
        change = float(np.abs(closing_lengths / target_lengths - 1).max())
        if change > 0.01:
            notes = (
                f"Boundary lengths were changed by up to {100 * change:,.1f} %, because with those of the linear scale "
                "factors the boundary does not close.",
            )
        return Embedding(points, notes=notes)

    return embedding_metric(mesh, lengths, solution, embed)


class HarmonicExtension:
    """The Laplacian of a disk with its inner block factorized.

    Args:
        disk: a topological disk.
        lengths: (m, 3) side lengths; every triangle has area.
    """

    def __init__(self, disk: TriangleMesh, lengths: FloatArray) -> None:
        self._is_boundary = disk.is_boundary_vertex
        self._laplacian = cotangent_laplacian(disk.faces, cotangents(lengths), len(disk.vertices))
        self._curvature = angle_defect(disk.faces, corner_angles(lengths), self._is_boundary)
        self._inverse = GroundedLaplacian(self._laplacian, self._is_boundary)

    def extend(self, values: FloatArray, source: FloatArray | float = 0.0) -> FloatArray:
        """Return (n,) the solution x with given values on the boundary and L x = source at inner vertices."""
        fixed = np.where(self._is_boundary, values, 0.0)
        return fixed + self._inverse.solve(source - self._laplacian @ fixed)

    def boundary_curvature(self, log_scale: FloatArray) -> FloatArray:
        """Return (n,) the boundary curvature for given log conformal factors on the boundary and flat inner vertices.

        This is k + L u with L u = -K at inner vertices: the Dirichlet-to-Neumann map of the paper (Poincare-Steklov
        operator), for the discrete Cherrier formula.
        """
        u = self.extend(log_scale, -self._curvature)
        return self._curvature + self._laplacian @ u


def best_fit_lengths(
    targets: FloatArray, lengths: FloatArray, tangents: ComplexArray, edge: IntArray
) -> FloatArray:
    """Return (b,) the lengths closest to target lengths for which a curve with given tangents closes.

    They minimise the sum of the squared change divided by the length on the mesh, subject to sum of length times
    tangent = 0 (the best fit curve of the paper, Section 4.3). Both sides of a seam get the same length if this is
    possible without a large change.

    Args:
        targets: (b,) target lengths.
        lengths: (b,) lengths on the mesh.
        tangents: (b,) complex numbers of absolute value 1.
        edge: (b,) the edge of the mesh to which each side belongs.
    """
    _, joint = np.unique(edge, return_inverse=True)
    joint_lengths = _closing_lengths(targets, lengths, tangents, joint)
    if np.average((joint_lengths / targets - 1) ** 2, weights=targets) <= MAX_CHANGE**2:
        return joint_lengths
    return _closing_lengths(targets, lengths, tangents, np.arange(len(edge)))


def _closing_lengths(
    targets: FloatArray, lengths: FloatArray, tangents: ComplexArray, edge: IntArray
) -> FloatArray:
    """Return (b,) the closing lengths l - N^-1 T^t (T N^-1 T^t)^-1 T l with N = 1 / length and T the tangents."""
    inverse_mass = 1 / np.bincount(edge, 1 / lengths)
    effect = np.stack([np.bincount(edge, tangents.real), np.bincount(edge, tangents.imag)])
    gap = np.array([(targets * tangents.real).sum(), (targets * tangents.imag).sum()])
    # Two sides of a seam that differ by a translation have no effect on the gap; if all do, there is no gap. Directions
    # in which the effect is below 1e-10 of the largest possible one are ignored.
    system = (effect * inverse_mass) @ effect.T
    strength, axes = np.linalg.eigh(system)
    is_effective = strength > 1e-10 * inverse_mass.sum()
    force = axes[:, is_effective] @ (axes.T[is_effective] @ gap / strength[is_effective])
    change: FloatArray = inverse_mass * (force @ effect)
    return targets - change[edge]
