"""Moves of quantised cones that bring the rotations along handles near multiples of the quantum.

In the linear model the turning of a loop changes with the curvatures by a function w on the mesh, which is harmonic but
at the loop: moving curvature k from s to t turns it by k (w_t - w_s). So small moves of several cones together can
bring all loops near multiples, while E changes little.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...base.arrays import FloatArray, IntArray
from ...geometry.handles import off_multiple
from ...stages import ConeSolution
from ..sparse import ConeSearch
from .search import QuantisedCones

# Vertices around each cone among which it may move, and moves of one or two cones at most.
NEIGHBOURS, MOVES = 60, 30
# Rounds of comparing the linear model with the metric that it stands for.
ROUNDS = 4
# Radians below which nothing is gained.
ENOUGH = 1e-4


def align_handles(
    search: ConeSearch,
    quantised: QuantisedCones,
    by_scale: FloatArray,
    turned: Callable[[ConeSolution], FloatArray],
    bound: float,
) -> QuantisedCones:
    """Return quantised cones moved so that loops turn by near multiples of the quantum.

    Args:
        search: that found the cones.
        quantised: the cones.
        by_scale: (2 genus, n) derivative of the loops' turning by the log scale.
        turned: returns (2 genus,) what the loops turn by in the metric with given cones, radians.
        bound: the E allowed.
    """
    operator = search.operator
    by_curvature = operator.solve(np.ascontiguousarray(by_scale[:, operator.vertices].T))
    best, best_off = quantised, off_multiple(turned(quantised.solution), quantised.quantum)
    trial, off = best, best_off
    for _ in range(ROUNDS):
        if np.abs(best_off).max() <= ENOUGH:
            break
        moved = moved_cones(search, trial, by_curvature, off, bound)
        if np.array_equal(moved.solution.cones, trial.solution.cones):
            break
        trial, off = moved, off_multiple(turned(moved.solution), quantised.quantum)
        if (off**2).sum() < (best_off**2).sum():
            best, best_off = trial, off
    return best


def moved_cones(
    search: ConeSearch, quantised: QuantisedCones, by_curvature: FloatArray, off: FloatArray, bound: float
) -> QuantisedCones:
    """Move cones, one or two at a time, as long as what loops are off, by the linear model, gets less.

    Args:
        search: that found the cones.
        quantised: the cones.
        by_curvature: (f, 2 genus) derivative of the turning by curvature.
        off: (2 genus,) what the loops are off by now, radians.
        bound: of E.
    """
    operator = search.operator
    places = search.unknowns_of(quantised.solution.cones)
    curvatures = quantised.quantum * quantised.indices.astype(np.float64)
    before, caution = (places, off), 1.0
    for _ in range(MOVES):
        here = search.solution_of(places, curvatures).log_scale[operator.vertices]
        slack = bound**2 - float(here @ operator.weighted(here))
        if slack < 0 and places is not before[0]:
            # The coarse model promised more than there was.
            (places, off), caution = before, 2 * caution
            continue
        score = operator.solve(operator.weighted(here))
        cones, targets = _moves(search, places)
        if not len(cones):
            break
        k, old = curvatures[cones], places[cones]
        turned = k[:, None] * (by_curvature[targets] - by_curvature[old])
        bending = np.concatenate(
            [search.exact.squared_distances(places[c], targets[cones == c]) for c in np.unique(cones)]
        )
        dearer = 2 * k * (score[targets] - score[old]) + caution * k**2 * bending
        # The last stands for no move.
        cones, turned, dearer = np.append(cones, -1), np.vstack([turned, 0 * off]), np.append(dearer, 0.0)
        missing = ((off + turned) ** 2).sum(axis=1)
        pairs = missing[:, None] + missing - (off**2).sum() + 2 * turned @ turned.T
        pairs[(dearer[:, None] + dearer > max(slack, 0.0)) | (cones[:, None] == cones)] = np.inf
        one, two = np.unravel_index(np.argmin(pairs), pairs.shape)
        if not pairs[one, two] < 0.9 * (off**2).sum():
            break
        before, places = (places, off), places.copy()
        for move in (one, two):
            if cones[move] >= 0:
                places[cones[move]] = targets[move]
        off = off + turned[one] + turned[two]
    solution = search.solution_of(places, curvatures)
    inner = solution.log_scale[operator.vertices]
    energy = float(np.sqrt(inner @ operator.weighted(inner)))
    return replace(quantised, solution=solution, distortion=energy)


def _moves(search: ConeSearch, places: IntArray) -> tuple[IntArray, IntArray]:
    """Return which cone, and whereto, of all moves to usable vertices nearby; required cones stay."""
    cones, targets = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
    for i in range(len(search.coarse.fixed), len(places)):
        near = search.exact.near(int(places[i]), NEIGHBOURS)
        near = near[~np.isin(near, places)]
        cones.append(np.full(len(near), i))
        targets.append(near)
    return np.concatenate(cones), np.concatenate(targets)
