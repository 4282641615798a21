"""Quantised cones moved so that the rotations of loops along handles are close to multiples of the quantum.

The linear model predicts how the rotations and E change; the exact metric decides.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...base.arrays import FloatArray, IntArray
from ...geometry.handles import difference_from_multiple
from ...stages import ConeSolution
from ..sparse.search import ConeSearch
from .search import QuantisedCones

# Number of vertices around each cone to which it may move, fewer where there are many cones, since pairs of moves are
# compared; and largest number of moves of one or two cones.
MAX_NEIGHBOURS, MAX_COMPARED, MAX_MOVES = 60, 2_000, 30
# Largest number of comparisons of the linear model with the exact metric.
MAX_COMPARISONS = 4
# Error of the rotations, radians, at which moving cones stops.
MIN_GAIN = 1e-4
# Factor by which a pair of moves must reduce the squared error of the rotations.
MIN_ERROR_RATIO = 0.9


def align_handles(
    search: ConeSearch,
    quantised: QuantisedCones,
    by_scale: FloatArray,
    holonomy: Callable[[ConeSolution], FloatArray],
    bound: float,
) -> QuantisedCones:
    """Return quantised cones that are moved so that the holonomy of loops is close to multiples of the quantum.

    Args:
        search: the search that found the cones.
        quantised: the cones.
        by_scale: (2 genus, n) derivative of the rotation along loops by the log conformal factor.
        holonomy: function that returns (2 genus,) the rotations along loops in the metric with given cones, radians.
        bound: the allowed E.
    """
    operator = search.operator
    by_curvature = operator.solve(np.ascontiguousarray(by_scale[:, operator.vertices].T))
    best, best_off = quantised, difference_from_multiple(holonomy(quantised.solution), quantised.quantum)
    trial, off = best, best_off
    for _ in range(MAX_COMPARISONS):
        if np.abs(best_off).max() <= MIN_GAIN:
            break
        moved = moved_cones(search, trial, by_curvature, off, bound)
        if np.array_equal(moved.solution.cones, trial.solution.cones):
            break
        trial, off = moved, difference_from_multiple(holonomy(moved.solution), quantised.quantum)
        if (off**2).sum() < (best_off**2).sum():
            best, best_off = trial, off
    return best


def moved_cones(
    search: ConeSearch, quantised: QuantisedCones, by_curvature: FloatArray, off: FloatArray, bound: float
) -> QuantisedCones:
    """Return cones moved one or two at a time while the error of the holonomy decreases in the linear model.

    Args:
        search: the search that found the cones.
        quantised: the cones.
        by_curvature: (f, 2 genus) derivative of the rotation along loops by curvature.
        off: (2 genus,) current difference of the rotations from multiples of the quantum, radians.
        bound: the allowed E.
    """
    operator = search.operator
    places = operator.unknowns_of(quantised.solution.cones)
    curvatures = quantised.quantum * quantised.indices.astype(np.float64)
    before, penalty = (places, off), 1.0
    for _ in range(MAX_MOVES):
        log_scale = search.solution_of(places, curvatures).log_scale[operator.vertices]
        slack = bound * bound - float(log_scale @ operator.weighted(log_scale))
        if slack < 0 and places is not before[0]:
            # The coarse model underestimated E: undo the move and increase its penalty.
            (places, off), penalty = before, 2 * penalty
            continue
        moves = _affordable_moves(
            search, places, curvatures, log_scale, by_curvature, penalty, max(slack, 0.0)
        )
        pair = None if moves is None else moves.best_pair(off, max(slack, 0.0))
        if moves is None or pair is None:
            break
        before, places = (places, off), places.copy()
        for move in pair:
            if moves.cones[move] >= 0:
                places[moves.cones[move]] = moves.targets[move]
            off = off + moves.turns[move]
    solution = search.solution_of(places, curvatures)
    inner = solution.log_scale[operator.vertices]
    energy = float(np.sqrt(inner @ operator.weighted(inner)))
    return replace(quantised, solution=solution, distortion=energy)


@dataclass(frozen=True, eq=False)
class _Moves:
    """Moves of single cones, of which the last one is no move.

    Attributes:
        cones: (k,) index of each cone, -1 for no move.
        targets: (k,) unknown to which it moves.
        costs: (k,) predicted change of E^2.
        turns: (k, 2 genus) predicted change of the rotations, radians.
    """

    cones: IntArray
    targets: IntArray
    costs: FloatArray
    turns: FloatArray

    def best_pair(self, off: FloatArray, slack: float) -> tuple[int, int] | None:
        """Return the two moves of different cones that reduce the error of the rotations most, or None.

        Args:
            off: (2 genus,) difference of the rotations from multiples of the quantum, radians.
            slack: largest change of E^2.
        """
        squared_errors = ((off + self.turns) ** 2).sum(axis=1)
        pairs = squared_errors[:, None] + squared_errors - (off**2).sum() + 2 * self.turns @ self.turns.T
        is_costly = self.costs[:, None] + self.costs > slack
        pairs[is_costly | (self.cones[:, None] == self.cones)] = np.inf
        first, second = np.unravel_index(np.argmin(pairs), pairs.shape)
        if not pairs[first, second] < MIN_ERROR_RATIO * (off**2).sum():
            return None
        return int(first), int(second)


def _affordable_moves(
    search: ConeSearch,
    places: IntArray,
    curvatures: FloatArray,
    log_scale: FloatArray,
    by_curvature: FloatArray,
    penalty: float,
    slack: float,
) -> _Moves | None:
    """Return the moves to nearby vertices that increase E^2 by at most `slack` in a pair; None if there are none.

    Moving curvature k from s to t changes E^2 by 2 k (q_t - q_s) + k^2 ||g_s - g_t||^2, where q is half the derivative.

    Args:
        search: the search that found the cones.
        places, curvatures: (s,) unknowns and curvatures of the cones.
        log_scale: (f,) phi of the cones.
        by_curvature: (f, 2 genus) derivative of the rotation along loops by curvature.
        penalty: factor of the distances between Green's functions, which the coarse model underestimates.
        slack: largest change of E^2.
    """
    operator = search.operator
    score = operator.solve(operator.weighted(log_scale))
    cones, targets, distances = _moves_nearby(search, places)
    if not len(cones):
        return None
    moved, origins = curvatures[cones], places[cones]
    costs = 2 * moved * (score[targets] - score[origins]) + penalty * moved**2 * distances
    affordable = np.flatnonzero(costs + min(costs.min(), 0.0) <= slack)
    turns = moved[:, None] * (by_curvature[targets] - by_curvature[origins])
    return _Moves(
        np.append(cones[affordable], -1),
        np.append(targets[affordable], -1),
        np.append(costs[affordable], 0.0),
        np.vstack([turns[affordable], np.zeros(turns.shape[1])]),
    )


def _moves_nearby(search: ConeSearch, places: IntArray) -> tuple[IntArray, IntArray, FloatArray]:
    """Return the cone, the target and the distance of all moves to usable vertices; required cones are not moved."""
    size = min(MAX_NEIGHBOURS, 1 + MAX_COMPARED // len(places)) if len(places) else 0
    cones, targets, distances = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)], [np.empty(0)]
    for i in range(len(search.fine.fixed), len(places)):
        neighbours, lengths = search.fine.neighbours(int(places[i]), size)
        is_free = ~np.isin(neighbours, places)
        targets.append(neighbours[is_free])
        distances.append(lengths[is_free])
        cones.append(np.full(len(targets[-1]), i))
    return np.concatenate(cones), np.concatenate(targets), np.concatenate(distances)
