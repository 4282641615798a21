"""The paper's cone search (Section 3.2): add the extrema of phi until phi is nearly constant."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import solve_triangular
from scipy.sparse import csc_matrix

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..errors import CurvatureError, OptionError
from ..mesh.ties import argmax_tied
from ..stages import ConeSolution
from .solution import FULL_TURN, GroundedLaplacian, target_from_log_scale

# Variation of the log of the scale that the published search ends at.
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
    progress: Callable[[str], None] | None = None,
) -> ConeSolution:
    """Find cones for a connected mesh by the greedy search of the paper.

    The boundary, if there is one, is held at phi = 0 and absorbs curvature, as the cones do. Cones of
    2 pi and more are split further whatever epsilon says; `check_feasible` tells if max_cones left any.

    Args:
        laplacian: (n, n) cotangent Laplacian.
        curvature: (n,) angle defect, radians.
        is_boundary: (n,) mask.
        euler_characteristic: chi of the mesh.
        epsilon: stop when max(phi) - min(phi) is at most this.
        max_cones: stop at this many cones; None for no limit.
        tie_key: (n,) decides between vertices that are equal but for rounding, as on symmetric meshes.
        progress: called with how far the search is, before each step.

    Raises:
        OptionError: epsilon is not positive, or max_cones is negative.
        CurvatureError: a closed surface that is not a torus is allowed no cone.
    """
    if not epsilon > 0:
        raise OptionError(f"epsilon must be positive, not {epsilon:g}")
    if max_cones is not None and max_cones < 0:
        raise OptionError(f"the maximum number of cones cannot be negative ({max_cones})")
    search = _Search(laplacian, curvature, is_boundary, euler_characteristic, max_cones, tie_key)
    while True:
        if progress is not None:
            progress(f"{len(search.cones)} so far, spread {np.ptp(search.phi):.3g}")
        chosen = search.next_pair(epsilon)
        if not chosen:
            break
        search.add(chosen)
    return search.solution()


# Green's functions that are kept. More would cost more than the factorization that makes them needless.
MAX_COLUMNS = 256


class _Search:
    """The state of the search: phi, and Green's functions that vanish at every earlier cone."""

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
                self._require_cone(euler_characteristic)
                self._mark(pin)
        self.grounded = GroundedLaplacian(laplacian, grounded)
        self.phi = self.grounded.solve(-curvature)
        # Columns span the Green's functions of the cones, the first ones excepted that ground them.
        self.columns = np.empty((len(curvature), 16), order="F")
        self.anchors: list[int] = []
        self.reference: tuple[int, FloatArray] | None = None

    def _require_cone(self, euler_characteristic: int) -> None:
        if self.limit == 0:
            raise CurvatureError(
                f"a closed surface of Euler characteristic {euler_characteristic} has a total curvature of "
                f"{2 * euler_characteristic} pi and needs cones to carry it, but at most 0 are allowed"
            )

    def _mark(self, vertex: int) -> None:
        self.cones.append(vertex)
        self.is_singular[vertex] = True

    def next_pair(self, epsilon: float) -> list[int]:
        """Return the vertices of largest and smallest phi, or nothing when the search is over."""
        top, bottom = argmax_tied(self.phi, self.tie_key), argmax_tied(-self.phi, self.tie_key)
        remaining = self.limit - len(self.cones)
        if self.floating:
            # On a torus one cone alone has curvature 0 and does nothing: two, or none.
            return [top, bottom] if remaining >= 2 and self.phi[top] - self.phi[bottom] > epsilon else []
        if self.phi[top] - self.phi[bottom] <= epsilon and self._is_feasible():
            return []
        pair = [v for v in (top, bottom) if not self.is_singular[v]]
        pair.sort(key=lambda v: -abs(self.phi[v]))
        return pair[: max(remaining, 0)]

    def _is_feasible(self) -> bool:
        return bool((self._target()[self.cones] < FULL_TURN).all())

    def _target(self) -> FloatArray:
        return target_from_log_scale(self.laplacian, self.curvature, self.phi, self.is_singular)

    def add(self, vertices: list[int]) -> None:
        """Make vertices cones, and phi zero on them."""
        if self.floating:
            self._ground_pair(*vertices)
            return
        for vertex in vertices:
            self._append(vertex, self._green(vertex))

    def _ground_pair(self, one: int, two: int) -> None:
        """Make the first two cones of a torus: they must agree in phi, at whatever value."""
        self.floating = False
        self.reference = (one, self.grounded.green(one))
        self.phi -= self.phi[one]
        self._mark(one)
        self._append(two, self._green(two))

    def _green(self, vertex: int) -> FloatArray:
        """Return the Green's function of a vertex that vanishes at the ground and at all cones."""
        g = self.grounded.green(vertex)
        if self.reference is not None:
            # The ground moves from the pin to the first cone: L (g - h) = e_vertex - e_first.
            first, h = self.reference
            g = g - h - (g[first] - h[first])
        if self.anchors:
            # Column k vanishes at the cones before it, so the values at the cones are triangular.
            columns = self.columns[:, : len(self.anchors)]
            coefficients = solve_triangular(columns[self.anchors], g[self.anchors], lower=True)
            g = g - columns @ coefficients
        return g

    def _append(self, vertex: int, g: FloatArray) -> None:
        self.phi -= g * (self.phi[vertex] / g[vertex])
        self._mark(vertex)
        self.phi[self.cones] = 0.0  # rounding left there would enter max - min
        if len(self.anchors) == MAX_COLUMNS:
            self._ground_all()
            return
        if len(self.anchors) == self.columns.shape[1]:
            self.columns = np.asfortranarray(np.hstack([self.columns, np.empty_like(self.columns)]))
        self.columns[:, len(self.anchors)] = g
        self.anchors.append(vertex)

    def _ground_all(self) -> None:
        """Start over from all cones so far: one more factorization, and the columns are free again."""
        self.grounded = GroundedLaplacian(self.laplacian, self.is_singular)
        self.phi = self.grounded.solve(-self.curvature)
        self.anchors, self.reference = [], None

    def solution(self) -> ConeSolution:
        cones: IntArray = np.array(self.cones, dtype=np.int64)
        return ConeSolution(cones, self._target(), self.phi)
