"""The integer grid near a smooth layout: its seams, cones and lines are rounded to the lattice, the rest is relaxed.

If there is no grid with all sharp edges or sides on grid lines, some are left out; if there is none of the requested
size, there are more squares.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import count

import numpy as np

from ..base import FloatArray, IntArray, Unmet, plural
from ..errors import CoarseGridError, GridError
from .cross_field import is_mechanical, sharp_ends
from .features import edge_indices, lengths_along, sharp_edges
from .grid_layout import GridLayout, with_sides
from .integer_map import IntegerGrid, with_note
from .lines import LinedLayout, deviations, long_chains, with_lines
from .loops import grid_with_loops, nearest_grid
from .no_grid import NoGrid
from .relaxing import GridGoal
from .rounding import Rounding, find_rounding
from .splitting import split_between_nodes

# Relative deviation from the requested number of squares above which a note is added.
NOTED_SHARE = 0.1
# How often the size is corrected for the number of squares.
MAX_CORRECTIONS = 4
# How often the number of squares is doubled to find a grid: with cones that may be replaced by others, and otherwise.
DOUBLINGS_BEFORE_OTHER_CONES, MAX_DOUBLINGS = 1, 2
# Preferred edges are put on a line if their direction differs from an axis by less, radians.
MAX_TURN = np.deg2rad(20.0)
# Largest cost of a preferred chain: the energy of the triangles near it, over its length and the root of the area; on
# mechanical surfaces and others.
MAX_COST_ON_MECHANICAL, MAX_COST = 3e-3, 5e-4
# Attempts to find a grid with preferred edges on lines, and attempts of `SEPARATIONS` in each: one cone at a time takes
# long.
LINE_ATTEMPTS, LINE_SEPARATIONS = 6, 2
# Largest number of squares of a grid with lines, relative to that of the layout. Of larger ones, fewer lines must
# leave less than this fraction of the squares: else these are not due to the lines.
MAX_GROWTH, MIN_SHRINKAGE = 2.0, 0.95


@dataclass(frozen=True, eq=False)
class RoundingRules:
    """What lies on grid lines, and what the grid is like.

    Attributes:
        goal: what the grid minimises, and its largest number of squares.
        has_sides: the boundary consists of straight sides.
        requires_sides: all these sides must be on grid lines.
        sharp_angle: dihedral angle above which edges are sharp, radians; None ignores sharp edges.
        requires_lines: put as many sharp edges as possible on grid lines; else only those that deform the grid little.
        doublings: how often the number of squares is doubled to find a grid.
    """

    goal: GridGoal
    has_sides: bool = False
    requires_sides: bool = False
    sharp_angle: float | None = None
    requires_lines: bool = False
    doublings: int = MAX_DOUBLINGS


def rounded_grid(layout: GridLayout, rules: RoundingRules) -> IntegerGrid | NoGrid:
    """Return the integer grid near a smooth layout, or the reason why there is none.

    Raises:
        SeamError: the sides of a seam are not congruent.
        GridError: the sides of a seam are not related by quarter turns, or the equations between them overflow.

    Notes:
        The integers are the translations t of seams, z_right = i^q z_left + t, and the positions of cones. The nearest
        ones, in the least Dirichlet energy of the displacement that they need, are searched in the lattice of the
        solutions of the equations around vertices. The layout is then relaxed to them.

    See Also:
        find_rounding: the lattice and its metric.
        nearest_grid: the grid with the nearest integers.
        grid_with_loops: the one with integers for short loops.
    """
    sided = with_sides(layout) if rules.has_sides else layout
    grid: IntegerGrid | NoGrid | None = None
    note = ""
    if rules.sharp_angle is not None:
        lines = edge_indices(sided.mesh, sharp_ends(sided.mesh, rules.sharp_angle))
        grid, note = _grid_with_lines(
            split_between_nodes(sided, lines), rules.sharp_angle, rules.requires_lines, rules.goal
        )
    if grid is None:
        grid = _grid_with_sides(layout, sided, rules)
    return with_note(grid, note) if isinstance(grid, IntegerGrid) else grid


def _grid_with_sides(layout: GridLayout, sided: GridLayout, rules: RoundingRules) -> IntegerGrid | NoGrid:
    """Return a grid with the sides of a layout on grid lines, or without some if these are not required."""
    are_required = rules.requires_sides or len(sided.sides.points) == len(layout.sides.points)
    try:
        grid = grid_about(find_rounding(split_between_nodes(sided)), rules.goal, rules.doublings)
    except GridError:
        if are_required:
            raise
    else:
        if are_required or isinstance(grid, IntegerGrid):
            return grid
    note = Unmet(
        "Straight sides of different loops are not parallel up to quarter turns, so not all on grid lines."
    )
    grid = grid_about(find_rounding(split_between_nodes(layout)), rules.goal, rules.doublings)
    return with_note(grid, note) if isinstance(grid, IntegerGrid) else grid


def grid_about(rounding: Rounding, goal: GridGoal, doublings: int) -> IntegerGrid | NoGrid:
    """Return the grid of a smooth layout in which no edge between cones needs to be split.

    If rounding changes the number of squares much, the size is corrected. If there is no grid of this size, a finer one
    is returned; `doublings` is how often the number of squares is doubled.
    """
    requested, reason = rounding.layout.area, ""
    for doubling in range(doublings + 1):
        grid = _rounded(rounding.scaled(2.0**doubling), goal)
        if isinstance(grid, IntegerGrid):
            return _with_note_on_size(
                _corrected(rounding, grid, goal) if doubling == 0 else grid, requested, goal.parts
            )
        if isinstance(grid.error, CoarseGridError):  # a finer one has even more squares
            return grid
        reason = grid.reason
    finer = f", or of up to {2**doublings} times as many," if doublings else ""
    return NoGrid(GridError(f"no grid of about {requested:,.0f} quads{finer} was found: {reason}"))


def _with_note_on_size(grid: IntegerGrid, requested: float, parts: int) -> IntegerGrid:
    """Return a grid of each of some parts with a note if its number of squares is not about the requested one."""
    if abs(grid.squares - requested) <= NOTED_SHARE * requested:
        return grid
    return with_note(
        grid,
        Unmet(f"The grid has an area of {parts * grid.squares:,.0f} squares, not {parts * requested:,.0f}."),
    )


def _corrected(rounding: Rounding, grid: IntegerGrid, goal: GridGoal) -> IntegerGrid:
    """Return a grid whose number of squares is nearer to that of the layout, if there is one of a similar size."""
    requested = rounding.layout.area
    factor, last = 1.0, grid.squares
    for _ in range(MAX_CORRECTIONS):
        if abs(grid.squares - requested) <= NOTED_SHARE * requested:
            break
        # Later corrections are halved, because the number of squares changes by entire rows.
        factor *= (requested / last) if factor == 1.0 else math.sqrt(requested / last)
        resized = _rounded(rounding.scaled(factor), goal)
        if isinstance(resized, NoGrid):
            break
        last = resized.squares
        if abs(np.log(last / requested)) < abs(np.log(grid.squares / requested)):
            grid = replace(resized, size=rounding.layout.size)
    return grid


def _rounded(rounding: Rounding, goal: GridGoal) -> IntegerGrid | NoGrid:
    """Return the grid with the nearest integers, or with integers for short loops if these are preferred."""
    return grid_with_loops(rounding, goal) if goal.loops else nearest_grid(rounding, goal)


def _grid_with_lines(
    layout: GridLayout, angle: float, is_required: bool, goal: GridGoal
) -> tuple[IntegerGrid | None, str]:
    """Return a grid with sharp edges on grid lines, or None if none are, and a note on those that are not, or "".

    Chains that deform the grid most for their length are left out until there is a grid.

    Args:
        layout: a layout in which no edge joins two vertices on grid points.
        angle: dihedral angle above which edges are sharp, radians.
        is_required: put as many edges as possible on lines; else only those that deform the grid little.
        goal: what the grid minimises.
    """
    mesh, off = layout.mesh, deviations(layout)
    sharp = sharp_edges(mesh, angle) if is_required else edge_indices(mesh, sharp_ends(mesh, angle))
    edges = long_chains(layout, sharp if is_required else sharp[np.abs(off[sharp]) < MAX_TURN])
    grid, reason, fewest = None, "too short for quads of this size", np.inf
    highest = MAX_COST_ON_MECHANICAL if is_mechanical(mesh, angle) else MAX_COST
    for attempt in count() if is_required else range(LINE_ATTEMPTS):
        lined = with_lines(layout, edges, off)
        if not len(lined.edges):
            break
        separations = None if is_required else LINE_SEPARATIONS
        rounding = replace(find_rounding(lined.layout), attempts=separations)
        costs, is_folded = lined.costs(layout, rounding.displaced(rounding.basis @ rounding.start))
        max_cost = np.inf if is_required else highest * np.sqrt(layout.area)
        is_costly = costs.max() > max_cost
        if not is_costly and (not is_folded or (is_required and attempt == 0)):
            nearest = grid_about(rounding, goal, 0)
            if isinstance(nearest, NoGrid):
                reason = nearest.reason
            elif MAX_GROWTH * layout.area < nearest.squares < MIN_SHRINKAGE * fewest:
                fewest = nearest.squares
                reason = f"squares would be {fewest:,.0f}, not {layout.area:,.0f}"
            else:
                grid = replace(nearest, features=mesh.edges[lined.edges])
                break
        edges = _cheaper_chains(layout, lined, costs, max_cost, attempt)
    off_lines = np.setdiff1d(sharp, lined.edges) if grid else sharp
    return grid, _note_on_lines(layout, sharp, off_lines, reason) if is_required else ""


def _cheaper_chains(
    layout: GridLayout, lined: LinedLayout, costs: FloatArray, max_cost: float, attempt: int
) -> IntArray:
    """Return the edges of the chains that remain after an attempt: each leaves out the costliest ones.

    These are chains above a bound that decreases so that the attempts end.
    """
    if costs.max() > max_cost:
        bound = 0.7**attempt * max_cost
    else:
        bound = 0.5 ** (1 + attempt / 4) * costs.max()
    return long_chains(layout, lined.edges[costs[lined.chain] < bound])


def _note_on_lines(layout: GridLayout, sharp: IntArray, off_lines: IntArray, reason: str) -> str:
    """Return a note on required sharp edges that are not on grid lines; "" if all are."""
    if not len(sharp):
        return "There are no sharp edges."
    if not len(off_lines):
        return ""
    share = 100 * lengths_along(layout.mesh, off_lines).sum() / lengths_along(layout.mesh, sharp).sum()
    return Unmet(
        f"{plural(len(off_lines), 'sharp edge')} of {len(sharp):,}, {share:.1f} % of their length, not on grid lines: "
        f"{reason}."
    )
