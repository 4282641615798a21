"""The integer grid near a smooth layout: seams and cones are rounded to the lattice, and the rest is relaxed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ...base import ComplexArray, IntArray, mask_of, plural
from ...errors import ConvergenceError, GridError, OptionError
from ...geometry import as_complex, as_pairs, double_areas
from ...layout import Lines, PointConstraints, Relaxed, StretchEnergy, relax
from .integer_map import IntegerGrid, grid_of_corners
from .layout import GridLayout, between_nodes, split_edges
from .rounding import Rounding, find_rounding
from .transitions import Transitions

# Relative deviation from the requested number of squares above which a note is added.
NOTED_SHARE = 0.1
# Largest fraction of the distance to lines per step of relaxing.
LINE_STRIDE = 0.1


def grid_of(layout: GridLayout, energy: StretchEnergy, most: int) -> IntegerGrid:
    """Return the grid of a smooth layout.

    If rounding changes the number of squares much, the size is corrected. If there is no grid of this size, a finer one
    is returned; `most` is how often the number of squares is doubled.

    Raises:
        GridError: no grid was found.
    """
    return grid_about(find_rounding(split_between_nodes(layout)), energy, most)


def split_between_nodes(layout: GridLayout) -> GridLayout:
    """Return a layout with the edges between vertices on grid points split.

    Otherwise triangles may have grid points at all corners.
    """
    is_split = between_nodes(layout)
    return split_edges(layout, is_split) if is_split.any() else layout


def grid_about(rounding: Rounding, energy: StretchEnergy, most: int) -> IntegerGrid:
    """Return the grid of a smooth layout in which no edge between cones needs to be split; see `grid_of`."""
    layout = rounding.layout
    wanted, found, why = layout.area, None, ""
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
            found = replace(other, size=layout.size)
    squares = found.squares
    if abs(squares - wanted) > NOTED_SHARE * wanted:
        found = with_note(found, f"The grid has an area of {squares:,.0f} squares, not {wanted:,.0f}.")
    return found


def with_note(found: IntegerGrid, note: str) -> IntegerGrid:
    """Return a grid with one more note, unless this is empty."""
    return replace(found, notes=(*found.notes, note)) if note else found


def _grid_near(rounding: Rounding, energy: StretchEnergy) -> tuple[IntegerGrid | None, str]:
    """Return a grid for one of the nearest lattice points, or None and the reason why the last one failed."""
    layout, transitions = rounding.layout, rounding.transitions
    try:
        candidates = rounding.candidates()
    except GridError as error:
        return None, str(error)
    why = "all lattice points nearby merge cones"
    for tries, values in enumerate(candidates[:3]):
        try:
            found = _relaxed(rounding, values, energy)
        except (ConvergenceError, OptionError) as error:
            why = str(error)
            continue
        points = _snapped(found, transitions, values)
        if _folds_sides(layout, transitions, points):
            why = "sides of triangles on grid lines change their direction"
        elif (replace(layout, points=points).double_areas() > 0).all():
            return _make_grid(layout, points, tries), ""
        else:
            why = "rounding flipped a very small triangle"
    return None, why


def _folds_sides(layout: GridLayout, transitions: Transitions, points: ComplexArray) -> bool:
    """Return whether an edge on a side turns by more than a right angle if points move, which flips no triangle."""
    on = mask_of(len(points), layout.sides.points)
    sides = np.concatenate([layout.border, transitions.chains.halfedges.ravel()])
    starts, ends = (each[sides] for each in layout.ends)
    turned = (points[ends] - points[starts]) * np.conj(layout.points[ends] - layout.points[starts])
    return bool((turned.real <= 0)[on[starts] & on[ends]].any())


def _relaxed(rounding: Rounding, values: IntArray, energy: StretchEnergy) -> Relaxed:
    """Return the relaxed layout with integer translations of seams and cones on grid points.

    Relaxing starts from the displacement of least energy to the rounded values. If this makes a triangle too small, it
    starts from the smooth layout itself, from which it may still succeed.

    Raises:
        ConvergenceError: these constraints were not reached without flipping a triangle.
    """
    layout, transitions = rounding.layout, rounding.transitions
    (moved,) = rounding.displaced([values])
    has_area = replace(layout, points=moved).double_areas() > 0.01 * layout.double_areas()
    smooth = moved if has_area.all() else layout.points
    chains, count = transitions.chains, 2 * len(transitions.quarters)
    places = transitions.places(smooth, values.astype(np.float64))
    pinned = np.flatnonzero(transitions.fixed.all(axis=1))
    _, one_of = np.unique(chains.chain, return_index=True)
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
        tied=chains.halfedges[one_of, 1],
        translations=values[:count].reshape(-1, 2),
        stride=LINE_STRIDE if lines and smooth is layout.points else 1.0,
    )
    # A thousand times the energy of an isometry occurs if cones merge. Of 60 cases of benchmarks/grids.py the slowest
    # takes 1.7 times as long without this limit.
    energy_limit = (
        1e3 * float(energy.values(np.ones(1), np.ones(1))[0]) * float(double_areas(layout.lengths).sum()) / 2
    )
    return relax(
        layout.mesh,
        as_pairs(smooth),
        layout.corners,
        energy,
        constraints,
        lengths=layout.lengths,
        steps=200,
        progress=lambda _, total: total > energy_limit,
    )


def _snapped(found: Relaxed, transitions: Transitions, values: IntArray) -> ComplexArray:
    """Return the points rounded so that motions across seams are exact, and cones are exactly on grid points.

    Coordinates become multiples of a power of two for which sums with integers are exact.
    """
    largest = float(np.abs(found.points).max(initial=1.0)) + float(np.abs(values).max(initial=0))
    bits = min(40, 50 - int(np.ceil(np.log2(largest))))
    rounded = np.ldexp(np.rint(np.ldexp(found.points, bits)), -bits)
    return transitions.places(as_complex(rounded), values.astype(np.float64))


def _make_grid(layout: GridLayout, points: ComplexArray, tries: int) -> IntegerGrid:
    missed = plural(tries, "nearest lattice point")
    note = f"The {missed} could not be reached without flipping triangles; the next one was used."
    mesh, cones, corners = layout.mesh, layout.cones, layout.sides.corners
    known = {"size": layout.size, "notes": (note,) if tries else ()}
    return grid_of_corners(
        mesh.vertices, mesh.faces, as_pairs(points)[layout.corners], cones, corners, **known
    )
