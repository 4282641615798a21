"""The angles of a circle pattern: the nearest feasible angles to given ones, by a quadratic program."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, identity

from coneflat.base import BoolArray, FloatArray, IntArray
from coneflat.geometry.intrinsic import IntrinsicTriangulation
from coneflat.linalg import factorize
from coneflat.linalg.newton import Limits, Point, minimise

# Lower bound of an angle: MIN_ANGLE_FRACTION of the given one, at most 0.02 radians and at least MIN_ANGLE.
MIN_ANGLE_FRACTION, MIN_ANGLE = 0.5, 1e-5
# Least intersection angle of circles, radians. It also applies to the two coincident circumcircles of an inscribed
# quad. The smaller it is, the worse conditioned the equations are.
MIN_MEETING = 1e-4
# The largest sum of angles opposite an edge.
WIDEST_PAIR = np.pi - MIN_MEETING
# Stopping criteria: largest error of a sum of angles, radians, which is also that of curvature; largest number of
# Newton steps; rounding of a sum of some angles, radians; and halvings after which a step counts as rounding. Without a
# solution the function is unbounded below, and the number of steps ends the search.
ANGLE_LIMITS = Limits(1e-10, 40, goal=1e-12, halvings=40)


@dataclass(frozen=True, eq=False)
class CoherentAngles:
    """Angles of a circle pattern.

    Attributes:
        angles: (3m,) opposite each half-edge, radians.
        residual: the largest error of a sum of angles, radians.
        steps: Newton steps.
    """

    angles: FloatArray
    residual: float
    steps: int

    @property
    def converged(self) -> bool:
        """Whether the sums of angles are correct."""
        return self.residual <= ANGLE_LIMITS.tolerance


def coherent_angles(
    triangulation: IntrinsicTriangulation, angles: FloatArray, sums: FloatArray, is_summed: BoolArray
) -> CoherentAngles:
    """Return the angles of a flat circle pattern that are nearest to given angles in the least squares sense.

    They are positive, sum to pi in triangles and to a given value at vertices, and the two opposite an edge sum to less
    than pi: the quadratic program of Kharevych, Springborn and Schroeder 2006. Angles at the boundary are free.

    Args:
        triangulation: a connected triangulation.
        angles: (3m,) opposite each half-edge, radians.
        sums: (n,) prescribed sum of the angles at each vertex, radians.
        is_summed: (n,) vertices whose sum is prescribed.

    Notes:
        Without the sums, the problem separates into one problem for each edge: the projection of two angles to a
        triangle of feasible pairs. The sums are equations, whose multipliers minimise a convex function; its gradient
        is the error of the sums. Its second derivative is discontinuous where bounds become active or inactive, but
        Newton's method still converges. If no bound is active, the first step is the least squares solution.
    """
    count = len(angles)
    rows = len(triangulation.faces)
    summed = np.flatnonzero(is_summed)
    number = np.full(triangulation.vertex_count, -1, dtype=np.int64)
    number[summed] = rows + np.arange(len(summed))
    row = np.concatenate([np.arange(count) // 3, number[triangulation.faces.ravel()]])
    column = np.tile(np.arange(count), 2)
    is_entry = row >= 0
    equations = csr_matrix(
        (np.ones(int(is_entry.sum())), (row[is_entry], column[is_entry])), shape=(rows + len(summed), count)
    )
    right = np.concatenate([np.full(rows, np.pi), sums[summed]])

    lower_bounds = np.clip(MIN_ANGLE_FRACTION * angles, MIN_ANGLE, 0.02)
    problem = _Dual(angles, lower_bounds, triangulation.twin, equations, right, bool(is_summed.all()))
    solution, steps = minimise(problem, problem.evaluate(np.zeros(len(right))), ANGLE_LIMITS)
    return CoherentAngles(problem.project(solution.variables)[0], solution.largest, steps)


@dataclass(eq=False)
class _Dual:
    """The convex dual function of the multipliers of equations A x = b, for the x nearest to c within bounds."""

    angles: FloatArray
    lower_bounds: FloatArray
    twin: IntArray
    equations: csr_matrix
    right: FloatArray
    is_closed: bool  # if so, the last of the equations follows from the others

    def project(self, place: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the angles for multipliers, and their derivatives by the unbounded angles: own and across the edge."""
        free = self.angles + self.equations.T @ place
        is_inner = self.twin >= 0
        twins = np.where(is_inner, self.twin, 0)
        bounded = np.maximum(free, self.lower_bounds)
        too_wide = is_inner & (bounded + bounded[twins] > WIDEST_PAIR)
        half = (free - free[twins]) / 2
        low, high = self.lower_bounds - WIDEST_PAIR / 2, WIDEST_PAIR / 2 - self.lower_bounds[twins]
        slides = too_wide & (low < half) & (half < high)
        angles = np.where(too_wide, WIDEST_PAIR / 2 + np.clip(half, low, high), bounded)
        weights = np.where(too_wide, 0.5 * slides, free > self.lower_bounds)
        return angles, weights, np.where(slides, -0.5, 0.0)

    def evaluate(self, place: FloatArray) -> Point:
        """Return the residual of each equation, which is minus the gradient."""
        return Point(place, self.right - self.equations @ self.project(place)[0])

    def direction(self, point: Point, exactly: bool) -> tuple[FloatArray, bool]:
        """Return the Newton step, with damping proportional to the residual; True, as there is no more exact step."""
        residual = point.residual
        _, weights, across = self.project(point.variables)
        slots = np.flatnonzero(across)
        every = np.arange(len(weights))
        derivative = csr_matrix(
            (
                np.concatenate([weights, across[slots]]),
                (np.concatenate([every, slots]), np.concatenate([every, self.twin[slots]])),
            ),
            shape=(len(weights), len(weights)),
        )
        independent = len(residual) - self.is_closed
        # Damping relative to the residual covers a rank-deficient matrix.
        damping = np.clip(1e-5 * np.abs(residual[:independent]).max(), 1e-13, 1e-6)
        equations = self.equations[:independent]
        matrix = csc_matrix(
            equations @ derivative @ equations.T + damping * identity(independent, format="csr")
        )
        matrix.sort_indices()
        step = np.zeros_like(residual)
        step[:independent] = factorize(matrix).solve(residual[:independent])
        return step, True
