"""The start of Newton's method settled around cones, where it is far off, before all of the surface is looked at.

To first order the curvature comes out right but within a few rings of cones, at one vertex in a hundred of a fine mesh.
Newton's method on these alone, with the log scale of all others held, takes the steps that it would take there, and
these touch a small part of the triangles.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix

from ..._arrays import FloatArray, IntArray, has_any
from ...compiled import compiled
from ...errors import MetricError
from ...solver import factorize
from ...solver.newton import Limits, Point, minimise
from .newton import add_angles, may_be_flipped

if TYPE_CHECKING:
    from .newton import ConformalProblem, State

# Vertices that miss their curvature by more, radians, are settled, but not more than this share of all; and so many
# rings around them.
FAR_OFF, SHARE, RINGS = 1e-2, 0.003, 4
# Curvature missed at which to stop, and Newton steps at most.
GOAL, STEPS = 1e-4, 10
# Share of all vertices that may be settled: with more, steps on all cost little more. On meshes of so many vertices.
MOST, LARGE = 0.12, 5000


def settled(problem: ConformalProblem, start: State) -> FloatArray | None:
    """Return the log scale (n,) of a state, better around the vertices that miss their curvature; None if that fails.

    The triangulation is flipped to Delaunay there. Nothing is done on small meshes, or where much is missed.
    """
    n = len(start.place)
    if n < LARGE or not start.is_admissible:
        return None
    missed = np.abs(start.residual)
    rank = n - 1 - int(SHARE * n)
    is_chosen = missed > max(FAR_OFF, float(np.partition(missed, rank)[rank]))
    corners = _corners(problem)
    for _ in range(RINGS):
        if np.count_nonzero(is_chosen) > MOST * n:
            return None
        is_chosen[corners[has_any(is_chosen, corners)]] = True
    chosen = np.flatnonzero(is_chosen & ~problem.fixed)
    if not 0 < len(chosen) <= MOST * n:
        return None
    around = Surroundings(problem, start, chosen)
    limits = Limits(GOAL, STEPS, GOAL, halvings=10, largest_step=1.0)
    best, _ = minimise(around, around.evaluate(start.place[chosen]), limits)
    if not best.largest < float(np.abs(start.residual).max()):
        return None
    return around.whole(best.place)


def _corners(problem: ConformalProblem) -> IntArray:
    """Return (m, 3) the vertices of each triangle, in no order of interest: a view, where `faces` is a copy."""
    return problem.triangulation.tail.reshape(-1, 3)


class Surroundings:
    """The problem in the log scale of a few vertices; see `ConformalProblem`.

    Args:
        problem: whose triangulation is flipped, and flips are recorded.
        start: its state evaluated last.
        chosen: (p,) vertices.
    """

    def __init__(self, problem: ConformalProblem, start: State, chosen: IntArray) -> None:
        self.problem, self.start, self.chosen = problem, start, chosen
        self._local = np.full(len(start.place), -1)
        self._local[chosen] = np.arange(len(chosen))
        self._cots = start.cots.copy()
        self._middle = float(start.place.max() + start.place.min()) / 2
        self._faces = self._find_faces()
        self._last: Point | None = None

    def _find_faces(self) -> IntArray:
        return np.flatnonzero(has_any(self._local >= 0, _corners(self.problem)))

    def whole(self, place: FloatArray) -> FloatArray:
        """Return (n,) the log scale of all vertices."""
        log_scale = self.start.place.copy()
        log_scale[self.chosen] = place
        return log_scale

    def evaluate(self, place: FloatArray) -> Point:
        """Flip to Delaunay in the scaled metric around the vertices, and return the curvature there."""
        log_scale, problem = self.whole(place), self.problem
        sums, broken = self._sum_angles(log_scale)
        suspects = find_suspects_among(problem.triangulation.twin, self._cots, self._faces)
        if len(suspects):
            flipped = problem.flip(log_scale, suspects)
            if len(flipped):
                problem.record(flipped)
                self._faces = self._find_faces()
                sums, broken = self._sum_angles(log_scale)
        curvature = problem.flat_turn[self.chosen] - sums
        residual = problem.target[self.chosen] - curvature
        self._last = Point(place, residual, not (problem.is_bounded and broken))
        return self._last

    def _sum_angles(self, log_scale: FloatArray) -> tuple[FloatArray, int]:
        sums = np.zeros(len(self.chosen))
        triangulation = self.problem.triangulation
        broken = sum_angles_among(
            triangulation.tail,
            triangulation.length,
            log_scale,
            self._middle,
            self._faces,
            self._local,
            sums,
            self._cots,
        )
        return sums, broken

    def direction(self, here: Point, exactly: bool) -> tuple[FloatArray, bool]:
        """Return the Newton direction."""
        if here is not self._last:
            here = self.evaluate(here.place)
        factor = factorize(self._hessian(), is_noted=False, is_scattered=True)
        step = factor.solve(here.residual)
        if not np.isfinite(step).all():
            raise MetricError("no finite step around the cones")
        return step, True

    def _hessian(self) -> csc_matrix:
        tail, faces, local = self.problem.triangulation.tail, self._faces, self._local
        halfedges = (3 * faces[:, None] + np.arange(3)).ravel()
        after = (3 * faces[:, None] + [1, 2, 0]).ravel()
        one, two, weight = local[tail[halfedges]], local[tail[after]], self._cots[halfedges] / 2
        both = (one >= 0) & (two >= 0)
        count = len(self.chosen)
        diagonal = np.bincount(one[one >= 0], weight[one >= 0], count)
        diagonal += np.bincount(two[two >= 0], weight[two >= 0], count)
        own = np.arange(count)
        rows, columns = (
            np.concatenate([one[both], two[both], own]),
            np.concatenate([two[both], one[both], own]),
        )
        values = np.concatenate([-weight[both], -weight[both], diagonal])
        return csc_matrix(coo_matrix((values, (rows, columns)), shape=(count, count)))


@compiled
def sum_angles_among(
    tail: IntArray,
    length: FloatArray,
    log_scale: FloatArray,
    middle: float,
    faces: IntArray,
    local: IntArray,
    sums: FloatArray,
    cots: FloatArray,
) -> int:
    """Add the angles of some triangles to the sums (p,) at their vertices that have a number there, -1 for none.

    cots: (3m,) filled at these triangles; see `newton.sum_angles`. middle: of the log scale, against overflow.
    """
    broken = 0
    own, angles = np.empty(3), np.empty(3)
    for f in faces:
        base = 3 * f
        for x in range(3):
            own[x] = math.exp((log_scale[tail[base + x]] - middle) / 2)
        # Side x runs from the tail of half-edge x to that of the next, and is opposite the tail of the one after it.
        a, b, c = (
            length[base] * own[0] * own[1],
            length[base + 1] * own[1] * own[2],
            length[base + 2] * own[2] * own[0],
        )
        largest = max(a, b, c)
        angles[:] = 0.0
        is_broken, _, cots[base], cots[base + 1], cots[base + 2] = add_angles(
            2, 0, 1, a / largest, b / largest, c / largest, angles
        )
        broken += is_broken
        for x in range(3):
            at = local[tail[base + x]]
            if at >= 0:
                sums[at] += angles[x]
    return broken


@compiled
def find_suspects_among(twin: IntArray, cots: FloatArray, faces: IntArray) -> IntArray:
    """Return a half-edge of each edge of some triangles that may not be Delaunay; see `newton.find_suspects`."""
    found = np.empty(3 * len(faces), np.int64)
    count = 0
    for f in faces:
        for h in range(3 * f, 3 * f + 3):
            t = twin[h]
            if t >= 0 and may_be_flipped(cots, h, t):
                found[count] = h
                count += 1
    return found[:count].copy()
