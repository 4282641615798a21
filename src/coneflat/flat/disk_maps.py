"""Maps of a disk that prescribe no cones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy.sparse import csr_matrix, diags
from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

from .._arrays import ComplexArray, FloatArray, IntArray
from ..cones import ConeSolution
from ..errors import ConvergenceError, MetricError
from ..geometry import corner_angles, double_areas
from ..layout.least_squares import far_pins, pinned_least_squares
from ..mesh import TriangleMesh
from ..solver import HermitianFactor
from ..text import plural
from .base import LaidOut, laid_out_at

Place: TypeAlias = Callable[[TriangleMesh, FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class CutFirst:
    """A map of the mesh, cut open, that takes no notice of what was cut and of what cones should have.

    Attributes:
        name: the method's.
        place: returns (c, 2) points of a disk, at any scale, given its (m, 3) side lengths.
        mesh: the mesh.
        lengths: (m, 3) side lengths, model units.
        solution: the cones, through which the mesh is cut.
    """

    name: str
    place: Place
    mesh: TriangleMesh
    lengths: FloatArray
    solution: ConeSolution

    def lay_out(self, disk: TriangleMesh, seams: IntArray) -> LaidOut:
        """Map the disk, and say so if the mesh is none by itself."""
        notes: tuple[str, ...] = ()
        if len(seams):
            notes = (
                f"The mesh was cut open first, and {self.name} mapped the disk: it prescribes no cones, and the sides "
                "of seams come out as they may.",
            )
        points = self.place(disk, self.lengths)
        return laid_out_at(points, self.mesh, disk, seams, self.lengths, self.solution, notes=notes)


def map_cut_mesh(
    mesh: TriangleMesh,
    lengths: FloatArray,
    solution: ConeSolution,
    best_effort: bool,
    name: str,
    place: Place,
) -> CutFirst:
    """Return the map of a mesh, cut open through its cones, by a method that prescribes none.

    Args:
        mesh: connected.
        lengths: (m, 3) side lengths, model units.
        solution: the cones, which decide where the mesh is cut and no more.
        best_effort: of no meaning here: what is not found is nothing.
        name, place: of the method, see `CutFirst`.
    """
    return CutFirst(name, place, mesh, lengths, solution)


def least_squares_conformal(
    disk: TriangleMesh, lengths: FloatArray, pins: IntArray | None = None
) -> FloatArray:
    """Return (n, 2) the map of a disk that keeps shapes best, in the least squares sense, with two vertices pinned.

    It minimises the energy of Eq. 4 and 5 of the paper. Triangles may be turned over. The pins decide on
    more than place and size: scale varies with them.

    Args:
        disk: a topological disk.
        lengths: (m, 3) side lengths; every triangle has area.
        pins: (2,) the vertices that go to (0, 0) and (1, 0); by default two far apart.

    Raises:
        MetricError: there is no finite solution.
    """
    if pins is None:
        pins = far_pins(disk, lengths)
    z = pinned_least_squares(conformal_equations(disk, lengths), pins)
    if not np.isfinite(z).all():
        raise MetricError(f"the least squares conformal map of {len(disk.faces):,} triangles is not finite")
    return np.stack([z.real, z.imag], axis=1)


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
    border = disk.tails[disk.boundary_walk()]
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
    sides = lengths.ravel()[disk.boundary_walk()]
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


def conformal_equations(mesh: TriangleMesh, lengths: FloatArray) -> csr_matrix:
    """Return the complex (m, n) matrix C that vanishes on maps z to the plane that are similarities on triangles.

    |C z|^2 is the least squares energy of Levy et al. 2002 (Eq. 4): the rows are the sides opposite the corners, as
    complex numbers in a frame of the triangle, over the root of its area. It is scaled so that it equals z^H L_C z,
    twice the Dirichlet energy less the area (Mullen et al. 2008, Section 2.2).

    Args:
        mesh: the mesh.
        lengths: (m, 3) side lengths; every triangle has area.

    Raises:
        MetricError: one has none.
    """
    areas = double_areas(lengths)
    if not (areas > 0).all():
        raise MetricError(
            f"{int((~(areas > 0)).sum())} of {plural(len(areas), 'triangle')} without area have no conformal energy"
        )
    angles = corner_angles(lengths)
    # Walking around a triangle, one turns by the outer angles: side 0 runs ahead, from corner 1 to 2.
    directions = np.stack([np.zeros(len(angles)), np.pi - angles[:, 2], np.pi + angles[:, 1]], axis=1)
    sides = lengths * np.exp(1j * directions) / np.sqrt(2 * areas)[:, None]
    rows = np.repeat(np.arange(len(sides)), 3)
    return csr_matrix((sides.ravel(), (rows, mesh.faces.ravel())), shape=(len(sides), len(mesh.vertices)))
