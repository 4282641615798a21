"""Maps of a disk that prescribe no cones: least squares and spectral conformal maps."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from scipy.sparse import csr_matrix, diags
from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

from ... import TriangleMesh
from ...base import ComplexArray, FloatArray, IntArray, plural
from ...errors import ConvergenceError, MetricError
from ...geometry import corner_angles, double_areas
from ...layout import far_pins, pinned_least_squares
from ...linalg import HermitianFactor
from ...stages import ConeSolution, Cut, Embedding, FlatMetric
from .shared import embedding_metric

Place: TypeAlias = Callable[[TriangleMesh, FloatArray], FloatArray]


def map_cut_mesh(
    mesh: TriangleMesh, lengths: FloatArray, solution: ConeSolution, name: str, place: Place
) -> FlatMetric:
    """Return the map of a mesh, cut open through its cones, by a method that prescribes no cones.

    Args:
        mesh: a connected mesh.
        lengths: (m, 3) side lengths, model units.
        solution: the cones, which only determine the cut.
        name: name of the method.
        place: returns (c, 2) points of a disk, at any scale, given its (m, 3) side lengths.
    """

    def embed(cut: Cut) -> Embedding:
        notes = (
            f"The mesh was cut open first, and {name} mapped the disk: it prescribes no cones, and the sides of seams "
            "do not match.",
        )
        return Embedding(place(cut.mesh, lengths), notes=notes if len(cut.seams) else ())

    return embedding_metric(mesh, lengths, solution, embed, has_target_cones=False)


def least_squares_conformal(
    disk: TriangleMesh, lengths: FloatArray, pins: IntArray | None = None
) -> FloatArray:
    """Return (n, 2) the least squares conformal map (LSCM) of a disk, with two vertices pinned.

    It minimises the energy of Eq. 4 and 5 of the paper (Levy et al. 2002). Triangles may be flipped. The pins affect
    not only position and size, but also the variation of scale.

    Args:
        disk: a topological disk.
        lengths: (m, 3) side lengths; every triangle has area.
        pins: (2,) the vertices that are mapped to (0, 0) and (1, 0); by default two distant ones.

    Raises:
        MetricError: the solution is not finite.
    """
    pins = far_pins(disk, lengths) if pins is None else pins
    z = pinned_least_squares(conformal_equations(disk, lengths), pins)
    if not np.isfinite(z).all():
        raise MetricError(f"the least squares conformal map of {len(disk.faces):,} triangles is not finite")
    return np.stack([z.real, z.imag], axis=1)


# Shift of the eigenvalues, times the number of boundary vertices, so that none is zero: well below the eigenvalue of a
# map with angle errors of a thousandth, and large enough for factorizations.
SHIFT = 1e-7
# Largest number of restarts of the Arnoldi iteration, which normally needs a few.
RESTARTS = 300


def spectral_conformal(disk: TriangleMesh, lengths: FloatArray) -> FloatArray:
    """Return (n, 2) the spectral conformal map of a disk: the least conformal energy for a boundary of unit variance.

    This is the Fiedler vector of L_C u = lambda B u, where B is one at boundary vertices and zero inside (Mullen et al.
    2008, Section 3): the eigenvector of the smallest lambda among those with centred boundary, computed as that of the
    largest 1 / lambda. No vertex is pinned. Triangles may be flipped.

    Args:
        disk: a topological disk.
        lengths: (m, 3) side lengths; every triangle has area.

    Raises:
        ConvergenceError: the eigenvector was not found.
        MetricError: the map is not finite.
    """
    walk = disk.boundary_walk()
    border, sides = disk.tails[walk], lengths.ravel()[walk]
    shift = np.zeros(len(disk.vertices))
    shift[border] = SHIFT / len(border)
    equations = conformal_equations(disk, lengths)
    factor = HermitianFactor(csr_matrix(equations.conj().T @ equations + diags(shift)))

    def centred(source: ComplexArray) -> ComplexArray:
        """Return (n,) a source on the boundary minus its mean, and zero inside."""
        right = np.zeros(len(shift), dtype=np.complex128)
        right[border] = source - source.mean()
        return right

    def apply(source: ComplexArray) -> ComplexArray:
        z = factor.solve(centred(source))[border]
        return z - z.mean()

    # Rotated maps have the same energy; the start vector determines which of them is found.
    start = np.exp(2j * np.pi * (np.cumsum(sides) - sides) / sides.sum())
    operator = LinearOperator((len(border),) * 2, matvec=apply, dtype=np.complex128)
    try:
        _, vectors = eigsh(operator, k=1, which="LM", v0=start, tol=1e-13, maxiter=RESTARTS)
    except ArpackError as error:
        raise ConvergenceError(
            f"the spectral map of {len(disk.faces):,} triangles was not found in {RESTARTS} restarts of the Arnoldi "
            "iteration: another cut or method 'lscm' may help"
        ) from error
    right = centred(vectors[:, 0])
    z = factor.solve(right)
    z += factor.solve(right - shift * z - equations.conj().T @ (equations @ z))
    if not np.isfinite(z).all():
        raise MetricError(f"the spectral conformal map of {len(disk.faces):,} triangles is not finite")
    return np.stack([z.real, z.imag], axis=1)


def conformal_equations(mesh: TriangleMesh, lengths: FloatArray) -> csr_matrix:
    """Return the complex (m, n) matrix C with C z = 0 for maps z to the plane that are similarities on all triangles.

    |C z|^2 is the least squares energy of Levy et al. 2002 (Eq. 4): the rows are the sides opposite the corners, as
    complex numbers in a frame of the triangle, divided by the square root of its area. It is scaled to equal z^H L_C z,
    twice the Dirichlet energy minus the area (Mullen et al. 2008, Section 2.2).

    Args:
        mesh: the mesh.
        lengths: (m, 3) side lengths; every triangle has area.

    Raises:
        MetricError: a triangle has no area.
    """
    areas = double_areas(lengths)
    if not (areas > 0).all():
        raise MetricError(
            f"{int((~(areas > 0)).sum())} of {plural(len(areas), 'triangle')} without area have no conformal energy"
        )
    angles = corner_angles(lengths)
    # The directions of sides differ by the exterior angles; side 0, from corner 1 to 2, has direction 0.
    directions = np.stack([np.zeros(len(angles)), np.pi - angles[:, 2], np.pi + angles[:, 1]], axis=1)
    sides = lengths * np.exp(1j * directions) / np.sqrt(2 * areas)[:, None]
    rows = np.repeat(np.arange(len(sides)), 3)
    return csr_matrix((sides.ravel(), (rows, mesh.faces.ravel())), shape=(len(sides), len(mesh.vertices)))
