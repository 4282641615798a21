"""The integer grid of a smooth layout: seams and cones are rounded to the lattice, and the rest is relaxed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ...base import ComplexArray, IntArray, plural
from ...errors import ConvergenceError, GridError, OptionError
from ...geometry import as_complex, as_pairs, double_areas, map_factors, sides_between, signed_double_areas
from ...layout import Lines, PointConstraints, Relaxed, StretchEnergy, relax, rest_sides
from .integer_map import IntegerGrid, find_motions
from .layout import Layout, between_whole, quarters_around, split_edges
from .rounding import Rounding, find_rounding
from .transitions import Transitions, find_transitions

# Part of the squares wanted by which there may be more or fewer without a note.
NOTED_SHARE = 0.1


def grid_of(layout: Layout, energy: StretchEnergy) -> IntegerGrid:
    """Return the grid of a smooth layout, or say which count of quads has one.

    Where rounding makes many more or fewer squares than the layout has, the size is corrected.
    """
    is_split = between_whole(layout)
    split = int(is_split.sum())
    if split:
        layout = split_edges(layout, is_split)
    found, why = grid_near(layout, energy)
    wanted = layout.area
    if found is None:
        most = 4
        advice = f"none with up to {2**most} times as many was found, either"
        for k in range(1, most + 1):
            finer = layout.scaled(2**k)
            if grid_near(finer, energy)[0] is not None:
                advice = f"{finer.area:,.0f} would do"
                break
        raise GridError(f"no grid of about {wanted:,.0f} quads was found: {why}; {advice}")
    factor, last = 1.0, _squares(found)
    for _ in range(4):
        if abs(_squares(found) - wanted) <= NOTED_SHARE * wanted:
            break
        # Half of the way after the first: squares come and go by whole rows.
        factor *= (wanted / last) if factor == 1.0 else math.sqrt(wanted / last)
        other, _ = grid_near(layout.scaled(factor), energy)
        if other is None:
            break
        last = _squares(other)
        if abs(np.log(last / wanted)) < abs(np.log(_squares(found) / wanted)):
            found = replace(other, size=layout.size)
    squares = _squares(found)
    if abs(squares - wanted) > NOTED_SHARE * wanted:
        found = noted(found, f"The grid has an area of {squares:,.0f} squares, not {wanted:,.0f}.")
    if split:
        found = noted(
            found,
            f"Split {plural(split, 'edge')} between cones, which triangles cannot follow apart from each other.",
        )
    return found


def noted(found: IntegerGrid, note: str) -> IntegerGrid:
    """Return a grid with a note more."""
    return replace(found, notes=(*found.notes, note))


def _squares(grid: IntegerGrid) -> float:
    return float(signed_double_areas(grid.corner_grid).sum()) / 2


def grid_near(layout: Layout, energy: StretchEnergy) -> tuple[IntegerGrid | None, str]:
    """Return a grid, if one of the nearest lattice points has one, or else why the last has none."""
    transitions = find_transitions(layout)
    try:
        rounding = find_rounding(layout, transitions)
        candidates = rounding.candidates()
    except GridError as error:
        return None, str(error)
    smooth = transitions.places(layout.points, rounding.smooth)
    tries, why = 0, "all lattice points near it put cones on each other"
    for values in candidates[:3]:
        start = _displaced(layout, smooth, rounding, transitions, values)
        try:
            found = _relaxed(layout, start, transitions, values, energy)
        except (ConvergenceError, OptionError) as error:
            tries, why = tries + 1, str(error)
            continue
        points = _snapped(found, transitions, values)
        if (replace(layout, points=points).double_areas() > 0).all():
            return _described(layout, smooth, points, found, tries), ""
        tries, why = tries + 1, "a triangle so small was left that rounding turned it over"
    return None, why


def _displaced(
    layout: Layout, smooth: ComplexArray, rounding: Rounding, transitions: Transitions, values: IntArray
) -> ComplexArray:
    """Return the layout with seams and cones where they are to be, moved by the shift of least energy.

    Where that makes a triangle too small the smooth layout itself: relaxation may find a way.
    """
    shift = rounding.stiffness.displacement((values - rounding.smooth)[:, None])[:, 0]
    moved = transitions.places(smooth + shift[0::2] + 1j * shift[1::2], values.astype(np.float64))
    before, after = (replace(layout, points=points).double_areas() for points in (smooth, moved))
    return moved if (after > 0.01 * before).all() else smooth


def _relaxed(
    layout: Layout, smooth: ComplexArray, transitions: Transitions, values: IntArray, energy: StretchEnergy
) -> Relaxed:
    """Return the layout relaxed with whole translations of seams and cones on whole places.

    Raises:
        ConvergenceError: they cannot be reached without flipping a triangle.
    """
    chains, count = transitions.chains, 2 * len(transitions.quarters)
    places = transitions.places(smooth, values.astype(np.float64))
    pinned = np.flatnonzero(transitions.held.all(axis=1))
    _, one_of = np.unique(chains.chain, return_index=True)
    # To the left of upwards is where x falls.
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
    )
    # A thousand times the energy of an isometry: cones fall together then. Of 60 cases of benchmarks/grids.py the
    # slowest takes 1.7 times as long without this.
    hopeless = (
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
        progress=lambda _, total: total > hopeless,
    )


def _snapped(found: Relaxed, transitions: Transitions, values: IntArray) -> ComplexArray:
    """Return the points with seams that are whole motions of each other to the last bit, and cones on grid points.

    Coordinates become multiples of a power of two so small that their sums with integers are exact.
    """
    largest = float(np.abs(found.points).max(initial=1.0)) + float(np.abs(values).max(initial=0))
    bits = min(40, 50 - int(np.ceil(np.log2(largest))))
    rounded = np.ldexp(np.rint(np.ldexp(found.points, bits)), -bits)
    return transitions.places(as_complex(rounded), values.astype(np.float64))


def _described(
    layout: Layout, smooth: ComplexArray, points: ComplexArray, found: Relaxed, tries: int
) -> IntegerGrid:
    mesh, corner_grid = layout.mesh, as_pairs(points)[layout.corners]
    turns, shifts, _ = find_motions(mesh, corner_grid)
    quarters = quarters_around(mesh, sides_between(corner_grid))
    qc_before, _ = _distortion(layout, smooth)
    qc_mean, least_area = _distortion(layout, points)
    move_rms, move_max = _moves(layout, smooth, points)
    note = (
        f"The {plural(tries, 'nearest lattice point')} could not be reached without flipping triangles; the next "
        "one could."
    )
    return IntegerGrid(
        vertices=mesh.vertices,
        faces=mesh.faces,
        corner_grid=corner_grid,
        turns=turns,
        shifts=shifts,
        cones=layout.cones,
        quarters=quarters[layout.cones],
        corners=layout.sides.corners,
        corner_quarters=quarters[layout.sides.corners],
        size=layout.size,
        move_rms=move_rms,
        move_max=move_max,
        energy_before=found.energy_before,
        energy=found.energy,
        qc_before=qc_before,
        qc_mean=qc_mean,
        least_area=least_area,
        notes=(note,) if tries else (),
    )


def _moves(layout: Layout, smooth: ComplexArray, points: ComplexArray) -> tuple[float, float]:
    """Return the root mean square and the largest move of cones, in units, beside one that all points share."""
    at = np.isin(layout.mesh.faces, layout.whole)
    if not at.any():
        return 0.0, 0.0
    move = (points - smooth)[np.unique(layout.corners[at])]
    size = np.abs(move - move.mean())
    return float(np.sqrt((size**2).mean())), float(size.max())


def _distortion(layout: Layout, points: ComplexArray) -> tuple[float, float]:
    """Return the mean quasi-conformal distortion by area, and the least area of a triangle over what it should be."""
    areas = double_areas(layout.lengths) / 2
    real = areas > 0
    along, across = map_factors(rest_sides(layout.lengths[real] / layout.size))
    places = points[layout.corners[real]]
    places = places - places[:, :1]
    one, two = np.abs((along * places).sum(axis=1)), np.abs((across * places).sum(axis=1))
    ratio = (one + two) / (one - two)
    return float(np.average(ratio, weights=areas[real])), float((one**2 - two**2).min())
