"""The radii of a circle pattern whose angles are known, by a convex function."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csc_matrix

from ...base import FloatArray, IntArray
from ...errors import ConvergenceError
from ...linalg import Point, factorize, minimise
from .pattern_angles import ANGLE_LIMITS, CoherentAngles

# When to stop, from angles around the centre of a circle, radians; and the largest change of a log radius in one step.
RADIUS_LIMITS = replace(ANGLE_LIMITS, steps=50, largest_step=5.0)


@dataclass(frozen=True, eq=False)
class CirclePattern:
    """Circles around flat triangles.

    Attributes:
        lengths: (3m,) of the half-edges, both sides of an edge with the same bits.
        residual: largest error of the angles around the centre of a circle, radians.
        steps: Newton steps.
    """

    lengths: FloatArray
    residual: float
    steps: int


def circle_pattern(twin: IntArray, coherent: CoherentAngles) -> CirclePattern:
    """Return the circles that meet at the angles theta = pi - a - a', for a and a' opposite an edge.

    Args:
        twin: (3m,) half-edges of a connected triangulation.
        coherent: angles.

    Raises:
        ConvergenceError: radii differ by more than numbers hold.

    Notes:
        L. Kharevych, B. Springborn, P. Schroeder, "Discrete conformal mappings via circle patterns", ACM Transactions
        on Graphics 25(2), 2006.
    """
    problem = RadiiProblem(twin, coherent)
    problem.base, steps = widest_pattern(problem)
    # Where circles meet at a small angle, the last bit of a log radius turns theirs by a thousand times more than
    # what is to be reached. As a small change of what was found, log radii have bits enough.
    found, more = minimise(problem, problem.evaluate(np.zeros_like(problem.base)), RADIUS_LIMITS)
    log_radius = problem.base + found.place
    spread = float(np.ptp(log_radius))
    if not spread < 600:  # Squares of lengths, whose logs lie half as far from 0 each way, are to be finite.
        raise ConvergenceError(
            f"no circle pattern was found: the logs of radii came to differ by {spread:.3g}, more than numbers hold; "
            "method 'exact', other cones or --repair may help"
        )
    log_radius -= (log_radius.max() + log_radius.min()) / 2
    half = problem.half_angles(found.place)
    lengths = 2 * np.exp(np.repeat(log_radius, 3)) * np.sin(half)
    upper = np.flatnonzero(twin > np.arange(len(half)))
    lengths[twin[upper]] = lengths[upper]
    return CirclePattern(lengths, found.largest, steps + more)


@dataclass(eq=False)
class RadiiProblem:
    """Find log radii rho for which the angles around each centre sum to a full turn.

    The half angle at the centre of circle k over an edge towards l, which is the angle opposite it, is

        phi = atan2(sin theta, exp(rho_k - rho_l) - cos theta)

    and sum phi - pi is minus the gradient of half the paper's convex energy, the sum over inner edges of

        Im Li2(exp(x + i theta)) + Im Li2(exp(-x + i theta)) - (pi - theta) (rho_k + rho_l),  x = rho_k - rho_l

    over the boundary of - 2 (pi - theta) rho_k, and over circles of 2 pi rho_k.

    Attributes:
        twin: (3m,) half-edges.
        coherent: what gives theta, and the angles opposite the boundary.
        base: (m,) log radii, of which the variables are changes.
    """

    twin: IntArray
    coherent: CoherentAngles
    base: FloatArray = field(default_factory=lambda: np.empty(0))

    @cached_property
    def sides(self) -> tuple[IntArray, IntArray, IntArray, FloatArray]:
        """Half-edges between two circles, the circle of each and the one across, and theta / 2."""
        slots = np.flatnonzero(self.twin >= 0)
        others, angles = self.twin[slots], self.coherent.angles
        return slots, slots // 3, others // 3, (np.pi - angles[slots] - angles[others]) / 2

    def _gaps(self, place: FloatArray) -> FloatArray:
        """Return rho_k - rho_l for each side."""
        _, own, other, _ = self.sides
        return (self.base[own] - self.base[other]) + (place[own] - place[other])

    def half_angles(self, place: FloatArray) -> FloatArray:
        """Return (3m,) phi; those of the coherent angles at the boundary."""
        slots, _, _, half_theta = self.sides
        half = self.coherent.angles.copy()
        with np.errstate(over="ignore"):
            beyond = np.expm1(self._gaps(place))
        half[slots] = np.arctan2(np.sin(2 * half_theta), beyond + 2 * np.sin(half_theta) ** 2)
        return half

    def excess(self, half: FloatArray) -> FloatArray:
        """Return by how much half angles (3m,) around each centre exceed pi."""
        excess: FloatArray = half.reshape(-1, 3).sum(axis=1) - np.pi
        return excess - excess.mean()  # 0 but for rounding

    def evaluate(self, place: FloatArray) -> Point:
        """Return by how much the half angles around each centre exceed pi, which is minus the gradient."""
        return Point(place, self.excess(self.half_angles(place)))

    def direction(self, here: Point, exactly: bool) -> tuple[FloatArray, bool]:
        """Return the Newton step, which is exact."""
        half_theta, gaps = self.sides[3], self._gaps(here.place)
        with np.errstate(over="ignore"):
            slope = np.sin(2 * half_theta) / (4 * (np.sinh(gaps / 2) ** 2 + np.sin(half_theta) ** 2))
        return self.solve(slope, here.residual), True

    def solve(self, weight: FloatArray, residual: FloatArray) -> FloatArray:
        """Return the solution for weights of the sides, mean-free; on the way, the first radius is held."""
        _, own, other, _ = self.sides
        rows, columns = np.concatenate([own, own]), np.concatenate([own, other])
        matrix = csc_matrix((np.concatenate([weight, -weight]), (rows, columns)), (len(residual),) * 2)
        held = csc_matrix(matrix[1:, 1:])
        held.sort_indices()
        solution = np.concatenate([[0.0], factorize(held).solve(residual[1:])])
        return solution - solution.mean()


def widest_pattern(problem: RadiiProblem) -> tuple[FloatArray, int]:
    """Return (m,) log radii, nearly, and the number of steps, from the dual problem.

    Of all coherent angles with the same theta those of the pattern have the largest volume, as angles of ideal
    hyperbolic prisms (I. Rivin 1994; G. Leibon 2002). An angle answers to a difference of log radii by a leap where
    theta is small, but log radii answer to angles gently, log sin(theta + phi) - log sin(phi): Newton's method takes
    ten steps here where it creeps from leap to leap there.
    """
    slots, own, other, half_theta = problem.sides
    half = problem.coherent.angles.copy()
    radii = np.zeros(len(half) // 3)
    steps = 0
    while steps < 60:
        steps += 1
        one, two = half[slots], half[problem.twin[slots]]
        wanted = np.log(np.sin(two) / np.sin(one))
        weight = np.sin(one) * np.sin(two) / np.sin(2 * half_theta)
        radii = problem.solve(weight, np.bincount(own, weight * wanted, len(radii)) + problem.excess(half))
        change = weight * (wanted - (radii[own] - radii[other]))
        room = one / np.maximum(-change, np.finfo(float).tiny)
        part = min(1.0, 0.9 * float(room.min(initial=np.inf)))  # of the way, within the bounds of angles
        half[slots] = one + part * change
        for _ in range(30):  # while it goes beyond the top
            if not change @ np.log(np.sin(half[problem.twin[slots]]) / np.sin(half[slots])) < 0:
                break
            part /= 2
            half[slots] = one + part * change
        if np.abs(change).max(initial=0.0) <= 1e-5:  # radians: from here on radii converge faster
            break
    return radii, steps
