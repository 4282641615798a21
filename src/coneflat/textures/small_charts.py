"""Small charts, joined to others where they fit once their points move.

Separating overlaps may leave charts of few triangles. Such a chart costs texels for its padding, and often it continues
a neighbour across one of its seams if the triangles around the seam are relaxed.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np

from ..atlas import ChartLayout, Seams, with_charts
from ..base import BoolArray, FloatArray, IntArray, has_any, mask_of, within_time
from ..errors import MetricError, SeamError
from ..geometry import as_pairs, find_overlaps, signed_double_areas
from ..mesh import nearby
from ..stages import Layout
from .candidates import TOLERANCE, Candidate, CutModel
from .free_seams import as_one_chart, freed
from .tips import RINGS

# Charts below this fraction of the component's area are joined to others; the number of seams that are tried. 3holes of
# 5,000 triangles gets 3 charts instead of 4, and a figure of 69,000 triangles 4 instead of 8. With 0.05 instead, 42
# models have seams and charts that are 3% and 13% less, but cover 0.02 less of the texture.
SMALL_AREA, MAX_JOINS = 0.005, 8


def join_small_charts(model: CutModel, candidate: Candidate) -> Candidate:
    """Return a candidate in several charts, the smallest joined to others where they fit once their points move.

    The seams whose cutting costs most are closed first.

    Args:
        model: the model of the component.
        candidate: one of its candidates.
    """
    mesh, areas = model.component.mesh, model.component.double_areas
    seams, sizes = _chart_seams(candidate.layout), np.bincount(candidate.layout.chart, areas)
    stretch = seams.stretches(mesh)
    is_small = sizes[seams.charts].min(axis=1) < SMALL_AREA * sizes.sum()
    is_small &= seams.charts[:, 0] != seams.charts[:, 1]
    costs = np.bincount(stretch, model.seam_costs[seams.edges] * is_small)
    order = np.argsort(-costs, kind="stable")[: min(MAX_JOINS, np.count_nonzero(costs))]
    for edges in [seams.edges[stretch == label] for label in order]:
        with suppress(MetricError, SeamError):
            is_closed = np.isin(seams.edges, edges)
            joined = within_time(partial(_joined, model, candidate, seams, is_closed))
            if joined is not None:
                candidate, seams = joined, _chart_seams(joined.layout)
    return candidate


def count_charts(layout: Layout, min_share: float = SMALL_AREA) -> int:
    """Return the number of charts, at least 1, without those that have less than a share of the component's area."""
    sides = layout.points[layout.corners[:, 1:]] - layout.points[layout.corners[:, :1]]
    areas = np.bincount(layout.chart, np.abs(np.linalg.det(sides)))
    return max(int(np.count_nonzero(areas >= min_share * areas.sum())), 1)


def _chart_seams(layout: Layout) -> Seams:
    return Seams(layout.mesh, ChartLayout(layout.points, layout.corners, layout.chart))


def _joined(model: CutModel, candidate: Candidate, seams: Seams, is_closed: BoolArray) -> Candidate | None:
    """Return a candidate joined across flagged seam edges (k,), or None if its triangles do not fit."""
    layout, bound = candidate.layout, model.bound
    sizes = np.bincount(layout.chart, model.component.double_areas)
    charts = np.unique(seams.charts[is_closed])
    # Charts joined by an earlier seam: the edges are within one, closed from both ends, or beside a large one.
    if len(charts) < 2 or sizes[charts].min() >= SMALL_AREA * sizes.sum():
        return None
    small, large = charts[np.argsort(sizes[charts], kind="stable")].tolist()
    joined = _moved_to_meet(layout, seams, is_closed, small, large)
    relaxed = _relaxed_around(layout, joined, layout.chart == small)
    if relaxed is None:
        return None
    joined, faces = relaxed
    places, lengths = joined.points[joined.corners], layout.lengths[faces]
    before = bound.energies(lengths, layout.points[layout.corners[faces]])
    rise = (bound.energies(lengths, places[faces]) - before).sum()
    energy = candidate.energy + float(rise) / layout.area
    if energy > max(bound.largest, candidate.energy) or _overlap(places, faces, joined.chart == large):
        return None
    layout = with_charts(layout, joined.renumbered())
    return Candidate(layout, energy, model.cost_of(layout), candidate.distortion, is_separated=True)


def _moved_to_meet(layout: Layout, seams: Seams, is_closed: BoolArray, small: int, large: int) -> ChartLayout:
    """Return the charts of a layout, a small one turned and moved to a large one and joined to it.

    Its side of the seam is as close as possible to the other one, and the points of the two sides meet in the middle.

    Args:
        layout, seams: the layout and its seams.
        is_closed: (k,) the seam edges between the two charts that are closed.
        small, large: the two charts.
    """
    sides = np.stack([seams.first_points[is_closed], seams.second_points[is_closed]])
    ends = np.where((seams.charts[is_closed] == small)[:, :1], sides, sides[::-1])
    points, is_small = layout.points @ np.array([1, 1j]), layout.chart == small
    small_side, large_side = points[ends]
    turn = np.vdot(small_side - small_side.mean(), large_side - large_side.mean())
    moved = layout.corners[is_small]
    points[moved] = (points[moved] - small_side.mean()) * turn / max(abs(turn), 1e-300) + large_side.mean()
    points[ends] = points[ends].mean(axis=0)
    charts = ChartLayout(as_pairs(points), layout.corners, np.where(is_small, large, layout.chart))
    return charts.joined(ends.reshape(2, -1).T)


def _relaxed_around(
    layout: Layout, joined: ChartLayout, is_small: BoolArray
) -> tuple[ChartLayout, IntArray] | None:
    """Return charts with the triangles near a small one relaxed, and these triangles; None if they do not fit.

    They fit if none of them is flipped and the points farther away have not moved.

    Args:
        layout: the layout before charts were joined.
        joined: its charts.
        is_small: (m,) the triangles of the small chart.
    """
    is_near = nearby(joined.corners, is_small, RINGS)
    faces = np.flatnonzero(has_any(is_near, joined.corners))
    patch = as_one_chart(replace(layout, points=joined.points, corners=joined.corners), faces)
    is_free = mask_of(len(patch.points), patch.corners[is_near[joined.corners[faces]]])
    relaxed, _ = freed(patch, is_free, TOLERANCE)
    places = relaxed.points[patch.corners]
    is_fixed = np.array_equal(relaxed.points[~is_free], patch.points[~is_free])
    if not is_fixed or not (signed_double_areas(places) > 0).all():
        return None
    points = joined.points.copy()
    points[joined.corners[faces]] = places
    return replace(joined, points=points), faces


def _overlap(places: FloatArray, faces: IntArray, is_large: BoolArray) -> bool:
    """Return whether triangles (k,) among those of a flagged chart overlap others of it; places: (m, 3, 2)."""
    low, high = places[faces].min(axis=(0, 1)), places[faces].max(axis=(0, 1))
    meets = ((places.min(axis=1) < high) & (places.max(axis=1) > low)).all(axis=1)
    return len(find_overlaps(places[meets & is_large], limit=1).pairs) > 0
