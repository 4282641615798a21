"""Integers for short loops: the grid is a multiple of a coarse one, so that separatrices join after few squares.

A separatrix, a grid line from an irregular vertex, ends at the next irregular vertex on it. In a grid with the nearest
integers it passes nearly all quads before. If all integers are multiples of n, it passes at most every n-th row of
squares. With the integers of the separatrices that are joined so, others can be nearer to the smooth layout.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

from ..base import IntArray, Unmet
from ..errors import GridError
from .integer_map import IntegerGrid, with_note
from .no_grid import NoGrid
from .relaxing import GridGoal, relaxed_grid
from .rounding import Rounding
from .separatrices import find_separatrices

# Integers that all others are multiples of, in increasing order.
FACTORS = (2, 3, 4, 5, 6, 8)
# Root of the number of squares, relative to that of the layout, for each of which integers are searched.
SCALES = (0.96, 0.98, 1.0, 1.02, 1.04)
# Largest energy of the displacement to multiples, per square: the mean angle deviation then increases by a degree or
# two.
MAX_ENERGY = 0.02


@dataclass(frozen=True, eq=False)
class Candidate:
    """Integer values (v,) for a layout."""

    rounding: Rounding
    values: IntArray

    @cached_property
    def energy(self) -> float:
        """The energy of the displacement to them, per square."""
        return self.rounding.energy(self.values) / self.rounding.layout.area

    def grid(self, goal: GridGoal) -> IntegerGrid | NoGrid:
        """Return the grid with these integers, or the reason why there is none."""
        rounding = self.rounding
        moved = rounding.displaced(self.values)
        return relaxed_grid(rounding.layout, rounding.transitions, self.values, moved, goal)


def nearest_grid(rounding: Rounding, goal: GridGoal) -> IntegerGrid | NoGrid:
    """Return the grid with the integers nearest to a smooth layout, or the reason why there is none."""
    values = rounding.nearest()
    if values is None:
        return NoGrid(GridError("near cones cannot be separated: use more quads"))
    return Candidate(rounding, values).grid(goal)


def grid_with_loops(rounding: Rounding, goal: GridGoal) -> IntegerGrid | NoGrid:
    """Return a grid near a smooth layout whose separatrices join after few squares, or the reason why there is none.

    It is a grid with all integers multiples of the largest factor for which it is near enough; then one in which the
    same separatrices are joined, nearer to the layout. If there is none, the grid with the nearest integers is
    returned, with a note.
    """
    for candidate in reversed([*_multiples(rounding)]):
        coarse = candidate.grid(goal)
        if isinstance(coarse, NoGrid):
            continue
        nearer = _with_separatrices(rounding, coarse)
        grid = None if nearer is None or nearer.energy >= candidate.energy else nearer.grid(goal)
        return grid if isinstance(grid, IntegerGrid) else coarse
    nearest = nearest_grid(rounding, goal)
    note = Unmet("Loops are as by default: no grid with shorter ones was found.")
    return with_note(nearest, note) if isinstance(nearest, IntegerGrid) else nearest


def _with_separatrices(rounding: Rounding, grid: IntegerGrid) -> Candidate | None:
    """Return the nearest candidate that joins the same irregular vertices as a grid; None if none is found."""
    rows = find_separatrices(grid).offsets(rounding.transitions, rounding.layout.corners)
    try:
        joining = rounding.with_zeros(rows)
    except GridError:  # The equations of very long lines may overflow.
        return None
    return _nearest(joining, 1)


def _multiples(rounding: Rounding) -> Iterator[Candidate]:
    """Yield the candidate for each factor, until one is too far from the layout."""
    for factor in FACTORS:
        candidate = _nearest(rounding, factor)
        if candidate is None or candidate.energy > MAX_ENERGY:
            return
        yield candidate


def _nearest(rounding: Rounding, factor: int) -> Candidate | None:
    """Return the candidate of least energy, of several scales of a layout, in multiples of a factor."""
    candidates = list[Candidate]()
    for scale in SCALES:
        values = rounding.scaled((scale / factor) ** 2).nearest()
        if values is not None:
            candidates.append(Candidate(rounding.scaled(scale**2), factor * values))
    return min(candidates, key=lambda candidate: candidate.energy, default=None)
