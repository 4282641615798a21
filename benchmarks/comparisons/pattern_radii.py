"""The radii of a circle pattern with given angles, by minimisation of a convex function."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csc_matrix

from coneflat.base import FloatArray, IntArray
from coneflat.errors import ConvergenceError
from coneflat.linalg import factorize
from coneflat.linalg.newton import Point, minimise

from .pattern_angles import ANGLE_LIMITS, CoherentAngles

# Stopping criteria for the angles around the centre of a circle, radians; and largest change of a log radius per step.
RADIUS_LIMITS = replace(ANGLE_LIMITS, steps=50, largest_step=5.0)


@dataclass(frozen=True, eq=False)
class CirclePattern:
    """The circumcircles of flat triangles.

    Attributes:
        lengths: (3m,) lengths of the half-edges, bitwise equal on both sides of an edge.
        residual: largest error of the angles around the centre of a circle, radians.
        steps: Newton steps.
    """

    lengths: FloatArray
    residual: float
    steps: int


def circle_pattern(twin: IntArray, coherent: CoherentAngles) -> CirclePattern:
    """Return the circles that intersect at the angles theta = pi - a - a', for a and a' opposite an edge.

    Args:
        twin: (3m,) half-edges of a connected triangulation.
        coherent: feasible angles.

    Raises:
        ConvergenceError: ratios of radii exceed the range of double precision.

    References:
        L. Kharevych, B. Springborn, P. Schroeder, "Discrete conformal mappings via circle patterns", ACM Transactions
        on Graphics 25(2), 2006.
    """
    problem = RadiiProblem(twin, coherent)
    problem.base, steps = widest_pattern(problem)
    # If circles intersect at a small angle, the last bit of a log radius changes angles by a thousand times the
    # tolerance. As small changes of a base value, log radii are accurate enough.
    solution, radius_steps = minimise(problem, problem.evaluate(np.zeros_like(problem.base)), RADIUS_LIMITS)
    log_radius = problem.base + solution.variables
    spread = float(np.ptp(log_radius))
    if not spread < 600:  # Squares of lengths must be finite; their logs are at most half as large.
        raise ConvergenceError(
            f"no circle pattern was found: the logs of radii differ by {spread:.3g}, which overflows; method 'exact', "
            "other cones or --repair may help"
        )
    log_radius -= (log_radius.max() + log_radius.min()) / 2
    half = problem.half_angles(solution.variables)
    lengths = 2 * np.exp(np.repeat(log_radius, 3)) * np.sin(half)
    upper = np.flatnonzero(twin > np.arange(len(half)))
    lengths[twin[upper]] = lengths[upper]
    return CirclePattern(lengths, solution.largest, steps + radius_steps)


@dataclass(eq=False)
class RadiiProblem:
    """The problem of log radii rho for which the angles around each centre sum to 2 pi.

    The half angle at the centre of circle k over an edge towards l, which is the angle opposite it, is

        phi = atan2(sin theta, exp(rho_k - rho_l) - cos theta)

    and sum phi - pi is minus the gradient of half the paper's convex energy, the sum over inner edges of

        Im Li2(exp(x + i theta)) + Im Li2(exp(-x + i theta)) - (pi - theta) (rho_k + rho_l),  x = rho_k - rho_l

    over the boundary of - 2 (pi - theta) rho_k, and over circles of 2 pi rho_k.

    Attributes:
        twin: (3m,) half-edges.
        coherent: the angles, which give theta, and the angles opposite the boundary.
        base: (m,) log radii; the variables are changes of them.
    """

    twin: IntArray
    coherent: CoherentAngles
    base: FloatArray = field(default_factory=lambda: np.empty(0))

    @cached_property
    def sides(self) -> tuple[IntArray, IntArray, IntArray, FloatArray]:
        """Half-edges between two circles, the circles on their own and on the opposite side, and theta / 2."""
        slots = np.flatnonzero(self.twin >= 0)
        twins, angles = self.twin[slots], self.coherent.angles
        return slots, slots // 3, twins // 3, (np.pi - angles[slots] - angles[twins]) / 2

    def _gaps(self, place: FloatArray) -> FloatArray:
        """Return rho_k - rho_l for each side."""
        _, faces, neighbours, _ = self.sides
        return (self.base[faces] - self.base[neighbours]) + (place[faces] - place[neighbours])

    def half_angles(self, place: FloatArray) -> FloatArray:
        """Return (3m,) the half angles phi; at the boundary, the coherent angles."""
        slots, _, _, half_theta = self.sides
        half = self.coherent.angles.copy()
        with np.errstate(over="ignore"):
            beyond = np.expm1(self._gaps(place))
        half[slots] = np.arctan2(np.sin(2 * half_theta), beyond + 2 * np.sin(half_theta) ** 2)
        return half

    def excess(self, half: FloatArray) -> FloatArray:
        """Return (m,) the sum of the half angles (3m,) around each centre minus pi."""
        excess: FloatArray = half.reshape(-1, 3).sum(axis=1) - np.pi
        return excess - excess.mean()  # the mean is 0 up to rounding

    def evaluate(self, place: FloatArray) -> Point:
        """Return the sum of the half angles around each centre minus pi, which is minus the gradient."""
        return Point(place, self.excess(self.half_angles(place)))

    def direction(self, point: Point, exactly: bool) -> tuple[FloatArray, bool]:
        """Return the Newton step; True, as it is exact."""
        half_theta, gaps = self.sides[3], self._gaps(point.variables)
        with np.errstate(over="ignore"):
            slope = np.sin(2 * half_theta) / (4 * (np.sinh(gaps / 2) ** 2 + np.sin(half_theta) ** 2))
        return self.solve(slope, point.residual), True

    def solve(self, weight: FloatArray, residual: FloatArray) -> FloatArray:
        """Return the solution with zero mean for weights of the sides; the first radius is fixed in the solve."""
        _, faces, neighbours, _ = self.sides
        rows, columns = np.concatenate([faces, faces]), np.concatenate([faces, neighbours])
        matrix = csc_matrix((np.concatenate([weight, -weight]), (rows, columns)), (len(residual),) * 2)
        reduced = csc_matrix(matrix[1:, 1:])
        reduced.sort_indices()
        solution = np.concatenate([[0.0], factorize(reduced).solve(residual[1:])])
        return solution - solution.mean()


def widest_pattern(problem: RadiiProblem) -> tuple[FloatArray, int]:
    """Return (m,) approximate log radii from the dual problem, and the number of steps.

    Among all coherent angles with the same theta, those of the pattern have the largest volume as angles of ideal
    hyperbolic prisms (I. Rivin 1994; G. Leibon 2002). For small theta, an angle is nearly a step function of the
    difference of log radii, but log radii are a smooth function of angles, log sin(theta + phi) - log sin(phi). So
    Newton's method needs about ten steps for the dual problem, and many more for the primal one.
    """
    slots, faces, neighbours, half_theta = problem.sides
    half = problem.coherent.angles.copy()
    radii = np.zeros(len(half) // 3)
    steps = 0
    while steps < 60:
        steps += 1
        angles, twin_angles = half[slots], half[problem.twin[slots]]
        targets = np.log(np.sin(twin_angles) / np.sin(angles))
        weight = np.sin(angles) * np.sin(twin_angles) / np.sin(2 * half_theta)
        radii = problem.solve(weight, np.bincount(faces, weight * targets, len(radii)) + problem.excess(half))
        change = weight * (targets - (radii[faces] - radii[neighbours]))
        limit = angles / np.maximum(-change, np.finfo(float).tiny)
        factor = min(1.0, 0.9 * float(limit.min(initial=np.inf)))  # of the step, within the bounds of angles
        half[slots] = angles + factor * change
        for _ in range(30):  # while the step overshoots the maximum
            if not change @ np.log(np.sin(half[problem.twin[slots]]) / np.sin(half[slots])) < 0:
                break
            factor /= 2
            half[slots] = angles + factor * change
        if np.abs(change).max(initial=0.0) <= 1e-5:  # radians: the primal problem now converges faster
            break
    return radii, steps
