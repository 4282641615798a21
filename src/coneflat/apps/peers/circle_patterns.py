"""Circle patterns (Kharevych, Springborn, Schroeder 2006), with cones.

First the nearest angles that a pattern can have, a quadratic program, after edge flips where there are none; then the
radii of its circles.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, identity

from ... import TriangleMesh
from ...base import BoolArray, FloatArray, IntArray
from ...errors import ConvergenceError
from ...geometry import (
    IntrinsicTriangulation,
    corner_angles,
    euclidean_diagonal,
    intrinsic_triangulation,
    make_delaunay,
    relink,
    vertex_areas,
)
from ...linalg import Limits, Point, factorize, minimise
from ...mesh import NEXT, PREVIOUS
from ...metric import checked_target
from ...stages import ConeSolution, FlatMetric
from .shared import failure_notes, flat_metric

# Largest curvature error of a metric that has converged, radians.
TOLERANCE = 1e-9


def circle_patterns(
    mesh: TriangleMesh,
    lengths: FloatArray,
    solution: ConeSolution,
    best_effort: bool = False,
    delaunay: bool = True,
) -> FlatMetric:
    """Return the flat metric whose triangles' circumcircles meet at nearly the same angles as on the mesh.

    Args:
        mesh: connected.
        lengths: (m, 3) side lengths, model units.
        solution: cones with their curvatures; the boundary is free.
        best_effort: return a metric that did not converge.
        delaunay: make the mesh intrinsic Delaunay first, as the paper does; without, angles opposite edges that are
            not Delaunay are made smaller until these are.

    Raises:
        ConvergenceError: there is no such pattern, or it was not found, unless `best_effort`.
        CurvatureError: no metric has the curvatures.
    """
    border = mesh.is_boundary_vertex
    target, _ = checked_target(mesh, np.where(border, 0.0, solution.target), border)
    triangulation = intrinsic_triangulation(mesh, lengths)
    coherent, flips = _find_angles(triangulation, target, border, delaunay)
    notes: tuple[str, ...] = ()
    if not coherent.converged:
        what = "no circle pattern on these triangles has the curvatures: their angles are"
        notes = failure_notes(what, coherent.steps, coherent.residual, " rad", best_effort)
    pattern = circle_pattern(triangulation.twin, coherent)
    steps = coherent.steps + pattern.steps
    before, after = (
        vertex_areas(triangulation.faces, sides.reshape(-1, 3), len(border))
        for sides in (triangulation.length, pattern.lengths)
    )
    log_scale = np.log(np.maximum(after / before, np.finfo(float).tiny)) / 2
    metric = flat_metric(mesh, lengths, solution, triangulation, pattern.lengths, log_scale, flips, steps)
    residual = metric.statistics.residual
    if not notes and not residual <= TOLERANCE:
        what = "the circle pattern did not converge: the curvature is"
        notes = failure_notes(what, steps, residual, " rad", best_effort)
    return replace(metric, notes=notes)


def _find_angles(
    triangulation: IntrinsicTriangulation, target: FloatArray, border: BoolArray, delaunay: bool
) -> tuple[CoherentAngles, IntArray]:
    """Return the angles of a pattern, and the half-edges flipped, in place, before there was one."""
    if not delaunay:
        return _nearest_angles(triangulation, target, border), np.empty(0, dtype=np.int64)
    flips = make_delaunay(triangulation)
    coherent = _nearest_angles(triangulation, target, border)
    if not coherent.converged:
        # Two edges between the same vertices, flat all around, cannot both be straight; nor can there be a cone wider
        # than the corners at it can be: their mean is to stay below 0.98 pi.
        wanted = np.where(border, 0, np.floor((2 * np.pi - target) / (0.98 * np.pi)).astype(np.int64) + 1)
        flips = np.concatenate([flips, make_proper(triangulation, wanted)])
        coherent = _nearest_angles(triangulation, target, border)
    return coherent, flips


def _nearest_angles(
    triangulation: IntrinsicTriangulation, target: FloatArray, border: BoolArray
) -> CoherentAngles:
    angles = corner_angles(triangulation.length.reshape(-1, 3)).ravel()
    return coherent_angles(triangulation, angles, 2 * np.pi - target, ~border)


# Angles may shrink to this part of what they were, or to 0.02 radians where that is less; but never below the last,
# radians.
LEAST_PART, LEAST_ANGLE = 0.5, 1e-5
# Circles meet at this angle at least, radians, also those around the two halves of a planar quad that is inscribed in a
# circle, which are one: the equations are as steep as this is small.
LEAST_MEETING = 1e-4
# The largest sum of angles opposite an edge.
WIDEST_PAIR = np.pi - LEAST_MEETING
# When to stop: largest error of a sum of angles, radians, which sums to that of curvature; Newton steps at most;
# rounding of a sum of some angles, radians; halvings after which a step is taken for rounding; and part of the gradient
# that a step must change, as where there is no solution the function falls without an end.
ANGLE_LIMITS = Limits(1e-10, 40, goal=1e-12, halvings=40, halvings_below=40, least_change=1e-6)


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
        """Whether the angles sum to what they should."""
        return self.residual <= ANGLE_LIMITS.tolerance


def coherent_angles(
    triangulation: IntrinsicTriangulation, angles: FloatArray, sums: FloatArray, is_summed: BoolArray
) -> CoherentAngles:
    """Return the angles nearest to given ones, in the sum of squares, that belong to a flat circle pattern.

    They are positive, sum to pi in triangles and to what is wanted at vertices, and the two opposite an edge sum
    to less than pi: the paper's quadratic program. Angles at a boundary are free.

    Args:
        triangulation: connected.
        angles: (3m,) opposite each half-edge, radians.
        sums: (n,) what the angles at a vertex are to sum to.
        is_summed: (n,) the vertices where that is asked.

    Notes:
        Without the sums, each edge has a problem of its own, to project two angles to a triangle. The sums
        are equations, whose multipliers minimise a convex function that has what they are off by for its gradient;
        its second derivative is discontinuous where bounds become active or inactive; Newton's method still converges.
        Where none holds, the first step is the least squares solution.
    """
    count = len(angles)
    rows = triangulation.face_count
    summed = np.flatnonzero(is_summed)
    number = np.full(triangulation.vertex_count, -1, dtype=np.int64)
    number[summed] = rows + np.arange(len(summed))
    row = np.concatenate([np.arange(count) // 3, number[triangulation.faces.ravel()]])
    column = np.tile(np.arange(count), 2)
    wanted = row >= 0
    equations = csr_matrix(
        (np.ones(int(wanted.sum())), (row[wanted], column[wanted])), shape=(rows + len(summed), count)
    )
    right = np.concatenate([np.full(rows, np.pi), sums[summed]])

    least = np.clip(LEAST_PART * angles, LEAST_ANGLE, 0.02)
    problem = _Dual(angles, least, triangulation.twin, equations, right, bool(is_summed.all()))
    found, steps = minimise(problem, problem.evaluate(np.zeros(len(right))), ANGLE_LIMITS)
    return CoherentAngles(problem.project(found.place)[0], found.largest, steps)


@dataclass(eq=False)
class _Dual:
    """A convex function of the multipliers of equations A x = b, for x nearest to c within bounds."""

    angles: FloatArray
    least: FloatArray
    twin: IntArray
    equations: csr_matrix
    right: FloatArray
    is_closed: bool  # then the last of the equations follows from the others

    def project(self, place: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the angles for multipliers, and their derivatives by those before bounds: own and across."""
        free = self.angles + self.equations.T @ place
        is_inner = self.twin >= 0
        other = np.where(is_inner, self.twin, 0)
        bounded = np.maximum(free, self.least)
        too_wide = is_inner & (bounded + bounded[other] > WIDEST_PAIR)
        half = (free - free[other]) / 2
        low, high = self.least - WIDEST_PAIR / 2, WIDEST_PAIR / 2 - self.least[other]
        slides = too_wide & (low < half) & (half < high)
        angles = np.where(too_wide, WIDEST_PAIR / 2 + np.clip(half, low, high), bounded)
        own = np.where(too_wide, 0.5 * slides, free > self.least)
        return angles, own, np.where(slides, -0.5, 0.0)

    def evaluate(self, place: FloatArray) -> Point:
        """Return the residual of each equation, which is minus the gradient."""
        return Point(place, self.right - self.equations @ self.project(place)[0])

    def direction(self, here: Point, exactly: bool) -> tuple[FloatArray, bool]:
        """Return the step, damped as much as the residual is large; there is none more exact."""
        residual = here.residual
        _, own, across = self.project(here.place)
        slots = np.flatnonzero(across)
        every = np.arange(len(own))
        derivative = csr_matrix(
            (
                np.concatenate([own, across[slots]]),
                (np.concatenate([every, slots]), np.concatenate([every, self.twin[slots]])),
            ),
            shape=(len(own), len(own)),
        )
        used = len(residual) - self.is_closed
        # Relative to the residual, where rank is wanting.
        damping = np.clip(1e-5 * np.abs(residual[:used]).max(), 1e-13, 1e-6)
        equations = self.equations[:used]
        matrix = csc_matrix(equations @ derivative @ equations.T + damping * identity(used, format="csr"))
        matrix.sort_indices()
        step = np.zeros_like(residual)
        step[:used] = factorize(matrix).solve(residual[:used])
        return step, True


def make_proper(triangulation: IntrinsicTriangulation, wanted: IntArray) -> IntArray:
    """Flip edges, in place, that have the same ends as others, or one end only, and towards vertices of small degree.

    Intrinsic Delaunay triangulations have some such edges near vertices of large curvature. Of those that
    can be flipped the one with most room goes first; there are few, so each is looked for anew.

    Args:
        triangulation: changed in place, as far as quads are convex.
        wanted: (n,) number of triangles at each vertex, at least.

    Returns:
        The half-edges flipped, in order.
    """
    flipped: list[int] = []
    while True:
        slots, room = _candidates(triangulation, wanted)
        if not len(slots):
            return np.array(flipped, dtype=np.int64)
        h = int(slots[np.argmax(room)])
        twin, tail, length = triangulation.twin, triangulation.tail, triangulation.length
        one, two = _around(h), _around(int(twin[h]))
        sides = (h, one[1], one[0], two[0], two[1])
        diagonal = euclidean_diagonal(*(float(length[side]) for side in sides))
        relink(twin, tail, length, h, diagonal)
        flipped.append(h)


def _around(slots: int | IntArray) -> tuple[IntArray, IntArray]:
    """Return the next and the previous half-edge in the triangle of each."""
    base = slots - slots % 3
    return base + NEXT[slots % 3], base + PREVIOUS[slots % 3]


def _candidates(triangulation: IntrinsicTriangulation, wanted: IntArray) -> tuple[IntArray, FloatArray]:
    """Return the half-edges that should be flipped, and can without harm, and their room."""
    twin, tail, count = triangulation.twin, triangulation.tail, triangulation.vertex_count
    every = np.arange(len(twin))
    after, before = _around(every)
    keys = _pair(tail, tail[after], count)
    known, number, times = np.unique(keys[twin < every], return_inverse=True, return_counts=True)
    is_double = np.zeros(len(twin), dtype=bool)
    is_double[twin < every] = times[number.ravel()] > 1
    is_double |= tail == tail[after]
    degree = np.bincount(tail, minlength=count)
    should: BoolArray = is_double | (degree < wanted)[tail[before]]
    slots = every[should & (twin >= 0)]
    slots = slots[twin[slots] // 3 != slots // 3]

    other = twin[slots]
    new = tail[before[slots]], tail[before[other]]
    spare = degree > wanted
    fine = spare[tail[slots]] & spare[tail[other]] & (new[0] != new[1])
    fine &= ~np.isin(_pair(*new, count), known)
    slots = slots[fine]
    room = _room(triangulation, slots)
    wide = room > 1e-3  # radians that corners of the quad are short of straight
    return slots[wide], room[wide]


def _pair(one: IntArray, two: IntArray, count: int) -> IntArray:
    return np.minimum(one, two) * count + np.maximum(one, two)


def _room(triangulation: IntrinsicTriangulation, slots: IntArray) -> FloatArray:
    """Return by how much the wider corner at the ends of each edge is short of straight."""
    lengths, other = triangulation.length.reshape(-1, 3), triangulation.twin[slots]
    one, two = corner_angles(lengths[slots // 3]), corner_angles(lengths[other // 3])
    rows = np.arange(len(slots))
    # Of a half-edge in slot i, the corner at its tail is i + 1 and the one at its head i + 2.
    at_tail = one[rows, NEXT[slots % 3]] + two[rows, PREVIOUS[other % 3]]
    at_head = one[rows, PREVIOUS[slots % 3]] + two[rows, NEXT[other % 3]]
    return np.pi - np.maximum(at_tail, at_head)


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
