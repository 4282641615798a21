"""An integer grid of a smooth layout at its size, if there is one nearby."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...base import ComplexArray, IntArray, plural
from ...errors import ConvergenceError, GridError, OptionError
from ...geometry import as_complex, as_pairs, double_areas, map_factors, sides_between, signed_double_areas
from ...layout import Lines, PointConstraints, Relaxed, StretchEnergy, relax, rest_sides
from .aligned import Layout
from .integer_map import IntegerGrid, find_motions
from .rounding import Rounding, find_rounding
from .sides import Sides, quarters_around
from .transitions import Transitions, find_transitions

# Times the energy of an isometry beyond which relaxation stops: cones fall together then.
HOPELESS = 1e3


def attempt(layout: Layout, energy: StretchEnergy) -> tuple[IntegerGrid | None, str]:
    """Return a grid, if one of the nearest lattice points has one, or else why the last has none."""
    mesh, corners = layout.mesh, layout.corners
    transitions = find_transitions(mesh, corners, layout.points, layout.whole, layout.sides)
    try:
        rounding = find_rounding(mesh, corners, layout.points, layout.whole, transitions)
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
        if (signed_double_areas(as_pairs(points)[corners]) > 0).all():
            return _described(layout, smooth, points, found, transitions, tries), ""
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
    before, after = (signed_double_areas(as_pairs(points)[layout.corners]) for points in (smooth, moved))
    return moved if (after > 0.01 * before).all() else smooth


def _relaxed(
    layout: Layout, smooth: ComplexArray, transitions: Transitions, values: IntArray, energy: StretchEnergy
) -> Relaxed:
    """Return the layout relaxed with whole translations of seams and cones on whole places.

    Raises:
        ConvergenceError: they cannot be reached without turning a triangle over.
    """
    chains, count = transitions.chains, 2 * len(transitions.quarters)
    places = transitions.places(smooth, values.astype(np.float64))
    pinned = np.flatnonzero(transitions.held.all(axis=1))
    _, one_of = np.unique(chains.chain, return_index=True)
    constraints = PointConstraints(
        pinned=pinned,
        places=as_pairs(places[pinned]),
        lines=_lines(layout.sides, pinned, values),
        tied=chains.halfedges[one_of, 1],
        translations=values[:count].reshape(-1, 2),
    )
    highest = HOPELESS * float(energy.values(np.ones(1), np.ones(1))[0]) * _model_area(layout)
    return relax(
        layout.mesh,
        as_pairs(smooth),
        layout.corners,
        energy,
        constraints,
        lengths=layout.lengths,
        steps=200,
        progress=lambda _, total: total > highest,
    )


def _lines(sides: Sides, pinned: IntArray, values: IntArray) -> Lines | None:
    """Return the grid lines that sides of the boundary come to lie on."""
    if not len(sides.axis):
        return None
    loose = ~np.isin(sides.points, pinned)
    # To the left of upwards is where x falls.
    offsets = np.where(sides.axis == 0, -1.0, 1.0) * values[len(values) - len(sides.axis) :]
    return Lines(sides.points[loose], sides.side[loose], sides.directions, offsets)


def _snapped(found: Relaxed, transitions: Transitions, values: IntArray) -> ComplexArray:
    """Return the points with seams that are whole motions of each other to the last bit, and cones on grid points.

    Coordinates become multiples of a power of two so small that their sums with whole numbers are exact.
    """
    largest = float(np.abs(found.points).max(initial=1.0)) + float(np.abs(values).max(initial=0))
    bits = min(40, 50 - int(np.ceil(np.log2(largest))))
    rounded = np.ldexp(np.rint(np.ldexp(found.points, bits)), -bits)
    return transitions.places(as_complex(rounded), values.astype(np.float64))


def _described(
    layout: Layout,
    smooth: ComplexArray,
    points: ComplexArray,
    found: Relaxed,
    transitions: Transitions,
    tries: int,
) -> IntegerGrid:
    mesh, corners = layout.mesh, layout.corners
    corner_grid = as_pairs(points)[corners]
    turns, shifts, _ = find_motions(mesh, corner_grid)
    quarters = quarters_around(mesh, sides_between(corner_grid))
    qc_before, _ = _distortion(layout, smooth)
    qc_mean, least_area = _distortion(layout, points)
    move_rms, move_max = _moves(layout, smooth, points)
    notes = []
    if tries:
        notes.append(
            f"The {plural(tries, 'nearest lattice point')} could not be reached without turning triangles over; the "
            "next one could."
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
        notes=tuple(notes),
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


def _model_area(layout: Layout) -> float:
    return float(double_areas(layout.lengths).sum()) / 2


def scaled(layout: Layout, factor: float) -> Layout:
    """Return a layout of so many times the squares."""
    times = float(np.sqrt(factor))
    return replace(layout, points=times * layout.points, size=layout.size / times)


def area_of(layout: Layout) -> float:
    """Return how many squares a layout covers."""
    return float(signed_double_areas(as_pairs(layout.points)[layout.corners]).sum()) / 2
