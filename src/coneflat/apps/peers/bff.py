"""Boundary first flattening (R. Sawhney, K. Crane 2017)."""

from __future__ import annotations

import numpy as np

from ... import TriangleMesh
from ...base import ComplexArray, FloatArray, IntArray
from ...cones import GroundedLaplacian
from ...geometry import angle_defect, corner_angles, cotangent_laplacian, cotangents
from ...layout import closed_chain
from ...metric import linear_flat_metric
from ...stages import ConeSolution, Cut, Embedding, FlatMetric
from .shared import embedding_metric

# Where sides of seams can close the curve together only by a change of this, root mean square and relative, each gets a
# length of its own: together they can do little if they are hardly turned against each other.
LARGEST_CHANGE = 0.1


def boundary_first(mesh: TriangleMesh, lengths: FloatArray, solution: ConeSolution) -> FlatMetric:
    """Return the boundary first flattening for given cones.

    Args:
        mesh: connected.
        lengths: (m, 3) side lengths, model units.
        solution: cones and the linear log scale, which solves the discrete Cherrier problem of the paper: L u is target
            less curvature inside, u = 0 on the boundary.

    Raises:
        MetricError: scales are so far apart that lengths overflow.
    """
    scaled = linear_flat_metric(mesh, lengths, solution, "mean").flat_lengths
    assert scaled is not None

    def embed(cut: Cut) -> Embedding:
        """Find the boundary curve and extend both coordinates harmonically, as the paper does where there are cones.

        This keeps the curve, and with it both sides of seams equal, and pays in angles. The other extension, by a
        conjugate harmonic function (the paper's for free boundaries), needs another factorization. Measured, mean QC
        distortion and seam mismatch: fandisk 1.063, 0 and 1.034, 0.026; bunny 1.056, 0 and 1.029, 0.054. Without
        seams both are alike: a face 1.02676 and 1.02675.
        """
        disk = cut.mesh
        border = disk.boundary_walk()
        inside = HarmonicExtension(disk, lengths)
        log_scale = np.empty(len(disk.vertices))
        log_scale[disk.faces] = solution.log_scale[mesh.faces]
        tangents = np.exp(1j * np.cumsum(inside.boundary_curvature(log_scale)[disk.tails[border]]))
        wanted = scaled.ravel()[border]
        # Half-edges keep their numbers in the cut: both sides of a seam are sides of one edge of the mesh.
        found = best_fit_lengths(wanted, lengths.ravel()[border], tangents, mesh.halfedge_edges[border])
        corners = closed_chain(found * tangents)
        # Far too strong a change turns it inside out.
        if (np.conj(corners) * np.roll(corners, -1)).sum().imag < 0:
            corners = np.conj(corners)
        curve = np.zeros((2, len(disk.vertices)))
        curve[:, disk.tails[border]] = corners.real, corners.imag
        points = np.stack([inside.extend(curve[0]), inside.extend(curve[1])], axis=1)
        notes: tuple[str, ...] = ()
        change = float(np.abs(found / wanted - 1).max())
        if change > 0.01:
            notes = (
                f"The boundary closes after its lengths were changed by up to {100 * change:,.1f} %: with those of the "
                "linear scale factors it does not.",
            )
        return Embedding(points, notes=notes)

    return embedding_metric(mesh, lengths, solution, embed)


class HarmonicExtension:
    """The Laplacian of a disk with its inner block factorized, which serves every step.

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
        """Return (n,) x with given values on the boundary and L x = source inside."""
        fixed = np.where(self._is_boundary, values, 0.0)
        return fixed + self._inverse.solve(source - self._laplacian @ fixed)

    def boundary_curvature(self, log_scale: FloatArray) -> FloatArray:
        """Return (n,) the curvature that scale factors on the boundary lead to there, if there is to be none inside.

        k + L u, with L u = -K inside: the Dirichlet-to-Neumann map of the paper (Poincare-Steklov operator), for the
        discrete Cherrier formula.
        """
        u = self.extend(log_scale, -self._curvature)
        return self._curvature + self._laplacian @ u


def best_fit_lengths(
    wanted: FloatArray, lengths: FloatArray, tangents: ComplexArray, edge: IntArray
) -> FloatArray:
    """Return (b,) the lengths closest to those wanted with which a curve of given tangents closes.

    They minimise the squared change over the length on the mesh, under sum of length times tangent = 0 (the best fit
    curve of the paper, Section 4.3). Both sides of a seam get one length, if that is possible without much change.

    Args:
        wanted: (b,) lengths.
        lengths: (b,) those on the mesh.
        tangents: (b,) unit numbers.
        edge: (b,) the edge of the mesh that each is a side of.
    """
    _, joint = np.unique(edge, return_inverse=True)
    found = _closing_lengths(wanted, lengths, tangents, joint)
    if np.average((found / wanted - 1) ** 2, weights=wanted) <= LARGEST_CHANGE**2:
        return found
    return _closing_lengths(wanted, lengths, tangents, np.arange(len(edge)))


def _closing_lengths(
    wanted: FloatArray, lengths: FloatArray, tangents: ComplexArray, edge: IntArray
) -> FloatArray:
    """Return those for edges numbered from 0; l - N^-1 T^t (T N^-1 T^t)^-1 T l with N = 1 / length, T the tangents."""
    inverse_mass = 1 / np.bincount(edge, 1 / lengths)
    effect = np.stack([np.bincount(edge, tangents.real), np.bincount(edge, tangents.imag)])
    gap = np.array([(wanted * tangents.real).sum(), (wanted * tangents.imag).sum()])
    # Sides that are only shifted against each other cannot open or close anything; where all are, nothing is open.
    # Below 1e-10 of what lengths could do at most, they have no effect in a direction.
    system = (effect * inverse_mass) @ effect.T
    strength, axes = np.linalg.eigh(system)
    kept = strength > 1e-10 * inverse_mass.sum()
    force = axes[:, kept] @ (axes.T[kept] @ gap / strength[kept])
    change: FloatArray = inverse_mass * (force @ effect)
    return wanted - change[edge]
