"""The grid with given integers: a smooth layout is relaxed until seams, cones and sides are on the lattice."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..base import ComplexArray, IntArray, mask_of
from ..errors import ConvergenceError, GridError, OptionError
from ..geometry import as_complex, as_pairs, double_areas
from ..optimise import Lines, PointConstraints, Relaxed, StretchEnergy, relax
from .grid_layout import GridLayout
from .integer_map import IntegerGrid, grid_of_corners
from .limits import NO_LIMIT, SquareLimit
from .no_grid import NoGrid
from .transitions import Transitions

# Largest fraction of the distance to the constraints per step of relaxing from the smooth layout.
LINE_STRIDE = 0.1
# Least area of displaced triangles, relative to that in the layout, for which relaxing starts from the displacement.
MIN_AREA_SHARE = 0.01
# Energy, relative to that of an isometry, above which relaxing ends: it occurs if cones merge. Of 60 cases of
# benchmarks/grids.py the slowest takes 1.7 times as long without this limit.
MAX_ENERGY = 1e3


@dataclass(frozen=True, eq=False)
class GridGoal:
    """What a grid minimises, how many squares it may have, and which integers are preferred.

    Attributes:
        energy: the energy of the map.
        limit: largest number of squares.
        loops: prefer integers for which few lines from irregular vertices go far, see `loops.py`.
        parts: number of parts of the surface that will have this grid: two if it is that of a half.
    """

    energy: StretchEnergy
    limit: SquareLimit = NO_LIMIT
    loops: bool = False
    parts: int = 1


def relaxed_grid(
    layout: GridLayout, transitions: Transitions, values: IntArray, moved: ComplexArray, goal: GridGoal
) -> IntegerGrid | NoGrid:
    """Return the grid near a layout with given integers, or the reason why there is none.

    Relaxing starts from the displacement of least energy to the integers. If this makes a triangle too small, or does
    not succeed, it starts from the layout itself, at last with smaller steps.

    Args:
        layout: the smooth layout.
        transitions: its seams and sides.
        values: (v,) the integers.
        moved: (u,) the points after the displacement of least energy.
        goal: what the grid minimises, and its limit.

    References:
        D. Bommes, M. Campen, H.-C. Ebke, P. Alliez, L. Kobbelt, "Integer-grid maps for reliable quad meshing", 2013.
    """
    reason = ""
    for start, stride in _starts(layout, moved):
        try:
            relaxed = _relaxed(layout, transitions, values, start, goal.energy, stride)
        except (ConvergenceError, OptionError) as error:
            reason = str(error)
            if start is moved:
                continue
            break
        snapped = replace(layout, points=_snapped(relaxed, transitions, values))
        if excess := goal.limit.error(snapped.area):
            return NoGrid(excess)
        if _folds_sides(layout, transitions, snapped.points):
            reason = "sides of triangles on grid lines change their direction"
        elif (snapped.double_areas() > 0).all():
            return _grid_of_layout(snapped)
        else:
            reason = "rounding flipped a very small triangle"
    return NoGrid(GridError(reason))


def _starts(layout: GridLayout, moved: ComplexArray) -> Iterator[tuple[ComplexArray, float]]:
    """Yield the points from which relaxing starts, with the fraction of the distance per step."""
    if (replace(layout, points=moved).double_areas() > MIN_AREA_SHARE * layout.double_areas()).all():
        yield moved, 1.0
    yield layout.points, LINE_STRIDE
    yield layout.points, LINE_STRIDE / 3


def _grid_of_layout(layout: GridLayout) -> IntegerGrid:
    places, corners = as_pairs(layout.points)[layout.corners], layout.sides.corners
    return grid_of_corners(
        layout.mesh.vertices, layout.mesh.faces, places, layout.cones, corners, size=layout.size
    )


def _folds_sides(layout: GridLayout, transitions: Transitions, points: ComplexArray) -> bool:
    """Return whether an edge on a side turns by more than a right angle if points move, which flips no triangle."""
    on = mask_of(len(points), layout.sides.points)
    sides = np.concatenate([layout.border, transitions.chains.halfedges.ravel()])
    starts, ends = (points_of[sides] for points_of in layout.ends)
    turned = (points[ends] - points[starts]) * np.conj(layout.points[ends] - layout.points[starts])
    return bool((turned.real <= 0)[on[starts] & on[ends]].any())


def _relaxed(
    layout: GridLayout,
    transitions: Transitions,
    values: IntArray,
    start: ComplexArray,
    energy: StretchEnergy,
    stride: float,
) -> Relaxed:
    """Return the relaxed layout with integer translations of seams and cones on grid points.

    Args:
        layout: the smooth layout.
        transitions: its seams and sides.
        values: (v,) the integers.
        start: (u,) the points from which relaxing starts.
        energy: what it minimises.
        stride: largest fraction of the distance to the constraints per step.

    Raises:
        ConvergenceError: these constraints were not reached without flipping a triangle.
    """
    chains, count = transitions.chains, 2 * len(transitions.quarters)
    places = transitions.places(start, values.astype(np.float64))
    pinned = np.flatnonzero(transitions.fixed.all(axis=1))
    _, edge_of_chain = np.unique(chains.chain, return_index=True)
    # The signed offset of a line is measured to the left of its direction, so that of a vertical line is -x.
    sides, lines = layout.sides, None
    if len(sides.axis):
        loose = ~np.isin(sides.points, pinned)
        offsets = np.where(sides.axis == 0, -1.0, 1.0) * values[len(values) - len(sides.axis) :]
        lines = Lines(sides.points[loose], sides.side[loose], sides.directions, offsets)
    constraints = PointConstraints(
        pinned=pinned,
        places=as_pairs(places[pinned]),
        lines=lines,
        tied=chains.halfedges[edge_of_chain, 1],
        translations=values[:count].reshape(-1, 2),
        stride=stride,
    )
    area = float(double_areas(layout.lengths).sum()) / 2
    energy_limit = MAX_ENERGY * float(energy.values(np.ones(1), np.ones(1))[0]) * area
    return relax(
        layout.mesh,
        as_pairs(start),
        layout.corners,
        energy,
        constraints,
        lengths=layout.lengths,
        steps=200,
        progress=lambda _, total: total > energy_limit,
    )


def _snapped(relaxed: Relaxed, transitions: Transitions, values: IntArray) -> ComplexArray:
    """Return the points rounded so that motions across seams are exact, and cones are exactly on grid points.

    Coordinates become multiples of a power of two for which sums with integers are exact.
    """
    largest = float(np.abs(relaxed.points).max(initial=1.0)) + float(np.abs(values).max(initial=0))
    bits = min(40, 50 - int(np.ceil(np.log2(largest))))
    rounded = np.ldexp(np.rint(np.ldexp(relaxed.points, bits)), -bits)
    return transitions.places(as_complex(rounded), values.astype(np.float64))
