"""The biharmonic kernel on a coarse basis, as a dense matrix; cones are searched on it first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack
from scipy.sparse import csr_matrix

from ...base.arrays import FloatArray, IntArray
from ...errors import MetricError
from ..solution import TIE_TOLERANCE
from .aggregation import coarse_basis, representatives
from .green import GreenOperator


@dataclass(frozen=True, eq=False)
class CoarseModel:
    """The kernel G A G on a coarse basis.

    Attributes:
        basis: (f, m) the m basis functions.
        kernel: (m, m) G A G between basis functions.
        slope: (m,) minus the kernel times the curvature, so that E^2 = constant + 2 slope k + k kernel k.
        constant: E^2 without cones.
    """

    basis: csr_matrix
    kernel: FloatArray
    slope: FloatArray
    constant: float

    @property
    def size(self) -> int:
        """The number of basis functions."""
        return len(self.slope)

    def at(self, unknowns: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return the kernel (k, k) and the slope (k,) at k unknowns of the mesh."""
        rows = self.basis[unknowns]
        return np.asarray((rows @ (rows @ self.kernel).T).T), np.asarray(rows @ self.slope)

    def scaled_to(self, constant: float) -> CoarseModel:
        """Return the model scaled to a given E^2 without cones.

        Aggregation makes the Laplacian too stiff, by a factor that is nearly the same for all smooth functions, so one
        scale factor removes most of the error.
        """
        # On a surface of constant curvature, E is 0 and gives no scale.
        scale = constant / self.constant if min(constant, self.constant) > TIE_TOLERANCE**2 else 1.0
        return CoarseModel(self.basis, self.kernel * scale, self.slope * scale, constant)


def coarse_model(operator: GreenOperator, curvature: FloatArray, size: int) -> CoarseModel:
    """Return a coarse model of a mesh, computed without a factorization of its Laplacian.

    Args:
        operator: the Green operator of the mesh.
        curvature: (f,) curvature of the unknowns, radians.
        size: approximate number of basis functions.
    """
    basis, laplacian, mass = coarse_basis(operator.laplacian, operator.areas, size)
    weights = basis.T @ operator.areas
    stiffness = laplacian.toarray()
    if operator.is_closed:
        # This makes the matrix definite without changing the result, as the sum of a source is subtracted from it in
        # proportion to area.
        stiffness += np.outer(weights, weights) * (stiffness.trace() / (weights @ weights) / len(weights))
    green = inverse_of_definite(stiffness)
    kernel, mean = green @ (mass @ green), green @ weights
    kernel = (kernel + kernel.T) / 2 - np.outer(mean, mean)
    bare = basis.T @ curvature
    slope = -(kernel @ bare)
    return CoarseModel(basis, kernel, slope, float(-(slope @ bare)))


def candidates(model: CoarseModel, fitness: FloatArray) -> IntArray:
    """Return the unknowns that are candidates for cones: at most one for each basis function.

    `fitness` (f,) is 0 for unknowns that may not be cones; those of larger fitness are preferred to their neighbours.
    """
    if np.count_nonzero(fitness) <= model.size:
        return np.flatnonzero(fitness)
    return representatives(model.basis, fitness)


def inverse_of_definite(matrix: FloatArray) -> FloatArray:
    """Return the inverse of a dense symmetric positive definite matrix.

    Raises:
        MetricError: rounding has made it indefinite.
    """
    # In column-major order, as LAPACK requires; otherwise it would copy the matrix.
    factor, failed = lapack.dpotrf(matrix.T.copy(order="F"), lower=0, overwrite_a=1)
    if failed:
        raise MetricError(
            f"the coarse Laplacian of {len(matrix)} unknowns is not positive definite: the mesh has triangles too "
            "thin for double precision; remesh them, or run with --repair"
        )
    half, _ = lapack.dpotri(factor, lower=0, overwrite_c=1)  # the upper triangle; below are zeros
    inverse: FloatArray = half + half.T
    inverse[np.diag_indices(len(inverse))] /= 2
    return inverse
