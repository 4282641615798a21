"""Cones with the linear conformal factor that belongs to them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csc_matrix

from .._arrays import BoolArray, FloatArray, IntArray
from ..errors import CurvatureError
from ..mesh import TriangleMesh
from ..solver import Factor, factorize
from ..text import plural

FULL_TURN = 2 * np.pi


@dataclass(frozen=True, eq=False)
class LaplacianInverse:
    """A factorized Laplacian, as a function of (n,) sources, up to a constant where nothing is held at zero.

    Attributes:
        apply: the function.
        laplacian: (n, n), of all vertices.
        is_zero: (n,) the vertices where its solutions are zero.
        break_even: how many solutions take as long as another factorization.
    """

    apply: Callable[[FloatArray], FloatArray]
    laplacian: csc_matrix
    is_zero: BoolArray
    break_even: int

    def solve(self, right: FloatArray) -> FloatArray:
        """Return (n,) the solution for a source (n,)."""
        return self.apply(right)


@dataclass(frozen=True, eq=False)
class ConeSolution:
    """Cones, target curvatures and the log scale that produces them to first order.

    Attributes:
        cones: (s,) cone vertices, in the order in which they were chosen.
        target: (n,) target curvature, radians: 0 but at cones and on the boundary.
        log_scale: (n,) phi with L phi = target - curvature; constant on cones and boundary where their
            curvature was not prescribed.
        inverse: what solved for the log scale, if it was kept: zero on the boundary, mean-free without one.
    """

    cones: IntArray
    target: FloatArray
    log_scale: FloatArray
    inverse: LaplacianInverse | None = None

    @property
    def curvatures(self) -> FloatArray:
        """(s,) target curvature of each cone, radians."""
        return self.target[self.cones]

    def shifted(self, constant: float) -> ConeSolution:
        """Return the same solution with a constant added to the log scale."""
        return replace(self, log_scale=self.log_scale + constant)


class GroundedLaplacian:
    """The Laplacian held at zero on a set of vertices, factorized once."""

    def __init__(self, laplacian: csc_matrix, grounded: BoolArray) -> None:
        self._free = np.flatnonzero(~grounded)
        self._factor: Factor = factorize(csc_matrix(laplacian[self._free][:, self._free]))
        self._count = len(grounded)

    def solve(self, source: FloatArray) -> FloatArray:
        """Return (n,) phi, zero on the grounded vertices, with L phi = source elsewhere."""
        phi = np.zeros(self._count)
        phi[self._free] = self._factor.solve(source[self._free])
        return phi

    def green(self, vertex: int) -> FloatArray:
        """Return (n,) the Green's function: L g = 1 at `vertex`, zero elsewhere off the ground."""
        source = np.zeros(self._count)
        source[vertex] = 1.0
        return self.solve(source)


def target_from_log_scale(
    laplacian: csc_matrix, curvature: FloatArray, log_scale: FloatArray, is_singular: BoolArray
) -> FloatArray:
    """Return (n,) the curvature absorbed by the singular vertices: K + L phi there, 0 elsewhere.

    This is Eq. 2-5 of the paper, the limit of its absorbing random walk, once L phi = -K off the set.
    """
    target: FloatArray = np.where(is_singular, curvature + laplacian @ log_scale, 0.0)
    return target


def check_feasible(cones: IntArray, curvatures: FloatArray, names: IntArray | None, advice: str) -> None:
    """Raise CurvatureError if a cone has a curvature of 2 pi or more, which no metric has.

    Args:
        cones, curvatures: (s,) vertices and radians.
        names: (n,) what the user calls each vertex.
        advice: what to do about it.
    """
    bad = np.flatnonzero(curvatures >= FULL_TURN * (1 - 1e-12))
    if len(bad):
        worst = bad[np.argmax(curvatures[bad])]
        name = cones[worst] if names is None else names[cones[worst]]
        raise CurvatureError(
            f"{plural(len(bad), 'cone')} with a curvature of 2 pi or more, which no metric has: "
            f"vertex {name} has {curvatures[worst] / np.pi:.4f} pi; {advice}"
        )


def check_enough(count: int, mesh: TriangleMesh) -> None:
    """Raise CurvatureError if so many cones, of less than 2 pi each, cannot carry the curvature of a closed mesh."""
    total = 2 * mesh.euler_characteristic
    if not mesh.is_boundary_vertex.any() and total >= 2 * max(count, 1):
        raise CurvatureError(
            f"{plural(count, 'cone')} cannot carry this closed surface's total curvature of {total} pi, as each has "
            f"less than 2 pi: {total // 2 + 1} or more are needed"
        )
