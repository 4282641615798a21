"""Charts glued together again where they fit.

In a flat metric the two sides of a seam are congruent: a chart can be moved so that it continues another one across
any seam between them. So what was split off where it was in the way may have its place elsewhere.
"""

from __future__ import annotations

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray
from ..mesh import TriangleMesh
from .layout import Layout, Seams
from .overlap import find_overlaps

# Relative to the length of a seam edge: how far its two sides may be apart, moved together, to be glued.
CONGRUENT = 1e-7


def glue_charts(mesh: TriangleMesh, layout: Layout, lengths: FloatArray) -> Layout:
    """Return a layout with fewer charts and shorter seams, of which none overlaps itself if none did before.

    Args:
        mesh: the mesh, whose faces are laid out.
        layout: its charts.
        lengths: (e,) of the edges on the model: the longest seams are glued first.
    """
    seams = Seams(mesh, layout)
    inner = np.flatnonzero(seams.charts[:, 0] == seams.charts[:, 1])
    layout = layout.joined(seams.coinciding(layout.places, inner, CONGRUENT))
    refused: set[tuple[int, ...]] = set()
    while (found := _glued_once(mesh, layout, lengths, refused)) is not None:
        layout = found
    return layout


def _glued_once(
    mesh: TriangleMesh, layout: Layout, lengths: FloatArray, refused: set[tuple[int, ...]]
) -> Layout | None:
    """Return the layout with two charts glued at the longest stretch of seam where they fit; None if none do.

    refused: stretches, with the sizes of their charts, at which they do not; added to.
    """
    seams = Seams(mesh, layout)
    between = np.flatnonzero(seams.charts[:, 0] != seams.charts[:, 1])
    if not len(between):
        return None
    stretch = seams.stretches(mesh)[between]
    fitting = _Fitting(layout, seams)
    total = np.bincount(stretch, weights=lengths[seams.edges[between]])
    for best in np.argsort(-total, kind="stable")[: np.count_nonzero(total)]:
        members = between[stretch == best]
        sizes = (len(fitting.faces[chart]) for chart in seams.charts[members[0]])
        key = (int(seams.edges[members[0]]), len(members), *sizes)
        if key in refused:
            continue
        found = fitting.glued_at(members)
        if found is not None:
            return found
        refused.add(key)
    return None


class _Fitting:
    """Tries charts of a layout in other places, at the expense of what is near only."""

    def __init__(self, layout: Layout, seams: Seams) -> None:
        self.layout, self.seams, self.places = layout, seams, layout.places
        order = np.argsort(layout.chart, kind="stable")
        self.faces = np.split(order, np.cumsum(np.bincount(layout.chart))[:-1])
        corners = layout.points[layout.corners]
        self.low, self.high = corners.min(axis=1), corners.max(axis=1)

    def glued_at(self, members: IntArray) -> Layout | None:
        """Return the layout with the smaller of two charts moved to continue the other; None if it does not fit."""
        layout, seams = self.layout, self.seams
        here, there = self.places[seams.here[members]], self.places[seams.there[members]]
        longest = np.argmax(np.abs(here[:, 1] - here[:, 0]))
        (kept, moved), here, there = seams.charts[members[longest]], here[longest], there[longest]
        if len(self.faces[kept]) < len(self.faces[moved]):
            kept, moved, here, there = moved, kept, there, here
        across = there[1] - there[0]
        turn = (here[1] - here[0]) / across if across else 0.0
        if not abs(abs(turn) - 1) <= CONGRUENT:
            return None
        places = self.places.copy()
        is_moved = np.zeros(len(places), dtype=bool)
        is_moved[layout.corners[self.faces[moved]]] = True
        places[is_moved] = (places[is_moved] - there.mean()) * (turn / abs(turn)) + here.mean()
        pairs = seams.coinciding(places, seams.within(kept, moved), CONGRUENT)
        # To the last digit: both of a pair are to be one point.
        pairs = np.where(is_moved[pairs[:, :1]], pairs[:, ::-1], pairs)
        places[pairs[:, 1]] = places[pairs[:, 0]]
        points = np.stack([places.real, places.imag], axis=1)
        if not self._fits(points, kept, moved):
            return None
        chart = layout.chart.copy()
        chart[self.faces[moved]] = kept
        return Layout(points, layout.corners, chart).joined(pairs)

    def _fits(self, points: FloatArray, kept: int, moved: int) -> bool:
        """Whether the triangles of a chart are upright in their new places, and overlap none of the other's."""
        corners = points[self.layout.corners[self.faces[moved]]]
        sides = corners[:, 1:] - corners[:, :1]
        if not (sides[:, 0, 0] * sides[:, 1, 1] > sides[:, 0, 1] * sides[:, 1, 0]).all():
            return False
        low, high = corners.min(axis=1), corners.max(axis=1)
        others = self.faces[kept]
        others = others[_touches(self.low[others], self.high[others], low.min(axis=0), high.max(axis=0))]
        if not len(others):
            return True
        near = _touches(low, high, self.low[others].min(axis=0), self.high[others].max(axis=0))
        together = np.concatenate([corners[near], points[self.layout.corners[others]]])
        return not len(find_overlaps(together, limit=1).pairs)


def _touches(low: FloatArray, high: FloatArray, least: FloatArray, most: FloatArray) -> BoolArray:
    """Return which of the boxes from `low` to `high` touch the one from `least` to `most`."""
    inside = (high >= least) & (low <= most)
    return inside[:, 0] & inside[:, 1]
