"""Charts with straight sides: nearly straight sides of hard surfaces become straight, and strips become rectangles."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace

import numpy as np

from ..base import BoolArray, FloatArray, IntArray
from ..errors import ConvergenceError, MetricError, OptionError
from ..geometry import dihedral_angles, double_areas, find_overlaps, triangle_energies
from ..optimise import PointConstraints, StretchEnergy, relax
from ..stages import Layout
from .candidates import TOLERANCE, Candidate, CutModel
from .creases import SHARP
from .free_seams import as_one_chart
from .options import ISOMETRIC
from .shortening import MANY_TRIANGLES
from .straight_sides import Border, StraightSides, find_border, hard_sides, parallel_sides, rectangle_sides

# Smallest chart whose sides become straight, relative to the area of its component.
MIN_CHART = 0.01
# By how much the mean energy of a chart may rise if it becomes a rectangle, and if its sides become straight.
RECTANGLE_RISE, STRAIGHT_RISE = 0.01, 0.03
# By how much the energy of any triangle of a nearly isometric chart may exceed that of an isometry: none is stretched
# by more than 2%. And what counts as an isometry.
LOCAL_RISE, ROUNDING = 0.002, 1e-6
# Largest distance of points from their line, relative to its length, if the line is exactly straight.
EXACT = 1e-10


def straightened(model: CutModel, candidate: Candidate) -> Candidate:
    """Return a candidate whose nearly straight sides are straight where the bound of the energy permits it.

    Charts that are strips become rectangles. In others, sides along straight chains of edges or sharp edges become
    straight, and parallel or perpendicular to one another if they nearly are.

    Args:
        model: the model of the component.
        candidate: one of its candidates.
    """
    layout, areas = candidate.layout, model.component.double_areas
    is_sharp = np.abs(dihedral_angles(layout.mesh)) > SHARP
    sizes, counts = np.bincount(layout.chart, areas), np.bincount(layout.chart)
    is_tried = (sizes >= MIN_CHART * sizes.sum()) & (counts <= MANY_TRIANGLES)
    for chart in np.flatnonzero(is_tried).tolist():
        candidate = _with_straight_chart(model, candidate, np.flatnonzero(layout.chart == chart), is_sharp)
    return candidate


def _with_straight_chart(
    model: CutModel, candidate: Candidate, faces: IntArray, is_sharp: BoolArray
) -> Candidate:
    """Return a candidate with straight sides of one chart, or the candidate itself if nothing is to be changed.

    Args:
        model, candidate: the model of the component, and the candidate.
        faces: (k,) the triangles of the chart.
        is_sharp: (e,) the sharp edges of the mesh.
    """
    layout = candidate.layout
    chart = as_one_chart(layout, faces)
    before = model.bound.energies(chart.lengths, chart.points[chart.corners])
    largest, isometric = _largest_energy(chart, chart.points), ISOMETRIC + LOCAL_RISE
    border = find_border(layout, chart, faces, is_sharp)
    if border.bend <= EXACT and largest <= ISOMETRIC + ROUNDING:
        return candidate  # Leaf cards and the faces of tapered boxes remain isometric.
    for sides, largest_rise in _trials(border):
        if sides.largest_stray(chart.points) <= EXACT:
            break
        points = _points_with(sides, chart)
        if points is None:
            continue
        rise = float((model.bound.energies(chart.lengths, points[chart.corners]) - before).sum())
        energy = candidate.energy + rise / layout.area
        is_within = (
            energy <= max(model.bound.largest, candidate.energy)
            and rise <= largest_rise * chart.area
            and (largest > isometric or _largest_energy(chart, points) <= isometric)
        )
        if is_within and not len(find_overlaps(points[chart.corners], limit=1).pairs):
            moved = layout.points.copy()
            moved[layout.corners[faces]] = points[chart.corners]
            return replace(candidate, layout=replace(layout, points=moved), energy=energy)
    return candidate


def _largest_energy(chart: Layout, points: FloatArray) -> float:
    """Return the largest symmetric Dirichlet energy of a triangle of a chart with given points (c, 2)."""
    energies = triangle_energies(chart.lengths, points[chart.corners])
    return float((energies / (double_areas(chart.lengths) / 2)).max())


def _trials(border: Border) -> Iterator[tuple[StraightSides, float]]:
    """Yield sides that become straight, the best first, with the largest rise of the energy of the chart."""
    if border.is_rectangle:
        yield rectangle_sides(border), RECTANGLE_RISE
    sides = hard_sides(border)
    if sides:
        yield parallel_sides(sides), STRAIGHT_RISE
        straightest = sorted(sides, key=lambda side: side.bend)
        yield parallel_sides(straightest[: (len(sides) + 1) // 2]), STRAIGHT_RISE


def _points_with(sides: StraightSides, chart: Layout) -> FloatArray | None:
    """Return (c, 2) the points of a chart, relaxed with straight sides; None if they are not found."""
    with suppress(ConvergenceError, MetricError, OptionError):
        points = relax(
            chart.mesh,
            chart.points,
            chart.corners,
            StretchEnergy(1.0),
            PointConstraints(lines=sides.lines),
            lengths=chart.lengths,
            to_scale=True,
            tolerance=2 * TOLERANCE,
        ).points
        if sides.largest_stray(points) <= EXACT:
            return points
    return None
