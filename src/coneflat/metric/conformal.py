"""Newton's method on the convex energy of discrete conformal maps, with edge flips."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.sparse import csc_matrix

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..base.jit import compiled
from ..geometry.delaunay import make_delaunay
from ..geometry.intrinsic import IntrinsicTriangulation
from ..linalg import Factor, factorize
from ..linalg.newton import HALVINGS, Limits, Point, minimise
from ..stages import LaplacianInverse
from .hessian import HessianPattern, conjugate_gradients, corrected

# Residual, radians, at which the solve stops: the rounding error of a sum of a few angles.
GOAL_RESIDUAL = 1e-13
# Relative rounding error of a length: of the exponential and the products that it is made of. And the largest error of
# the curvature, radians, that is put down to rounding.
LENGTH_ROUNDING, MAX_ROUNDING_ERROR = 4 * float(np.finfo(np.float64).eps), 1e-8
# Largest change of phi in one step. Beyond a factor e^5 of lengths, the quadratic model is meaningless.
MAX_STEP = 5.0
# A Newton step is computed with a relative error like the residual, but at most this; less accurate steps cost more
# steps.
MAX_RELATIVE_RESIDUAL = 0.05
# Number of vertices below which a factorization takes less time than the function calls of conjugate gradients.
MAX_DIRECT_VERTICES = 200
# Largest difference of log conformal factors whose Hessians are nearly the same.
MAX_REUSE_CHANGE = 0.05
# Largest number of halvings of a step on surfaces with a boundary: instead of taking tiny steps past triangles that
# nearly break the triangle inequality, the surface is doubled.
HALVINGS_BOUNDED = 6


@dataclass(eq=False)
class State(Point):
    """Curvature for a log conformal factor, on the triangulation that is Delaunay for it.

    Attributes:
        curvature: (n,) radians; the residual is the target minus this.
        cots: (3m,) cotangents opposite the half-edges.
        broken: number of triangles that break the triangle inequality. On a surface with a boundary, whose edges
            cannot be flipped, the theory does not hold for such states, and they are not admissible.
    """

    curvature: FloatArray = field(default_factory=lambda: np.empty(0))
    cots: FloatArray = field(default_factory=lambda: np.empty(0))
    broken: int = 0


def centred(log_scale: FloatArray) -> FloatArray:
    """Return a log conformal factor with the middle of its range shifted to 0: no overflow, and the same angles."""
    return log_scale - (log_scale.max() + log_scale.min()) / 2


@dataclass(eq=False)
class ConformalProblem:
    """The problem of finding phi such that the curvature of l_ij exp((phi_i + phi_j) / 2) is the target.

    K(phi) - target is the gradient of a convex energy (Springborn, Schroeder, Pinkall 2008, Eq. 7), whose
    Hessian is the cotangent Laplacian of the scaled metric; flipped to Delaunay, the energy is defined
    for every phi and twice continuously differentiable (Springborn 2019; Gu, Luo, Sun, Wu 2018).

    Attributes:
        triangulation: lengths l; flipped in place.
        flat_angle: (n,) angle sum of a flat vertex, radians: 2 pi inside, pi on the boundary.
        target: (n,) curvature, radians; not used at fixed vertices.
        fixed: (n,) True where phi is given.
        pinned: (n,) True for one vertex of each component without fixed ones.
        records: half-edges flipped so far.
        preconditioner: inverse of the Laplacian of a similar metric, zero at fixed vertices; None if there is none.
        last: the state evaluated last, to which the triangulation belongs.
    """

    triangulation: IntrinsicTriangulation
    flat_angle: FloatArray
    target: FloatArray
    fixed: BoolArray
    pinned: BoolArray
    preconditioner: LaplacianInverse | None = None
    records: list[IntArray] = field(default_factory=list)
    last: State | None = None
    _pattern: HessianPattern | None = None
    _factor: Factor | None = None
    _correction: tuple[LaplacianInverse, FloatArray, LaplacianInverse] | None = None

    @cached_property
    def is_bounded(self) -> bool:
        """Whether there is a boundary: its edges cannot be flipped, and triangles there may remain broken."""
        return bool((self.triangulation.twin < 0).any())

    def flat_lengths(self, log_scale: FloatArray) -> FloatArray:
        """Return (3m,) the scaled lengths; both sides of an edge get the same bits."""
        at_tail = log_scale[self.triangulation.tail].reshape(-1, 3)
        sums = np.empty(at_tail.shape)
        for i in range(3):
            np.add(at_tail[:, i], at_tail[:, (i + 1) % 3], out=sums[:, i])
        sums /= 2
        # The sums are commutative, and the unscaled lengths have the same bits on both sides.
        lengths: FloatArray = np.exp(sums, out=sums).ravel()
        lengths *= self.triangulation.length
        return lengths

    def sum_angles(self, log_scale: FloatArray, sums: FloatArray, cots: FloatArray) -> int:
        """Write the (n,) angle sums and (3m,) cotangents of the scaled metric; return the count of broken triangles."""
        scale = np.exp(centred(log_scale) / 2)
        return sum_angles(self.triangulation.tail, self.triangulation.length, scale, sums, cots)

    def evaluate(self, log_scale: FloatArray) -> State:
        """Return the state of a log conformal factor (n,); the triangulation is flipped to Delaunay in its metric."""
        sums = np.empty(len(log_scale))
        cots = np.empty(len(self.triangulation.tail))
        broken = self.sum_angles(log_scale, sums, cots)
        # The cotangents are needed anyway, and give a fast test for edges that need no flip.
        edges = np.empty(len(cots), dtype=np.int64)
        suspects = edges[: find_suspects(self.triangulation.twin, cots, edges)]
        if len(suspects):
            flipped = make_delaunay(self.triangulation, log_scale, suspects)
            if len(flipped):
                self.records.append(flipped)
                self._pattern = None  # no longer valid
                broken = self.sum_angles(log_scale, sums, cots)
        curvature = self.flat_angle - sums
        residual = np.where(self.fixed, 0.0, self.target - curvature)
        if not self.fixed.any() and np.count_nonzero(self.pinned) == 1:
            # Gauss-Bonnet holds up to the rounding of 2 pi at every vertex, which no scale can remove.
            residual -= residual.mean()
        is_admissible = not (self.is_bounded and broken)
        self.last = State(log_scale, residual, is_admissible, curvature, cots, broken)
        return self.last

    def rounding_error(self, state: State) -> float:
        """Return the largest error of a curvature, radians, that the rounding of lengths can cause.

        A relative change of a length changes the angles of a triangle by its cotangents times as much.
        """
        triangles = np.abs(state.cots).reshape(-1, 3).sum(axis=1)
        errors = np.bincount(self.triangulation.tail, np.repeat(triangles, 3))
        return min(LENGTH_ROUNDING * float(errors.max()), MAX_ROUNDING_ERROR)

    def direction(self, point: State, exactly: bool) -> tuple[FloatArray, bool]:
        """Return (n,) the Newton direction of a state, 0 at fixed vertices, and whether the Hessian was factorized.

        exactly: factorize the Hessian even if there is a preconditioner.

        Raises:
            MetricError: the Hessian is singular in double precision.
        """
        # The Hessian needs the triangulation of its own metric.
        state = point if point is self.last else self.evaluate(point.variables)
        if exactly:
            self.preconditioner = None
        if self._pattern is None:
            self._pattern = HessianPattern(self.triangulation)
        if self.preconditioner is not None and len(point.variables) >= MAX_DIRECT_VERTICES:
            accuracy = min(max(state.largest, GOAL_RESIDUAL / state.largest / 4), MAX_RELATIVE_RESIDUAL)
            hessian = self._pattern.matrix(state.cots, self.fixed)
            inverse = self._corrected(self.preconditioner, hessian, state.variables)
            step = conjugate_gradients(hessian, state.residual, inverse, accuracy)
            if step is not None:
                return np.where(self.fixed, 0.0, step), False
        grounded = self.fixed | self.pinned
        hessian = self._pattern.matrix(state.cots, grounded)
        factor = self._factor = factorize(hessian, self._factor)

        def solve(right: FloatArray) -> FloatArray:
            return np.where(grounded, 0.0, factor.solve(np.where(grounded, 0.0, right)))

        self.preconditioner = LaplacianInverse(solve, hessian, grounded, factor.break_even)
        return solve(state.residual), True

    def _corrected(
        self, inverse: LaplacianInverse, hessian: csc_matrix, log_scale: FloatArray
    ) -> LaplacianInverse:
        """Return an inverse corrected for the Hessian; reused while the Hessian has hardly changed."""
        cached = self._correction
        if cached is None or cached[0] is not inverse or np.ptp(log_scale - cached[1]) > MAX_REUSE_CHANGE:
            cached = self._correction = inverse, log_scale, corrected(inverse, hessian, self.fixed)
        return cached[2]


def find_scale(
    problem: ConformalProblem,
    log_scale: FloatArray,
    tolerance: float,
    max_steps: int,
) -> tuple[State, int]:
    """Return the state with the smallest residual that Newton's method reaches, and the number of steps.

    The search starts from `log_scale` (n,). On a surface with a boundary it starts from 0 if this breaks triangles.
    """
    start = problem.evaluate(log_scale)
    if not start.is_admissible:
        start = problem.evaluate(np.where(problem.fixed, log_scale, 0.0))
    tolerance = max(tolerance, problem.rounding_error(start))
    halvings = HALVINGS_BOUNDED if problem.is_bounded else HALVINGS
    best, steps = minimise(
        problem, start, Limits(tolerance, max_steps, GOAL_RESIDUAL, halvings, largest_step=MAX_STEP)
    )
    return best if best is problem.last else problem.evaluate(best.variables), steps


@compiled
def add_angles(
    i: int, j: int, k: int, a: float, b: float, c: float, angle_sum: FloatArray
) -> tuple[bool, float, float, float]:
    """Add the angles of a triangle with sides a, b, c opposite i, j, k to the sums there.

    If the triangle inequality is broken, the angle opposite the side that is too long is pi and the others are 0.
    Returns whether it is broken, and the cotangents at i, j, k, which are 0 in this case.
    """
    slack_a = min(b, c) - (a - max(b, c))
    slack_b = min(c, a) - (b - max(c, a))
    slack_c = min(a, b) - (c - max(a, b))
    if min(slack_a, slack_b, slack_c) <= 0.0:
        wide = i if slack_a <= 0.0 else (j if slack_b <= 0.0 else k)
        angle_sum[wide] += math.pi
        return True, 0.0, 0.0, 0.0
    perimeter = a + b + c
    root = math.sqrt(perimeter * slack_a * slack_b * slack_c)
    angle_i = 2 * math.atan2(root, perimeter * slack_a)
    angle_j = 2 * math.atan2(root, perimeter * slack_b)
    angle_sum[i] += angle_i
    angle_sum[j] += angle_j
    angle_sum[k] += math.pi - angle_i - angle_j  # saves a third of the time; as accurate as the sum
    return (
        False,
        (perimeter * slack_a - slack_b * slack_c) / (2 * root),
        (perimeter * slack_b - slack_c * slack_a) / (2 * root),
        (perimeter * slack_c - slack_a * slack_b) / (2 * root),
    )


@compiled
def sum_angles(
    tail: IntArray, length: FloatArray, scale: FloatArray, angle_sum: FloatArray, cots: FloatArray
) -> int:
    """Write the angle sum at each vertex and the cotangent opposite each half-edge; return the broken triangles.

    A side from i to j has the length length * scale_i * scale_j. If the triangle inequality is broken, the angles are
    those of the convex extension (Springborn, Schroeder, Pinkall 2008, Section 5.1): pi opposite the side that is too
    long and 0 at the others; the cotangents are 0. Returns the number of broken triangles.
    """
    broken = 0
    angle_sum[:] = 0.0
    for h in range(0, len(tail), 3):
        # The corner opposite side i is at the tail of side i + 2.
        j, k, i = tail[h], tail[h + 1], tail[h + 2]
        a = length[h] * scale[j] * scale[k]
        b = length[h + 1] * scale[k] * scale[i]
        c = length[h + 2] * scale[i] * scale[j]
        largest = max(a, b, c)
        a /= largest
        b /= largest
        c /= largest
        is_broken, cots[h], cots[h + 1], cots[h + 2] = add_angles(i, j, k, a, b, c, angle_sum)
        broken += is_broken
    return broken


@compiled
def find_suspects(twin: IntArray, cots: FloatArray, suspects: IntArray) -> int:
    """Write to `suspects` one half-edge of each edge that may not be Delaunay; return their number.

    Its cotangents have a negative sum, or it belongs to a triangle that breaks the triangle inequality.
    """
    count = 0
    for h in range(len(twin)):
        t = twin[h]
        if t < h:
            continue
        # The margin is the rounding error of the cotangents; the test that decides on a flip has its own margin.
        is_suspect = cots[h] + cots[t] < -1e-13 * (abs(cots[h]) + abs(cots[t]))
        for base in (h - h % 3, t - t % 3):
            # All cotangents of a triangle whose inequality is broken are 0.
            is_suspect |= cots[base] == 0.0 and cots[base + 1] == 0.0 and cots[base + 2] == 0.0
        if is_suspect:
            suspects[count] = h
            count += 1
    return count
