"""The paper's cone search (Section 3.2): add the extrema of phi until phi is nearly constant."""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg import solve_triangular
from scipy.sparse import csc_matrix

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..base.progress import report_detail
from ..errors import OptionError
from ..mesh.ties import argmax_tied
from ..stages import ConeSolution
from .prescribed import cones_at
from .solution import GroundedLaplacian, target_from_log_scale

# Range of the log conformal factor at which the search of the paper ends.
EPSILON = 1.0


def greedy_cones(
    laplacian: csc_matrix,
    curvature: FloatArray,
    is_boundary: BoolArray,
    euler_characteristic: int,
    *,
    epsilon: float = EPSILON,
    max_cones: int | None = None,
    tie_key: FloatArray | None = None,
) -> ConeSolution:
    """Return cones of a connected mesh by the greedy search of the paper (Section 3.2).

    The boundary, if there is one, has phi = 0 and absorbs curvature, as the cones do. While a cone has a curvature of
    2 pi or more, cones are added even if the range of phi is below epsilon. `check_feasible` detects such cones if
    `max_cones` was reached before.

    Args:
        laplacian: (n, n) cotangent Laplacian.
        curvature: (n,) angle defect, radians.
        is_boundary: (n,) mask.
        euler_characteristic: chi of the mesh.
        epsilon: stop when max(phi) - min(phi) is at most this.
        max_cones: stop at this number of cones; None for no limit.
        tie_key: (n,) decides between vertices whose values are equal up to rounding, as on symmetric meshes.

    Raises:
        OptionError: epsilon is not positive, or max_cones is negative.
        CurvatureError: `max_cones` is 0 for a closed surface that is not a torus.

    Notes:
        phi solves the Dirichlet problem L phi = -K with phi = 0 at the cones S, and the target curvature of S is
        K + L phi (Eq. 1-5 of the paper, see `target_from_log_scale`). Starting from the vertex of largest curvature
        (of most negative, if chi < 0), the vertices of largest and smallest phi become cones until their difference is
        at most epsilon. The Laplacian is factorized once: a cone s adds one solve for its Green's function g_s, which
        is made to vanish at the earlier cones, and phi -= g_s phi_s / g_s(s).

    See Also:
        ConeSearch: fewer cones for a bound on the area distortion.
        cones_at: the same problem for given cones.
    """
    if not epsilon > 0:
        raise OptionError(f"epsilon must be positive, got {epsilon:g}")
    if max_cones is not None and max_cones < 0:
        raise OptionError(f"the maximum number of cones cannot be negative ({max_cones})")
    if max_cones == 0:
        none = np.empty(0, dtype=np.int64)
        return cones_at(laplacian, curvature, is_boundary, euler_characteristic, none)
    search = _Search(laplacian, curvature, is_boundary, euler_characteristic, max_cones, tie_key)
    while True:
        report_detail(f"{len(search.cones)} so far, spread {np.ptp(search.phi):.3g}")
        chosen = search.next_pair(epsilon)
        if not chosen:
            break
        search.add(chosen)
    return search.solution()


# Largest number of cached Green's functions. Using more would cost more than a new factorization.
MAX_COLUMNS = 256


class _Search:
    """The state of the search: phi, and for each cone a Green's function that vanishes at all earlier cones."""

    def __init__(
        self,
        laplacian: csc_matrix,
        curvature: FloatArray,
        is_boundary: BoolArray,
        euler_characteristic: int,
        max_cones: int | None,
        tie_key: FloatArray | None,
    ) -> None:
        self.tie_key = np.zeros(len(curvature)) if tie_key is None else tie_key
        self.laplacian = laplacian
        self.curvature = curvature
        self.is_singular = is_boundary.copy()
        self.limit = len(curvature) if max_cones is None else max_cones
        self.cones: list[int] = []
        grounded = is_boundary.copy()
        self.floating = not is_boundary.any() and euler_characteristic == 0
        if not is_boundary.any():
            sign = -1.0 if euler_characteristic < 0 else 1.0
            pin = argmax_tied(sign * curvature, self.tie_key)
            grounded[pin] = True
            if not self.floating:
                self._mark(pin)
        self.grounded = GroundedLaplacian(laplacian, grounded)
        self.phi = self.grounded.solve(-curvature)
        # Columns span the Green's functions of the cones, except those of the cones that are grounded.
        self.columns = np.empty((len(curvature), 16), order="F")
        self.anchors: list[int] = []
        self.reference: tuple[int, FloatArray] | None = None

    def _mark(self, vertex: int) -> None:
        self.cones.append(vertex)
        self.is_singular[vertex] = True

    def next_pair(self, epsilon: float) -> list[int]:
        """Return the vertices of largest and smallest phi; empty at the end of the search."""
        top, bottom = argmax_tied(self.phi, self.tie_key), argmax_tied(-self.phi, self.tie_key)
        remaining = self.limit - len(self.cones)
        if self.floating:
            # On a torus, a single cone has curvature 0 and no effect, so two are added or none.
            return [top, bottom] if remaining >= 2 and self.phi[top] - self.phi[bottom] > epsilon else []
        if self.phi[top] - self.phi[bottom] <= epsilon and (self._target()[self.cones] < math.tau).all():
            return []
        pair = [v for v in (top, bottom) if not self.is_singular[v]]
        pair.sort(key=lambda v: -abs(self.phi[v]))
        return pair[: max(remaining, 0)]

    def _target(self) -> FloatArray:
        return target_from_log_scale(self.laplacian, self.curvature, self.phi, self.is_singular)

    def add(self, vertices: list[int]) -> None:
        """Add vertices to the cones, and update phi so that it vanishes there."""
        if self.floating:
            self._ground_pair(*vertices)
            return
        for vertex in vertices:
            self._append(vertex, self._green(vertex))

    def _ground_pair(self, first: int, second: int) -> None:
        """Add the first two cones of a torus: phi must have the same value at both."""
        self.floating = False
        self.reference = (first, self.grounded.green(first))
        self.phi -= self.phi[first]
        self._mark(first)
        self._append(second, self._green(second))

    def _green(self, vertex: int) -> FloatArray:
        """Return (n,) the Green's function of a vertex that vanishes at grounded vertices and at all cones."""
        g = self.grounded.green(vertex)
        if self.reference is not None:
            # The grounded vertex is changed to the first cone: L (g - h) = e_vertex - e_first.
            first, h = self.reference
            g = g - h - (g[first] - h[first])
        if self.anchors:
            # Column k vanishes at the earlier cones, so the matrix of values at the cones is triangular.
            columns = self.columns[:, : len(self.anchors)]
            coefficients = solve_triangular(columns[self.anchors], g[self.anchors], lower=True)
            g = g - columns @ coefficients
        return g

    def _append(self, vertex: int, g: FloatArray) -> None:
        self.phi -= g * (self.phi[vertex] / g[vertex])
        self._mark(vertex)
        self.phi[self.cones] = 0.0  # otherwise rounding errors there would enter max - min
        if len(self.anchors) == MAX_COLUMNS:
            # The Laplacian is grounded at all cones so far, which makes the cached columns unnecessary.
            self.grounded = GroundedLaplacian(self.laplacian, self.is_singular)
            self.phi = self.grounded.solve(-self.curvature)
            self.anchors, self.reference = [], None
            return
        if len(self.anchors) == self.columns.shape[1]:
            self.columns = np.asfortranarray(np.hstack([self.columns, np.empty_like(self.columns)]))
        self.columns[:, len(self.anchors)] = g
        self.anchors.append(vertex)

    def solution(self) -> ConeSolution:
        cones: IntArray = np.array(self.cones, dtype=np.int64)
        return ConeSolution(cones, self._target(), self.phi)
