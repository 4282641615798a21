"""Spectral conformal parameterization (P. Mullen, Y. Tong, P. Alliez, M. Desbrun 2008)."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix, diags
from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

from .._arrays import ComplexArray, FloatArray
from ..conformal.energy import conformal_equations
from ..errors import ConvergenceError, MetricError
from ..layout.boundary_walk import walk_boundary
from ..mesh import TriangleMesh
from ..solver import HermitianFactor

# What is added to the eigenvalues, times the number of vertices on the boundary, so that none is zero: well below that
# of a map which keeps angles but for a thousandth, and enough that factorizations see it.
SHIFT = 1e-7
# Relative accuracy of the eigenvalue, and restarts of the Lanczos iteration, which takes a few.
TOLERANCE, RESTARTS = 1e-13, 300


def spectral_conformal(disk: TriangleMesh, lengths: FloatArray) -> FloatArray:
    """Return (n, 2) the map of a disk with the least conformal energy for the spread of its boundary.

    This is the Fiedler vector of L_C u = lambda B u, where B is one at boundary vertices and zero inside (Section 3 of
    the paper): the eigenvector of the smallest lambda among those whose boundary is centred, found, like there, as that
    of the largest 1 / lambda. No vertex is pinned. Triangles may be turned over.

    Args:
        disk: a topological disk.
        lengths: (m, 3) side lengths; every triangle has area.

    Raises:
        ConvergenceError: the eigenvector was not found.
        MetricError: it is not finite.
    """
    border = disk.tails[walk_boundary(disk)]
    count = len(border)
    equations = conformal_equations(disk, lengths)
    shift = np.zeros(len(disk.vertices))
    shift[border] = SHIFT / count
    factor = HermitianFactor(csr_matrix(equations.conj().T @ equations + diags(shift)))

    def extended(source: ComplexArray, refine: bool = False) -> ComplexArray:
        """Return (n,) the solution for a centred source on the boundary, itself centred there."""
        right = np.zeros(len(shift), dtype=np.complex128)
        right[border] = source - source.mean()
        z = factor.solve(right)
        if refine:
            z += factor.solve(right - shift * z - equations.conj().T @ (equations @ z))
        return z - z[border].mean()

    def apply(parts: FloatArray) -> FloatArray:
        z = extended(parts[:count] + 1j * parts[count:])[border]
        return np.concatenate([z.real, z.imag])

    # Every eigenvalue is there twice, as a map may be turned; which of the turned ones comes out, the start decides.
    sides = lengths.ravel()[walk_boundary(disk)]
    around = 2 * np.pi * (np.cumsum(sides) - sides) / sides.sum()
    start = np.concatenate([np.cos(around), np.sin(around)])
    operator = LinearOperator((2 * count, 2 * count), matvec=apply, dtype=np.float64)
    try:
        _, vectors = eigsh(operator, k=1, which="LA", v0=start, tol=TOLERANCE, maxiter=RESTARTS)
    except ArpackError as error:
        raise ConvergenceError(
            f"the spectral map of {len(disk.faces):,} triangles was not found in {RESTARTS} restarts of the Lanczos "
            "iteration: another cut or method 'lscm' may help"
        ) from error
    z = extended(vectors[:count, 0] + 1j * vectors[count:, 0], refine=True)
    if not np.isfinite(z).all():
        raise MetricError(f"the spectral conformal map of {len(disk.faces):,} triangles is not finite")
    return np.stack([z.real, z.imag], axis=1)
