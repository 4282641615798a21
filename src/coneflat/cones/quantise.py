"""Cones whose curvatures are multiples of a quantum.

For given positions this is an integer least squares problem in a few unknowns; here positions and quanta are searched
together, by moves that keep the sum.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .._arrays import IntArray
from ..errors import CurvatureError, OptionError
from ..options import LEAST_QUANTUM
from .cone_search import COARSE_DOUBT, ConeSearch
from .lattice import Charges, Lattice
from .pool import ROUNDS, WORTHWHILE
from .solution import FULL_TURN, ConeSolution

# How far, relative, 2 pi chi may be from a multiple of the quantum: what a quantum typed with seven digits is off by.
WHOLE = 1e-6
# Curvature, radians, that stands for "no bound": more than that of any cone worth having.
UNBOUNDED = 2000 * math.pi
# The survey ends so many sizes after the goal is met, or after E has ceased to fall: more cones of whole quanta need
# not be better.
BEYOND, STALLED = 2, 5


@dataclass(frozen=True, eq=False)
class QuantisedCones:
    """Cones with whole numbers of quanta.

    Attributes:
        solution: the cones.
        units: (s,) quanta of each.
        quantum: radians, made exact where 2 pi is a multiple of it but for rounding.
        distortion: E of the linear model.
    """

    solution: ConeSolution
    units: IntArray
    quantum: float
    distortion: float


def quantise_cones(
    search: ConeSearch,
    quantum: float = math.pi / 2,
    *,
    distortion: float = 0.2,
    count: int | None = None,
    most: int | None = None,
) -> QuantisedCones:
    """Find the fewest cones with curvatures that are multiples of a quantum and E <= distortion.

    Args:
        search: see `coneflat.cones.pursuit.open_search`; cones it has found serve as starts.
        quantum: radians.
        distortion: the E allowed.
        count: a number of cones instead: the least distortion with at most so many.
        most: of the fewest, the limit.

    Raises:
        OptionError: the quantum makes no sense.
        CurvatureError: no multiples within the bounds sum to 2 pi chi.
    """
    lattice = open_lattice(search, quantum)
    goal = 0.0 if count is not None else distortion * distortion
    if not goal >= 0 or (count is None and not 0 < distortion < math.inf):
        raise OptionError(f"the distortion allowed must be a positive number, not {distortion:g}")
    most = min(search.most_cones, *(limit for limit in (count, most) if limit is not None), search.most_cones)
    survey(search, lattice, goal, most)
    exact = Lattice(search.pool.model, lattice.quantum, lattice.least, lattice.most, lattice.total)
    sizes = sorted(size for size in lattice.best if size <= most)
    if not sizes:
        needed = min(lattice.best, default=least_count(lattice))
        raise CurvatureError(
            f"{most} cones cannot carry the total curvature in multiples of {lattice.quantum / np.pi:.4g} pi: "
            f"{needed} or more are needed"
        )
    first = next((size for size in sizes if lattice.best[size].energy <= goal), sizes[-1])
    for size in sizes[sizes.index(first) :]:
        if polish(search, lattice, exact, size) <= goal:
            break
    for size in reversed(sizes[: sizes.index(first)]):
        near = lattice.best[size].energy <= goal * COARSE_DOUBT
        if not near or not polish(search, lattice, exact, size) <= goal:
            break
    good = [size for size in exact.best if exact.best[size].energy <= goal]
    charges = exact.best[
        min(good) if good else min(exact.best, key=lambda size: (exact.best[size].energy, size))
    ]
    curvatures = (lattice.quantum * charges.units).astype(np.float64)
    solution = search.solution_of(search.pool.unknowns[charges.members], curvatures)
    energy = float(np.sqrt(max(charges.energy, 0.0)))
    return QuantisedCones(solution, charges.units, lattice.quantum, energy)


def open_lattice(search: ConeSearch, quantum: float) -> Lattice:
    """Return the lattice of multiples of a quantum that a search's limits allow, without charges yet."""
    if not LEAST_QUANTUM <= quantum <= FULL_TURN * (1 + WHOLE):
        raise OptionError(f"the quantum must be from {LEAST_QUANTUM:g} radians to 2 pi, not {quantum:g}")
    parts = round(FULL_TURN / quantum)
    if abs(parts * quantum - FULL_TURN) <= WHOLE * FULL_TURN:
        quantum = FULL_TURN / parts
    limits = search.limits
    total = None
    if np.isfinite(limits.total):
        total = round(limits.total / quantum)
        if abs(total * quantum - limits.total) > WHOLE * max(abs(limits.total), 1.0):
            raise CurvatureError(
                f"curvatures must sum to 2 pi chi = {limits.total / np.pi:.6g} pi, which is no multiple of "
                f"{quantum / np.pi:.6g} pi"
            )
    least = math.ceil(max(limits.least, -UNBOUNDED) / quantum - WHOLE)
    most = math.floor(min(limits.most, UNBOUNDED) / quantum + WHOLE)
    if (
        least > most
        or least == most == 0
        or (total is not None and (total > 0 >= most or total < 0 <= least))
    ):
        raise CurvatureError(
            f"no multiple of {quantum / np.pi:.4g} pi lies within the bounds of cone curvatures, {limits.text()}, and "
            "helps to their sum"
        )
    return Lattice(search.coarse, quantum, least, most, total)


def least_count(lattice: Lattice) -> int:
    """Return the least number of cones that can carry the total."""
    if not lattice.total:
        return 0
    return math.ceil(lattice.total / (lattice.most if lattice.total > 0 else lattice.least))


def survey(search: ConeSearch, lattice: Lattice, goal: float, most: int) -> None:
    """Find good charges of all sizes up to the one that is needed, and a little on, on the coarse model."""
    model = search.coarse
    fewest = max(least_count(lattice), len(model.fixed))
    model.climb(goal / COARSE_DOUBT if goal > 0 else 0.0, min(most + 1, search.most_cones))
    for members in [entry[1] for entry in model.best.values()]:
        start = lattice.rounded(members)
        if start is not None:
            lattice.offer(lattice.exchanged(start))
    if not lattice.best:
        seed = _any_charges(lattice, fewest)
        if seed is not None:
            lattice.offer(lattice.exchanged(seed))
    if not lattice.best:
        return
    size = min(lattice.best)
    beyond = stalled = 0
    least = math.inf
    while size < min(most + 1, search.most_cones) and beyond < BEYOND and stalled < STALLED:
        grown = lattice.grown(lattice.best[size])
        if grown is None:
            break
        lattice.offer(lattice.exchanged(grown))
        size = len(grown)
        beyond += lattice.best[size].energy <= goal
        stalled = 0 if lattice.best[size].energy < least * (1 - WORTHWHILE) else stalled + 1
        least = min(least, lattice.best[size].energy)
    for size in sorted(lattice.best, reverse=True):
        shrunk = lattice.shrunk(lattice.best[size])
        if shrunk is not None:
            lattice.offer(lattice.exchanged(shrunk))


def _any_charges(lattice: Lattice, count: int) -> Charges | None:
    """Return charges that keep sum and bounds, to start from."""
    model = lattice.model
    members = np.concatenate(
        [model.fixed, np.flatnonzero(model.usable)[np.argsort(model.slope[model.usable], kind="stable")]]
    )[:count]
    if lattice.total is None or not len(members):
        signs = np.where(model.slope[members] < 0, 1, -1)
        units = np.clip(signs, lattice.least, lattice.most)
        return lattice.descended(members[units != 0], units[units != 0])
    share = np.full(len(members), lattice.total // len(members))
    share[: lattice.total - share.sum()] += 1
    if (share == 0).any() or share.max() > lattice.most or share.min() < lattice.least:
        return None
    return lattice.descended(members, share)


def polish(search: ConeSearch, lattice: Lattice, exact: Lattice, size: int) -> float:
    """Move the coarse model's charges of a size over the mesh until E comes to rest; return E^2."""
    pool, start = search.pool, lattice.best[size]
    members = pool.insert(search.places[start.members])
    charges = exact.exchanged(exact.descended(members, start.units))
    for _ in range(ROUNDS):
        targets = pool.targets(
            charges.members, (lattice.quantum * charges.units).astype(np.float64), charges.energy
        )
        known = len(pool.unknowns)
        pool.insert(targets)
        if len(pool.unknowns) == known:
            break
        moved = exact.exchanged(exact.descended(charges.members, charges.units))
        stalled = not moved.energy < charges.energy * (1 - WORTHWHILE)
        charges = moved
        if stalled:
            break
    exact.offer(charges)
    return charges.energy
