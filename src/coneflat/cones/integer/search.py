"""Search for the fewest cones whose curvatures are multiples of a quantum.

For given positions this is an integer least-squares problem in a few unknowns. Here, positions and indices are searched
together, by moves that preserve the sum.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...base.arrays import IntArray
from ...base.defaults import DISTORTION, TYPED_TOLERANCE
from ...errors import CurvatureError
from ...stages import ConeSolution
from ..sparse.dense_model import MIN_RELATIVE_GAIN
from ..sparse.fine_model import MAX_ROUNDS, MIN_PROMISED_GAIN
from ..sparse.search import ConeSearch
from ..sparse.starts import DenseStarts
from .lattice import IndexedCones, Lattice
from .moves import Quanta

# Curvature, radians, that represents "no bound"; larger than that of any useful cone.
UNBOUNDED = 2000 * math.pi
# The search on the coarse model ends this number of sizes after the goal is met, or after E has stopped decreasing:
# with integer quanta, more cones are not always better.
SIZES_PAST_GOAL, SIZES_PAST_STALL = 2, 5
# Sets with fewer cones are not searched for from sets whose E^2 exceeds the goal by more than this factor.
MAX_ENERGY_RATIO = 4.0


@dataclass(frozen=True, eq=False)
class QuantisedCones:
    """Cones whose curvatures are integer multiples of a quantum.

    Attributes:
        solution: the cones.
        indices: (s,) curvature of each cone in quanta.
        quantum: radians; corrected if 2 pi is a multiple of it up to rounding.
        distortion: E of the linear model.
    """

    solution: ConeSolution
    indices: IntArray
    quantum: float
    distortion: float


def quantise_cones(
    search: ConeSearch,
    quantum: float,
    *,
    distortion: float = DISTORTION,
    count: int | None = None,
    max_count: int | None = None,
) -> QuantisedCones:
    """Return the fewest cones with curvatures that are multiples of a quantum and E <= distortion.

    Args:
        search: the search of the mesh; cones that it has found are used as initial sets.
        quantum: radians, positive and at most 2 pi.
        distortion: the allowed E, positive.
        count: minimise E with at most this number of cones instead; None to find the fewest.
        max_count: largest number of cones; None for no limit.

    Raises:
        CurvatureError: no multiples within the bounds sum to 2 pi chi.
    """
    lattice = make_lattice(search, quantum)
    goal = 0.0 if count is not None else distortion * distortion
    max_count = min(limit for limit in (count, max_count, search.max_cones) if limit is not None)
    search_coarse(search, lattice, goal, max_count)
    fine = Lattice(search.fine, lattice.quanta, lattice.total)
    sizes = [size for size in lattice.best.sizes if size <= max_count]
    if not sizes:
        raise CurvatureError(
            f"{max_count} cones cannot absorb the total curvature in multiples of "
            f"{lattice.quanta.quantum / np.pi:.4g} pi: "
            f"{min(lattice.best.sizes, default=lattice.fewest)} or more are needed"
        )
    first = next(
        (size for size in sizes if lattice.best.energy(size) <= goal), min(sizes, key=lattice.best.energy)
    )
    for size in sizes[sizes.index(first) :]:
        if refine(search, lattice, fine, size) <= goal:
            break
    for size in reversed(sizes[: sizes.index(first)]):
        is_near = lattice.best.energy(size) <= goal * DenseStarts.error
        if not is_near or not refine(search, lattice, fine, size) <= goal:
            break
    best = fine.best.fewest(goal)
    order = _order_to_round_in(search, best.members)
    places = search.fine.unknowns[best.members[order]]
    solution = search.solution_of(places, lattice.curvatures(best)[order])
    return QuantisedCones(solution, best.indices[order], lattice.quanta.quantum, math.sqrt(best.energy))


def make_lattice(search: ConeSearch, quantum: float) -> Lattice:
    """Return the lattice of multiples of a quantum within the limits of a search, without cones yet.

    Raises:
        CurvatureError: no multiples within the bounds have the required sum.
    """
    parts = round(math.tau / quantum)
    if abs(parts * quantum - math.tau) <= TYPED_TOLERANCE * math.tau:
        quantum = math.tau / parts
    limits = search.limits
    total = None
    if limits.has_sum:
        total = round(limits.total / quantum)
        if abs(total * quantum - limits.total) > TYPED_TOLERANCE * max(abs(limits.total), 1.0):
            raise CurvatureError(
                f"curvatures must sum to 2 pi chi = {limits.total / np.pi:.6g} pi, which is not a multiple of "
                f"{quantum / np.pi:.6g} pi"
            )
    lower = math.ceil(max(limits.lower, -UNBOUNDED) / quantum - TYPED_TOLERANCE)
    upper = math.floor(limits.upper / quantum + TYPED_TOLERANCE)
    if (
        lower > upper
        or lower == upper == 0
        or (total is not None and (total > 0 >= upper or total < 0 <= lower))
    ):
        raise CurvatureError(
            f"no multiple of {quantum / np.pi:.4g} pi lies within the bounds of cone curvatures, {limits.text()}, and "
            "contributes to their sum"
        )
    return Lattice(search.dense_starts.model, Quanta(float(quantum), lower, upper, total is not None), total)


def _order_to_round_in(search: ConeSearch, members: IntArray) -> IntArray:
    """Return (s,) the order of cones: first the required ones, then the others by descending slope of E^2.

    Integer grids depend on this order by chance: of eight orders that were tried, this was among the three for which
    the sample and a scan had grids of about the requested size. If slopes are equal up to rounding, the order is that
    of the vertices of the search.
    """
    order, required = search.fine.in_order(members), len(search.fine.fixed)
    slope = search.fine.slope[members[order[required:]]]
    steps = np.round(slope / max(MIN_RELATIVE_GAIN * np.abs(slope).max(initial=0.0), np.finfo(float).tiny))
    return np.append(order[:required], order[required:][np.argsort(-steps, kind="stable")])


def search_coarse(search: ConeSearch, lattice: Lattice, goal: float, max_count: int) -> None:
    """Find good sets of cones on the coarse model, of all sizes up to slightly more than needed."""
    model, best = search.dense_starts.model, lattice.best
    fewest = max(lattice.fewest, len(model.fixed))
    max_count = min(max_count + 1, search.max_cones)
    model.climb(goal / DenseStarts.error, max_count)
    for cones in model.best:
        # Of many sizes, fewer are rounded: growing finds the others.
        if len(cones) % max(1, len(cones) // 32) == 0:
            _offer(lattice, lattice.rounded(cones.members))
    if not best.sizes:
        start = lattice.initial_cones(fewest)
        if start is None:
            return
        best.offer(lattice.exchanged(start))
    size, beyond, stalled, smallest = min(best.sizes), 0, 0, math.inf
    while size < max_count and beyond < SIZES_PAST_GOAL and stalled < SIZES_PAST_STALL:
        _offer(lattice, lattice.grown(best[size]), max_count)
        size = min((larger for larger in best.sizes if larger > size), default=max_count)
        beyond += best.energy(size) <= goal
        stalled = 0 if best.energy(size) < smallest * (1 - MIN_PROMISED_GAIN) else stalled + 1
        smallest = min(smallest, best.energy(size))
    # The fewest cones do not matter where none meet the goal.
    ratio = MAX_ENERGY_RATIO if best.fewest(goal).energy <= goal * DenseStarts.error else 0.0
    for size in reversed(best.sizes):
        if best.energy(size) > goal * ratio and size < max_count:
            break
        _offer(lattice, lattice.shrunk(best[size]), max_count)


def _offer(lattice: Lattice, cones: IndexedCones | None, max_count: float = math.inf) -> None:
    """Improve cones by exchanges and store them, unless they are too far from the best set of their size."""
    if (
        cones is not None
        and len(cones) <= max_count
        and cones.energy < DenseStarts.error * lattice.best.energy(len(cones))
    ):
        lattice.best.offer(lattice.exchanged(cones))


def refine(search: ConeSearch, lattice: Lattice, fine: Lattice, size: int) -> float:
    """Move the cones of the best coarse set of a size over the mesh until E converges; return E^2."""
    model, start = search.fine, lattice.best[size]
    members = model.insert(search.dense_starts.places[start.members])
    cones = fine.exchanged(fine.descended(members, start.indices))
    for _ in range(MAX_ROUNDS):
        known_count = len(model.unknowns)
        model.insert(model.targets(cones.members, fine.curvatures(cones), cones.energy))
        if len(model.unknowns) == known_count:
            break
        moved = fine.exchanged(fine.descended(cones.members, cones.indices))
        stalled = not moved.energy < cones.energy * (1 - MIN_PROMISED_GAIN)
        cones = moved
        if stalled:
            break
    fine.best.offer(cones)
    return cones.energy
