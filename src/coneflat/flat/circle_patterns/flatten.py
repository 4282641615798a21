"""Circle patterns (Kharevych, Springborn, Schroeder 2006), with cones."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.sparse import csc_matrix

from ..._arrays import BoolArray, FloatArray, Int32Array, IntArray
from ...cones import ConeSolution
from ...errors import ConvergenceError
from ...geometry import angle_defect, corner_angles
from ...geometry.delaunay import make_delaunay
from ...geometry.intrinsic import IntrinsicTriangulation, intrinsic_triangulation
from ...geometry.operators import vertex_areas
from ...mesh import TriangleMesh, label_components
from ...solver import Factor, factorize
from ...solver.newton import Limits, Point, minimise
from ...text import plural
from ..base import failure_notes, off_by
from ..exact.flatten import ExactFlatMetric, at_own_area
from ..exact.metric import ExactMetric, checked_target
from .coherent_angles import CoherentAngles, coherent_angles
from .proper import make_proper

# Largest curvature error of a metric that has converged, radians.
TOLERANCE = 1e-9
# Mean angle, radians, that corners at a vertex are to stay below.
WIDEST = 0.98 * np.pi


def circle_patterns(
    mesh: TriangleMesh,
    lengths: FloatArray,
    solution: ConeSolution,
    best_effort: bool = False,
    delaunay: bool = True,
) -> ExactFlatMetric:
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
    failure = None
    if not coherent.converged:
        failure = (
            f"no circle pattern on these triangles has the curvatures: after {plural(coherent.steps, 'step')} their "
            f"angles are {off_by(coherent.residual)}"
        )
    notes = failure_notes(failure, best_effort)
    solved = _solved(triangulation, coherent, flips, target, border)
    if failure is None and not solved.converged:
        failure = (
            f"the circle pattern did not converge: after {plural(solved.steps, 'step')} the curvature is "
            f"{off_by(solved.residual)}"
        )
        notes = failure_notes(failure, best_effort)
    return at_own_area(mesh, lengths, solution, solved, notes)


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
        # than the corners at it can be.
        wanted = np.where(border, 0, np.floor((2 * np.pi - target) / WIDEST).astype(np.int64) + 1)
        flips = np.concatenate([flips, make_proper(triangulation, wanted)])
        coherent = _nearest_angles(triangulation, target, border)
    return coherent, flips


def _solved(
    triangulation: IntrinsicTriangulation,
    coherent: CoherentAngles,
    flips: IntArray,
    target: FloatArray,
    border: BoolArray,
) -> ExactMetric:
    """Return the metric of the circle pattern with given angles, which the triangulation gets for its own."""
    pattern = circle_pattern(triangulation.twin, coherent)
    before, after = triangulation.length.reshape(-1, 3), pattern.lengths.reshape(-1, 3)
    faces = triangulation.faces
    curvature = angle_defect(faces, corner_angles(after), border)
    error = np.where(border, 0.0, np.abs(curvature - target))
    areas = [vertex_areas(faces, sides, len(border)) for sides in (before, after)]
    triangulation.length = pattern.lengths
    return ExactMetric(
        log_scale=np.log(np.maximum(areas[1] / areas[0], np.finfo(float).tiny)) / 2,
        curvature=curvature,
        triangulation=triangulation,
        flips=flips,
        euclidean_flips=len(flips),
        steps=coherent.steps + pattern.steps,
        residual=float(error.max()),
        worst_vertex=int(error.argmax()),
        converged=coherent.converged and bool(error.max() <= TOLERANCE),
        doubled=False,
    )


def _nearest_angles(
    triangulation: IntrinsicTriangulation, target: FloatArray, border: BoolArray
) -> CoherentAngles:
    angles = corner_angles(triangulation.length.reshape(-1, 3)).ravel()
    return coherent_angles(triangulation, angles, 2 * np.pi - target, ~border)


# Largest error of the angles around the centre of a circle, radians, and steps of Newton's method at most.
RADII_TOLERANCE, MAX_STEPS = 1e-10, 50
# Change of an angle, radians, at which to go over from angles to radii; steps until there, and part of the way to the
# bounds of angles that a step goes at most.
SETTLED, MOST_STEPS, PART = 1e-5, 60, 0.9
# Halvings of such a step at most, while it goes beyond the top.
HALVINGS = 30
# When to stop: rounding of a sum of some angles, radians; halvings after which a step is taken for rounding; largest
# change of a log radius in one step; and part of the gradient that a step must change.
LIMITS = Limits(
    RADII_TOLERANCE,
    MAX_STEPS,
    goal=1e-12,
    halvings=40,
    halvings_below=40,
    largest_step=5.0,
    least_change=1e-6,
)
# By how much log radii may differ: squares of lengths, whose logs lie half as far from 0 each way, are to be finite.
LARGEST_SPREAD = 600.0


@dataclass(frozen=True, eq=False)
class CirclePattern:
    """Circles around flat triangles.

    Attributes:
        log_radius: (m,) log of the radius of each triangle's circle.
        lengths: (3m,) of the half-edges, both sides of an edge with the same bits.
        residual: largest error of the angles around the centre of a circle, radians.
        steps: Newton steps.
    """

    log_radius: FloatArray
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
        on Graphics 25(2), 2006. Circles that are one have one radius, and their triangles are one face.
    """
    problem = RadiiProblem(twin, coherent)
    problem.base, steps = widest_pattern(problem)
    # Where circles meet at a small angle, the last bit of a log radius turns theirs by a thousand times more than
    # what is to be reached. As a small change of what was found, log radii have bits enough.
    found, more = minimise(problem, problem.evaluate(np.zeros_like(problem.base)), LIMITS)
    log_radius = (problem.base + found.place)[problem.circle]
    spread = float(np.ptp(log_radius))
    if not spread < LARGEST_SPREAD:
        raise ConvergenceError(
            f"no circle pattern was found: the logs of radii came to differ by {spread:.3g}, more than numbers hold; "
            "method 'exact', other cones or --repair may help"
        )
    log_radius -= (log_radius.max() + log_radius.min()) / 2
    half = _inside_too(problem.half_angles(found.place), coherent, twin)
    lengths = 2 * np.exp(np.repeat(log_radius, 3)) * np.sin(half)
    upper = np.flatnonzero(twin > np.arange(len(half)))
    lengths[twin[upper]] = lengths[upper]
    return CirclePattern(log_radius, lengths, found.largest, steps + more)


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
        base: (circles,) log radii, of which the variables are changes.
    """

    twin: IntArray
    coherent: CoherentAngles
    base: FloatArray = field(default_factory=lambda: np.empty(0))
    _factor: Factor | None = field(default=None, init=False)

    @cached_property
    def circle(self) -> IntArray:
        """(m,) the circle of each triangle."""
        slots = np.flatnonzero(self.coherent.is_inside)
        return label_components(len(self.twin) // 3, slots // 3, self.twin[slots] // 3)[1]

    @property
    def count(self) -> int:
        """The number of circles."""
        return int(self.circle.max()) + 1

    @cached_property
    def sides(self) -> tuple[IntArray, IntArray, IntArray, FloatArray]:
        """Half-edges between two circles, the circle of each and the one across, and theta / 2."""
        slots = np.flatnonzero((self.twin >= 0) & ~self.coherent.is_inside)
        others = self.twin[slots]
        angles = self.coherent.angles
        theta = np.pi - angles[slots] - angles[others]
        return slots, self.circle[slots // 3], self.circle[others // 3], theta / 2

    @cached_property
    def _pattern(self) -> tuple[IntArray, Int32Array, Int32Array]:
        """Where each entry of the diagonal and each side's adds to a matrix by columns; its rows and starts."""
        _, own, other, _ = self.sides
        count = self.count
        every = np.arange(count)
        keys = np.concatenate([every * count + every, other * count + own])
        kept, place = np.unique(keys, return_inverse=True)
        starts = np.searchsorted(kept, np.arange(count + 1) * count)
        return place.ravel(), (kept % count).astype(np.int32), starts.astype(np.int32)

    def _gaps(self, place: FloatArray) -> FloatArray:
        """Return rho_k - rho_l for each side."""
        _, own, other, _ = self.sides
        gaps: FloatArray = (self.base[own] - self.base[other]) + (place[own] - place[other])
        return gaps

    def half_angles(self, place: FloatArray) -> FloatArray:
        """Return (3m,) phi; those of the coherent angles at the boundary and inside of a circle."""
        slots, _, _, half_theta = self.sides
        half = self.coherent.angles.copy()
        with np.errstate(over="ignore"):
            beyond = np.expm1(self._gaps(place))
        half[slots] = np.arctan2(np.sin(2 * half_theta), beyond + 2 * np.sin(half_theta) ** 2)
        return half

    def excess(self, half: FloatArray) -> FloatArray:
        """Return by how much half angles (3m,) around each centre exceed pi."""
        excess = half.reshape(-1, 3).sum(axis=1) - np.pi
        # Over an edge inside of a circle, the angles from both sides sum to pi, which makes one face of two.
        around: FloatArray = np.bincount(self.circle, excess).astype(np.float64)
        return around - around.mean()  # 0 but for rounding

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
        weight = np.where(own == other, 0.0, weight)
        count = len(residual)
        diagonal = np.bincount(own, weight, count)
        diagonal[0] = 1.0
        entries, rows, starts = self._pattern
        across = np.where((own == 0) | (other == 0), 0.0, -weight)
        values = np.bincount(entries, np.concatenate([diagonal, across]), len(rows))
        matrix = csc_matrix((values, rows, starts), shape=(count, count))
        self._factor = factorize(matrix, self._factor)
        solution: FloatArray = self._factor.solve(np.where(np.arange(count) == 0, 0.0, residual))
        return solution - solution.mean()


def widest_pattern(problem: RadiiProblem) -> tuple[FloatArray, int]:
    """Return (circles,) log radii, nearly, and the number of steps, from the dual problem.

    Of all coherent angles with the same theta those of the pattern have the largest volume, as angles of ideal
    hyperbolic prisms (I. Rivin 1994; G. Leibon 2002). An angle answers to a difference of log radii by a leap where
    theta is small, but log radii answer to angles gently, log sin(theta + phi) - log sin(phi): Newton's method takes
    ten steps here where it creeps from leap to leap there.
    """
    slots, own, other, half_theta = problem.sides
    half = problem.coherent.angles.copy()
    radii = np.zeros(problem.count)
    steps = 0
    while steps < MOST_STEPS:
        steps += 1
        one, two = half[slots], half[problem.twin[slots]]
        wanted = np.log(np.sin(two) / np.sin(one))
        weight = np.sin(one) * np.sin(two) / np.sin(2 * half_theta)
        radii = problem.solve(weight, np.bincount(own, weight * wanted, len(radii)) + problem.excess(half))
        change = weight * (wanted - (radii[own] - radii[other]))
        room = one / np.maximum(-change, np.finfo(float).tiny)
        part = min(1.0, PART * float(room.min(initial=np.inf)))
        half[slots] = one + part * change
        for _ in range(HALVINGS):
            if not change @ np.log(np.sin(half[problem.twin[slots]]) / np.sin(half[slots])) < 0:
                break
            part /= 2
            half[slots] = one + part * change
        if np.abs(change).max(initial=0.0) <= SETTLED:
            break
    return radii, steps


def _inside_too(half: FloatArray, coherent: CoherentAngles, twin: IntArray) -> FloatArray:
    """Return the half angles, also over edges inside of circles, where they sum to pi in each triangle."""
    unknown = coherent.is_inside.copy()
    half = half.copy()
    while unknown.any():
        faces = np.flatnonzero(unknown.reshape(-1, 3).sum(axis=1) == 1)
        if not len(faces):  # a ring: it does not occur where the angles are coherent
            break
        side = 3 * faces + np.argmax(unknown.reshape(-1, 3)[faces], axis=1)
        half[side] = 0.0
        half[side] = np.pi - half.reshape(-1, 3)[faces].sum(axis=1)
        half[twin[side]] = np.pi - half[side]
        unknown[side] = unknown[twin[side]] = False
    return half
