"""A search for cones on one mesh: coarse first, then exact, for any number of questions."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.sparse import csc_matrix

from .._arrays import BoolArray, FloatArray, IntArray
from ..errors import CurvatureError
from ..text import plural
from ..threads import meanwhile
from .coarse_model import candidates, coarse_model
from .dense_model import MANY, Limits
from .dense_search import DenseSearch
from .green import GreenOperator
from .pool import Pool
from .solution import FULL_TURN, ConeSolution, LaplacianInverse, target_from_log_scale

# Unknowns of the coarse model: one for so many vertices, within bounds that keep its dense inverse cheaper than the
# factorization of the mesh's own Laplacian.
VERTICES_PER_UNKNOWN, LEAST_SIZE, MOST_SIZE = 15, 400, 1200
# More cones than these are not searched for: a seam through them all is no use.
MOST_CONES = 200
# How far, as a factor of E^2, the coarse model is trusted: sets within are looked at on the mesh itself.
COARSE_DOUBT = 1.35
# The same where the factor by which the coarse model is off is known from one cone more.
HOPE = 1.15
# Where the best set of a size misses by less than this factor of E^2, others are tried.
NARROW = 1.1
# And where it misses by less than this one, shaken sets are tried so many times.
NEARLY, SEEDS = 1.03, 4
# Perturbations tried for each number of cones about the answer: one for so many vertices, within bounds, so that they
# take a like share of the time on all meshes.
VERTICES_PER_SHAKE, LEAST_SHAKES, MOST_SHAKES = 400, 12, 40
# Of vertices side by side, those with room for such an angle represent the others on the coarse model, the more so the
# higher the power.
ROOMY, PREFERENCE = 4 * np.pi, 4
# An E that is zero but for rounding.
NOTHING = 1e-9
# How many local optima of the coarse model are tried on the mesh when the best one misses narrowly.
RUNNERS = 3


def check_available(usable: BoolArray, required: IntArray, limits: Limits) -> None:
    """Raise CurvatureError if cones at the (n,) usable vertices and the required ones cannot carry the curvature."""
    if limits.fewest > MOST_CONES + len(required):
        raise CurvatureError(
            f"a total curvature of {limits.total / np.pi:.4g} pi needs {limits.fewest:,} cones or more within these "
            f"bounds, and the pursuit finds {MOST_CONES} at most: allow other angles, or choose the greedy search "
            "(--cones greedy), which has no bounds"
        )
    available = np.count_nonzero(usable) + np.count_nonzero(~usable[required])
    if available < limits.fewest:
        raise CurvatureError(
            f"cones are allowed at {plural(available, 'vertex', 'vertices')}, but {limits.fewest} or more cones are "
            f"needed for a total curvature of {limits.total / np.pi:.4g} pi"
        )


class ConeSearch:
    """The state of a search: the factorized Laplacian, the coarse model, and the vertices tried so far.

    Args:
        laplacian: (n, n) cotangent Laplacian of a connected mesh.
        curvature: (n,) angle defect, radians.
        areas: (n,) weights of the distortion that sum to 1.
        is_boundary: (n,) mask.
        order: (n,) the vertices in an order that does not depend on their numbering: ties go by it.
        limits: of the curvatures.
        required: (r,) vertices that are cones in any case.
        usable: (n,) mask of the vertices that may be cones.
        room: (n,) the widest angle of a cone at each vertex, radians; None: any that the limits allow.

    Attributes:
        tell: called with what is being tried.
    """

    def __init__(
        self,
        laplacian: csc_matrix,
        curvature: FloatArray,
        areas: FloatArray,
        is_boundary: BoolArray,
        order: IntArray,
        limits: Limits,
        required: IntArray,
        usable: BoolArray,
        room: FloatArray | None = None,
    ) -> None:
        check_available(usable, required, limits)
        self._laplacian, self.curvature, self.is_boundary = laplacian, curvature, is_boundary
        self.limits = limits
        self.tell: Callable[[str], None] = lambda _: None
        self.operator = GreenOperator(laplacian, areas, is_boundary, order)
        vertices = self.operator.vertices
        unknown = np.full(len(curvature), -1, dtype=np.int64)
        unknown[vertices] = np.arange(len(vertices))
        free = unknown[required]
        inner = curvature[vertices]
        self._shakes = min(max(len(vertices) // VERTICES_PER_SHAKE, LEAST_SHAKES), MOST_SHAKES)
        size = min(max(len(vertices) // VERTICES_PER_UNKNOWN, LEAST_SIZE), MOST_SIZE)
        with meanwhile(partial(coarse_model, self.operator, inner, size), 2 * len(vertices)) as modelling:
            log_scale = -self.operator.solve(inner)
            coarse = modelling.result().scaled_to(float(log_scale @ self.operator.weighted(log_scale)))
        self._coarse_model, self._free = coarse, free
        self._least = np.full(len(vertices), limits.least)
        self._fitness = np.ones(len(vertices))
        if room is not None:
            self._least = np.maximum(self._least, np.minimum(FULL_TURN - room[vertices], 0.0))
            self._fitness = (np.minimum(room[vertices], ROOMY) / ROOMY) ** PREFERENCE
        self.pool = Pool(self.operator, coarse, log_scale, free, limits, self._least)
        self.restrict(usable)

    def restrict(self, usable: BoolArray) -> None:
        """Search on among the (n,) usable vertices, with what is known about the mesh.

        Raises:
            CurvatureError: they cannot carry the curvature.
        """
        limits, free = self.limits, self._free
        check_available(usable, self.operator.vertices[free], limits)
        is_usable = usable[self.operator.vertices]
        is_usable[free] = False
        self.places = np.concatenate([free, candidates(self._coarse_model, is_usable * self._fitness)])
        kernel, slope = self._coarse_model.at(self.places)
        mask = np.ones(len(self.places), dtype=bool)
        mask[: len(free)] = False
        self.coarse = DenseSearch(
            np.ascontiguousarray(kernel),
            slope,
            self._coarse_model.constant,
            mask,
            np.arange(len(free)),
            limits,
            self._least[self.places],
        )
        self.pool.restrict(is_usable)

    @property
    def most_cones(self) -> int:
        """The largest number of cones searched for."""
        fixed = len(self.coarse.fixed)
        most = min(MOST_CONES + fixed, len(self.places))
        if self.limits.total > 0 and self.limits.least > 0:
            most = min(most, int(self.limits.total / self.limits.least + 1e-9))
        return most

    def fewest(self, bound: float, most: int | None = None) -> tuple[float, IntArray]:
        """Return E and members (places in the pool) of the smallest set with E <= bound that was found.

        Where none is among those of at most `most` cones, the best set.
        """
        goal = bound * bound
        most = self.most_cones if most is None else min(most, self.most_cones)
        self._survey(goal, most)
        known = sorted(self.coarse.best)
        count = next((c for c in known if self.coarse.best[c][0] <= goal), known[-1])
        # The coarse model may be off by some cones: up as far as it takes by the factor that it is off, and down again.
        failed = -1
        while not self.polished(count, goal, rough=True) <= goal and count < most:
            failed = count
            aim = goal / self._off(count)
            self.coarse.climb(aim, most, count)
            larger = sorted(c for c in self.coarse.best if c > count)
            if not larger:
                break
            count = next((c for c in larger if self.coarse.best[c][0] <= aim), larger[-1])
            if count < most and self.coarse.best[count][0] > aim:  # more cones bring nothing
                break
        off = self._off(count)
        while failed >= 0:
            between = (c for c in range(failed + 1, count) if c in self.coarse.best)
            middle = next((c for c in between if self.coarse.best[c][0] * off <= goal), None)
            if middle is None:
                break
            if self.polished(middle, goal, rough=True) <= goal:
                count = middle
            else:
                failed, off = middle, max(off, self._off(middle))
        # Then down one by one, with all means.
        if not self._best(count) <= goal and not self.polished(count, goal) <= goal and count < most:
            count = min(count + 1, most)
            self.polished(count, goal)
        while count - 1 >= len(self.coarse.fixed) and self._is_promising(count - 1, goal):
            if not self.polished(count - 1, goal) <= goal:
                break
            count -= 1
        found = {c: best for c, best in self.pool.model.best.items() if c <= most}
        good = [c for c in found if found[c][0] <= goal]
        count = min(good) if good else min(found, key=lambda c: (found[c][0], c))
        return self._result(count)

    def of_count(self, count: int) -> tuple[float, IntArray]:
        """Return E and members (places in the pool) of the best set of at most so many cones."""
        count = min(count, self.most_cones)
        self._climb(0.0, count + 1, count)
        self._improve(max(1, count - 2), count + 1)
        for some in sorted(size for size in self.coarse.best if size <= count)[-2:]:
            self.polished(some, 0.0)
        found = self.pool.model.best
        return self._result(min((c for c in found if c <= count), key=lambda c: (found[c][0], c)))

    def best_of_sizes(self, most: int) -> list[tuple[float, IntArray]]:
        """Return E and members of the best set of each size up to `most`, where it has a lower E than smaller ones."""
        most = min(most, self.most_cones)
        self.coarse.climb(0.0, most)
        if self.coarse.best:
            self._improve(1, most, math.inf)
        found: list[tuple[float, IntArray]] = []
        for count in range(most + 1):
            self.polished(count, math.inf)
        # Once more, downwards: a set may be best without one of the cones of the next larger.
        for count in range(most, -1, -1):
            self.polished(count, math.inf)
        for count in sorted(self.pool.model.best):
            energy, members = self._result(count)
            if count <= most and (not found or (energy < found[-1][0] - NOTHING)):
                found.append((energy, members))
        return found

    def _off(self, count: int) -> float:
        """Return the factor, 1 or more, by which E^2 with so many cones exceeds that of the coarse model.

        Where one of them is not known, it is as much as the coarse model is trusted.
        """
        coarse = self.coarse.best[count][0] if count in self.coarse.best else 0.0
        off = self._best(count) / coarse if coarse > 0 else math.inf
        return max(off, 1.0) if math.isfinite(off) else COARSE_DOUBT

    def _best(self, count: int) -> float:
        """Return the least E^2 found on the mesh with so many cones."""
        return self.pool.model.best[count][0] if count in self.pool.model.best else math.inf

    def _result(self, count: int) -> tuple[float, IntArray]:
        energy, members = self.pool.model.best[count]
        return float(np.sqrt(max(energy, 0.0))), members

    def _survey(self, goal: float, most: int) -> None:
        """Find good sets of all sizes up to the one that is needed, and a little on, on the coarse model."""
        self._climb(goal / COARSE_DOUBT, most, most)
        known = sorted(self.coarse.best)
        reached = [c for c in known if self.coarse.best[c][0] <= goal]
        count = reached[0] if reached else known[-1]
        self._improve(max(known[0], count - 3), min(count + 1, known[-1]), goal)

    def _climb(self, bound: float, most: int, count: int) -> None:
        """Find sets on the coarse model, of at most `most` cones; it is an error if none has `count` or fewer."""
        self.coarse.climb(bound, most)
        if min(self.coarse.best, default=count + 1) > count:
            raise CurvatureError(
                f"no {count} cones were found that carry a total curvature of {self.limits.total / np.pi:.4g} pi "
                "within their bounds: allow more of them or other angles, or choose the greedy search "
                "(--cones greedy), which has no bounds"
            )

    def _improve(self, least: int, most: int, goal: float = 0.0) -> None:
        model = self.coarse
        sizes = [size for size in sorted(model.best) if least <= size <= most]
        if not sizes:
            # On what is nearly flat, a few cones or none leave nothing to gain by more.
            return
        least, most = sizes[0], sizes[-1]
        for _ in range(4):
            better = model.descend(most, least)
            better |= model.ascend(least, most)
            if not better:
                break
        for count in range(most, least - 1, -1):
            # Only sets near the goal are worth it: it is they that decide.
            if (
                count in model.best
                and goal / COARSE_DOUBT < model.best[count][0]
                and (goal == 0 or model.best[count][0] < COARSE_DOUBT * goal)
            ):
                model.shaken(count, self._tries(count))

    def _tries(self, count: int) -> int:
        """Return how many perturbations of sets of a size are tried: large ones take long."""
        return max(4, self._shakes * MANY // max(count, MANY))

    def _is_promising(self, count: int, goal: float) -> bool:
        """Whether fewer cones may do, by the coarse model or by the sets tried."""
        if count < self.limits.fewest:
            return False
        coarse, known = self.coarse.best.get(count), self.pool.model.best.get(count)
        larger, coarse_larger = self.pool.model.best.get(count + 1), self.coarse.best.get(count + 1)
        if known is not None and known[0] <= goal * HOPE:
            return True
        if larger is None or coarse_larger is None or coarse is None:
            return known is None or known[0] <= goal * COARSE_DOUBT
        # The coarse model is off by nearly the same factor for one cone less.
        return coarse[0] * larger[0] <= goal * HOPE * coarse_larger[0]

    def polished(self, count: int, goal: float, rough: bool = False) -> float:
        """Return E^2 of the best set of a size that the mesh itself shows, infinite if there is none.

        Starts are the coarse model's set, and neighbours in size of what is known. Unless it is rough, more is tried
        where the goal is missed narrowly.
        """
        self.tell(plural(count, "cone"))
        pool, model = self.pool, self.pool.model
        starts = []
        if count in self.coarse.best:
            starts.append(pool.insert(self.places[self.coarse.best[count][1]]))
        larger = min((known for known in model.best if known > count), default=0)
        if larger:
            shrunk: IntArray | None = model.best[larger][1]
            while shrunk is not None and len(shrunk) > count:
                shrunk = model.shrunk(shrunk)
            if shrunk is not None:
                starts.append(shrunk)
        if count - 1 in model.best:
            grown = model.grown(model.best[count - 1][1])
            if grown is not None:
                starts.append(grown)
        if count in model.best:
            starts.append(model.best[count][1])
        if count > MANY:
            starts = sorted(starts, key=model.energy)[:1]
        best = None
        for start in starts:
            energy, members = model.exchanged(start)
            if np.isfinite(energy) and (best is None or energy < best[0]):
                best = energy, members
        if best is None:
            return np.inf
        energy, members = pool.polish(best[1])
        if not rough and energy > goal and (energy <= goal * NARROW or goal == 0):
            for _, runner in self.coarse.runners.get(count, [])[:RUNNERS]:
                energy = min(energy, pool.polish(pool.insert(self.places[runner]))[0])
                if energy <= goal:
                    break
            for seed in range(SEEDS):
                # Once in any case, and again where next to nothing is missing.
                if energy <= goal or (seed and energy > goal * NEARLY):
                    break
                if model.shaken(count, self._tries(count), seed):
                    energy = min(energy, pool.polish(model.best[count][1])[0])
        return energy

    def solution(self, members: IntArray) -> ConeSolution:
        """Return the cones of a set, those of no curvature left out unless they are required.

        After the required ones, they come in the order of the search's vertices, not in that in which they were found.
        """
        fixed = len(self.coarse.fixed)
        free = members[fixed:]
        members = np.concatenate([members[:fixed], free[np.argsort(self.pool.unknowns[free])]])
        curvatures = self.pool.curvatures(members)
        keep = np.abs(curvatures) > 1e-9
        keep[:fixed] = True
        kept = curvatures[keep]
        if self.limits.has_sum and len(kept):
            # What rounding and those left out have taken from the sum: no metric has another one.
            kept += (self.limits.total - kept.sum()) / len(kept)
        return self.solution_of(self.pool.unknowns[members[keep]], kept)

    def solution_of(self, unknowns: IntArray, curvatures: FloatArray) -> ConeSolution:
        """Return the solution of given cones and curvatures."""
        operator = self.operator
        cones = operator.vertices[unknowns]
        target = np.zeros(len(self.curvature))
        target[cones] = curvatures
        log_scale = np.zeros(len(target))
        log_scale[operator.vertices] = operator.solve((target - self.curvature)[operator.vertices])
        absorbed = target_from_log_scale(self._laplacian, self.curvature, log_scale, self.is_boundary)
        is_zero = np.ones(len(target), dtype=bool)
        is_zero[operator.vertices] = False
        inverse = LaplacianInverse(operator.solve_at_vertices, self._laplacian, is_zero, operator.break_even)
        return ConeSolution(cones, target + absorbed, log_scale, inverse)
