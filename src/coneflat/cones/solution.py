"""Linear systems for the log conformal factor of cones, and checks of the curvatures of cones."""

from __future__ import annotations

import math

import numpy as np
from scipy.sparse import csc_matrix

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..base.text import plural
from ..errors import CurvatureError
from ..linalg import Factor, factorize
from ..mesh.connectivity import TriangleMesh
from ..stages import ConeSolution, ConeSpec

# Values with at most this relative difference, or difference in radians, are equal. Symmetric surfaces have many values
# that differ by rounding only; the first in the order of vertices is then chosen.
TIE_TOLERANCE = 1e-9


class GroundedLaplacian:
    """The Laplacian with zero Dirichlet conditions at a set of vertices, factorized once."""

    def __init__(self, laplacian: csc_matrix, grounded: BoolArray) -> None:
        self._free = np.flatnonzero(~grounded)
        self._factor: Factor = factorize(csc_matrix(laplacian[self._free][:, self._free]))
        self._count = len(grounded)

    def solve(self, source: FloatArray) -> FloatArray:
        """Return (n,) the solution phi of L phi = source (n,), with phi = 0 at the grounded vertices."""
        phi = np.zeros(self._count)
        phi[self._free] = self._factor.solve(source[self._free])
        return phi

    def green(self, vertex: int) -> FloatArray:
        """Return (n,) the Green's function g of a vertex: L g is 1 there and 0 at all others that are not grounded."""
        source = np.zeros(self._count)
        source[vertex] = 1.0
        return self.solve(source)


def target_from_log_scale(
    laplacian: csc_matrix, curvature: FloatArray, log_scale: FloatArray, is_singular: BoolArray
) -> FloatArray:
    """Return (n,) the curvature that the singular vertices absorb: K + L phi there, 0 elsewhere.

    This is Eq. 2-5 of the paper, the limit of its absorbing random walk, if L phi = -K at the other vertices.

    Args:
        laplacian: (n, n) cotangent Laplacian L.
        curvature: (n,) angle defect K, radians.
        log_scale: (n,) phi.
        is_singular: (n,) mask of the cones, and of the boundary.
    """
    return np.where(is_singular, curvature + laplacian @ log_scale, 0.0)


def check_solution(solution: ConeSolution, mesh: TriangleMesh, spec: ConeSpec, advice: str) -> None:
    """Raise CurvatureError if no metric of a mesh has the cones of a solution.

    Args:
        solution: the cones.
        mesh: connected mesh.
        spec: what is required of the cones.
        advice: the end of the message: what the user can do.
    """
    if spec.scale_at_cones:
        check_enough(len(solution.cones), mesh)
    else:
        check_feasible(solution.cones, solution.curvatures, spec.names, advice)


def check_feasible(cones: IntArray, curvatures: FloatArray, names: IntArray, advice: str) -> None:
    """Raise CurvatureError if a cone has a curvature of 2 pi or more, which is impossible in any metric.

    Args:
        cones, curvatures: (s,) vertices and radians.
        names: (n,) vertex numbers of the input, for the message.
        advice: the end of the message: what the user can do.
    """
    bad = np.flatnonzero(curvatures >= math.tau * (1 - 1e-12))
    if len(bad):
        worst = bad[np.argmax(curvatures[bad])]
        raise CurvatureError(
            f"{plural(len(bad), 'cone')} with a curvature of 2 pi or more, which no metric has: "
            f"vertex {names[cones[worst]]} has {curvatures[worst] / np.pi:.4f} pi; {advice}"
        )


def check_enough(count: int, mesh: TriangleMesh) -> None:
    """Raise CurvatureError if `count` cones of less than 2 pi each cannot absorb the curvature of a closed mesh."""
    total = 2 * mesh.euler_characteristic
    if not mesh.is_boundary_vertex.any() and total >= 2 * max(count, 1):
        raise CurvatureError(
            f"{plural(count, 'cone')} cannot absorb this closed surface's total curvature of {total} pi, as each has "
            f"less than 2 pi: {total // 2 + 1} or more are needed"
        )
