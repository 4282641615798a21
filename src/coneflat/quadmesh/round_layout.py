"""The integer grid near a smooth layout: seams and cones are rounded to the lattice, and the rest is relaxed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..base import ComplexArray, IntArray, Unmet, mask_of
from ..errors import ConvergenceError, GridError, OptionError
from ..geometry import as_complex, as_pairs, double_areas
from ..optimise import Lines, PointConstraints, Relaxed, StretchEnergy, relax
from .integer_map import IntegerGrid, grid_of_corners
from .layout import GridLayout, split_edges
from .rounding import Rounding
from .transitions import Transitions

# Relative deviation from the requested number of squares above which a note is added.
NOTED_SHARE = 0.1
# Largest fraction of the distance to the constraints per step of relaxing from the smooth layout.
LINE_STRIDE = 0.1


def split_between_nodes(layout: GridLayout, lines: IntArray | None = None) -> GridLayout:
    """Return a layout with the edges between vertices on grid points split.

    Otherwise triangles may have grid points at all corners, which degenerate if they are collinear. Vertices of edges
    (k,) that may get on grid lines may become such points.
    """
    mesh = layout.mesh
    is_node = mask_of(len(mesh.vertices), layout.nodes)
    may_be = is_node if lines is None else is_node | mask_of(len(is_node), mesh.edges[lines])
    tails, heads = mesh.edges.T
    is_split = (is_node[tails] & may_be[heads]) | (may_be[tails] & is_node[heads])
    return split_edges(layout, is_split) if is_split.any() else layout


def grid_about(rounding: Rounding, energy: StretchEnergy, most: int) -> IntegerGrid:
    """Return the grid of a smooth layout in which no edge between cones needs to be split.

    If rounding changes the number of squares much, the size is corrected. If there is no grid of this size, a finer one
    is returned; `most` is how often the number of squares is doubled.

    Raises:
        GridError: no grid was found.
    """
    wanted, found, why = rounding.layout.area, None, ""
    for finer in (2.0**k for k in range(most + 1)):
        found, why = _grid_near(rounding.scaled(finer), energy)
        if found is not None:
            break
    if found is None:
        more = f", or of up to {2**most} times as many," if most else ""
        raise GridError(f"no grid of about {wanted:,.0f} quads{more} was found: {why}")
    factor, last = 1.0, found.squares
    for _ in range(4):
        if finer > 1 or abs(found.squares - wanted) <= NOTED_SHARE * wanted:
            break
        # Later corrections are halved, because the number of squares changes by entire rows.
        factor *= (wanted / last) if factor == 1.0 else math.sqrt(wanted / last)
        other, _ = _grid_near(rounding.scaled(factor), energy)
        if other is None:
            break
        last = other.squares
        if abs(np.log(last / wanted)) < abs(np.log(found.squares / wanted)):
            found = replace(other, size=rounding.layout.size)
    if abs(found.squares - wanted) > NOTED_SHARE * wanted:
        note = Unmet(f"The grid has an area of {found.squares:,.0f} squares, not {wanted:,.0f}.")
        found = with_note(found, note)
    return found


def with_note(grid: IntegerGrid, note: str) -> IntegerGrid:
    """Return a grid with one more note, unless it has this one, or the note is empty."""
    return grid if note in ("", *grid.notes) else replace(grid, notes=(*grid.notes, note))


def _grid_near(rounding: Rounding, energy: StretchEnergy) -> tuple[IntegerGrid | None, str]:
    """Return a grid for the nearest lattice point, or None and the reason why there is none.

    Relaxing starts from the displacement of least energy to the lattice point. If this makes a triangle too small, or
    does not succeed, it starts from the smooth layout itself, at last with smaller steps.
    """
    layout, transitions = rounding.layout, rounding.transitions
    try:
        values = rounding.nearest()
    except GridError as error:
        return None, str(error)
    moved = rounding.displaced(values)
    has_area = replace(layout, points=moved).double_areas() > 0.01 * layout.double_areas()
    for stride in (1.0,) * bool(has_area.all()) + (LINE_STRIDE, LINE_STRIDE / 3):
        try:
            start = moved if stride == 1 else layout.points
            found = _relaxed(rounding, values, start, energy, stride)
        except (ConvergenceError, OptionError) as error:
            why = str(error)
            if start is moved:
                continue
            break
        points = _snapped(found, transitions, values)
        if why := layout.limit.excess(replace(layout, points=points).area):
            break
        if _folds_sides(layout, transitions, points):
            why = "sides of triangles on grid lines change their direction"
        elif (replace(layout, points=points).double_areas() > 0).all():
            mesh, places, corners = layout.mesh, as_pairs(points)[layout.corners], layout.sides.corners
            return grid_of_corners(
                mesh.vertices, mesh.faces, places, layout.cones, corners, size=layout.size
            ), ""
        else:
            why = "rounding flipped a very small triangle"
    return None, why


def _folds_sides(layout: GridLayout, transitions: Transitions, points: ComplexArray) -> bool:
    """Return whether an edge on a side turns by more than a right angle if points move, which flips no triangle."""
    on = mask_of(len(points), layout.sides.points)
    sides = np.concatenate([layout.border, transitions.chains.halfedges.ravel()])
    starts, ends = (points_of[sides] for points_of in layout.ends)
    turned = (points[ends] - points[starts]) * np.conj(layout.points[ends] - layout.points[starts])
    return bool((turned.real <= 0)[on[starts] & on[ends]].any())


def _relaxed(
    rounding: Rounding, values: IntArray, start: ComplexArray, energy: StretchEnergy, stride: float
) -> Relaxed:
    """Return the relaxed layout with integer translations of seams and cones on grid points.

    Args:
        rounding: the smooth layout.
        values: (v,) the integers.
        start: (u,) the points from which relaxing starts.
        energy: what it minimises.
        stride: largest fraction of the distance to the constraints per step.

    Raises:
        ConvergenceError: these constraints were not reached without flipping a triangle.
    """
    layout, transitions = rounding.layout, rounding.transitions
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
    # A thousand times the energy of an isometry occurs if cones merge. Of 60 cases of benchmarks/grids.py the slowest
    # takes 1.7 times as long without this limit.
    area = float(double_areas(layout.lengths).sum()) / 2
    energy_limit = 1e3 * float(energy.values(np.ones(1), np.ones(1))[0]) * area
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
