"""Gluing of charts along congruent seams.

In a flat metric the two sides of a seam are congruent: a chart can be moved so that it continues another one across
any seam between them. A chart that was split off because it overlapped may therefore fit at another seam.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray, has_any, mask_of, rows_of
from ..base.progress import check_cancelled
from ..geometry.overlap import find_overlaps
from ..geometry.planar import as_pairs, bounds, enclosing_box, signed_double_areas
from ..mesh.connectivity import TriangleMesh
from .charts import ChartLayout, Seams, same_points

# Largest distance of the two sides of a seam edge, after they are aligned, at which they are glued; relative to the
# length of the edge.
CONGRUENCE_TOLERANCE = 1e-7


def glue_charts(mesh: TriangleMesh, layout: ChartLayout, lengths: FloatArray) -> ChartLayout:
    """Return a layout with fewer charts and shorter seams, without new self-overlaps of charts.

    Args:
        mesh: the mesh, whose faces are laid out.
        layout: its charts.
        lengths: (e,) edge lengths on the model; the longest seams are glued first.
    """
    seams = Seams(mesh, layout)
    layout = replace(layout, seams=seams.edges)
    inner = np.flatnonzero(seams.charts[:, 0] == seams.charts[:, 1])
    layout = layout.joined(seams.coinciding(layout.places, inner, CONGRUENCE_TOLERANCE))
    if len(inner) == len(seams.edges):  # one chart
        return layout
    rejected: set[tuple[int, ...]] = set()
    gluing = _Gluing(mesh, layout)
    # Gluing changes which seam edges form one stretch.
    while gluing.glue_longest(lengths, rejected):
        gluing = _Gluing(mesh, gluing.layout, gluing)
    return gluing.layout


class _Gluing:
    """The state of gluing charts one by one; each step costs time only for the charts involved."""

    def __init__(self, mesh: TriangleMesh, layout: ChartLayout, before: _Gluing | None = None) -> None:
        """Start from a layout; `before` is the state that led to it, whose arrays are reused."""
        self.seams, self.places = Seams(mesh, layout), layout.places
        between = np.flatnonzero(self.seams.charts[:, 0] != self.seams.charts[:, 1])
        stretches = _members(self.seams.stretches(mesh)[between], between)
        self.stretches = [members for members in stretches if len(members)]
        self.faces = _members(layout.chart, np.arange(len(layout.chart)))
        if before is None:
            self.corners, self.chart = layout.corners.copy(), layout.chart.copy()
            self.low, self.high = bounds(self._corners(np.arange(len(self.corners))))
        else:
            self.corners, self.chart = before.corners, before.chart
            self.low, self.high = before.low, before.high

    @property
    def layout(self) -> ChartLayout:
        """The current layout."""
        return ChartLayout(as_pairs(self.places), self.corners, self.chart, self.seams.edges)

    def glue_longest(self, lengths: FloatArray, rejected: set[tuple[int, ...]]) -> bool:
        """Glue charts along stretches of seam where they fit, the longest first; return True if any were glued.

        Args:
            lengths: (e,) edge lengths on the model.
            rejected: stretches, with the sizes of their charts, at which gluing failed; extended in place.
        """
        glued = False
        total = np.array([lengths[self.seams.edges[members]].sum() for members in self.stretches])
        for best in np.argsort(-total, kind="stable"):
            check_cancelled()
            members = self.stretches[best]
            first_chart, second_chart = self.seams.charts[members[0]]
            sizes = len(self.faces[first_chart]), len(self.faces[second_chart])
            key = (int(self.seams.edges[members[0]]), len(members), *sizes)
            if first_chart == second_chart or key in rejected:
                continue
            if self._glue_at(members):
                glued = True
            else:
                rejected.add(key)
        return glued

    def _glue_at(self, members: IntArray) -> bool:
        """Move the smaller of two charts to continue the other if it fits there; return True if it does."""
        seams = self.seams
        fixed_ends, moved_ends = (
            self.places[seams.first_points[members]],
            self.places[seams.second_points[members]],
        )
        longest = np.argmax(np.abs(fixed_ends[:, 1] - fixed_ends[:, 0]))
        (fixed, moved), fixed_ends, moved_ends = (
            seams.charts[members[longest]],
            fixed_ends[longest],
            moved_ends[longest],
        )
        if len(self.faces[fixed]) < len(self.faces[moved]):
            fixed, moved, fixed_ends, moved_ends = moved, fixed, moved_ends, fixed_ends
        across = moved_ends[1] - moved_ends[0]
        turn = (fixed_ends[1] - fixed_ends[0]) / across if across else 0.0
        if not abs(abs(turn) - 1) <= CONGRUENCE_TOLERANCE:
            return False
        points = np.unique(self.corners[self.faces[moved]])
        before, self.places = self.places, self.places.copy()
        self.places[points] = (before[points] - moved_ends.mean()) * (turn / abs(turn)) + fixed_ends.mean()
        pairs = seams.coinciding(self.places, seams.within(fixed, moved), CONGRUENCE_TOLERANCE)
        # The points of a pair become one point, so they must be equal bit for bit.
        pairs = np.where(np.isin(pairs[:, :1], points), pairs[:, ::-1], pairs)
        self.places[pairs[:, 1]] = self.places[pairs[:, 0]]
        joined = same_points(len(before), pairs)
        self.places = self.places[joined]
        if not self._fits(fixed, moved):
            self.places = before
            return False
        is_joined = mask_of(len(before), pairs)
        fixed_faces = self.faces[fixed]
        changed = np.concatenate(
            [fixed_faces[has_any(is_joined, self.corners[fixed_faces])], self.faces[moved]]
        )
        self.corners[changed] = joined[self.corners[changed]]
        seams.first_points, seams.second_points = joined[seams.first_points], joined[seams.second_points]
        seams.charts[seams.charts == moved] = self.chart[self.faces[moved]] = fixed
        self.faces[fixed] = np.concatenate([self.faces[fixed], self.faces[moved]])
        self.faces[moved] = self.faces[moved][:0]
        self.low[changed], self.high[changed] = bounds(self._corners(changed))
        return True

    def _corners(self, faces: IntArray) -> FloatArray:
        return as_pairs(self.places.take(rows_of(self.corners, faces)))

    def _fits(self, fixed: int, moved: int) -> bool:
        """Return True if the moved chart's triangles are positively oriented and do not overlap the other chart."""
        corners = self._corners(self.faces[moved])
        if not (signed_double_areas(corners) > 0).all():
            return False
        low, high = bounds(corners)
        fixed_faces = self.faces[fixed]
        fixed_low, fixed_high = rows_of(self.low, fixed_faces), rows_of(self.high, fixed_faces)
        is_near = _touch(fixed_low, fixed_high, *enclosing_box(low, high))
        if not is_near.any():
            return True
        fixed_faces = fixed_faces[is_near]
        is_close = _touch(low, high, *enclosing_box(fixed_low[is_near], fixed_high[is_near]))
        together = np.concatenate([corners[is_close], self._corners(fixed_faces)])
        return not len(find_overlaps(together, limit=1).pairs)


def _members(label: IntArray, numbers: IntArray) -> list[IntArray]:
    """Return a list with, for each label, the numbers that have it."""
    return np.split(numbers[np.argsort(label, kind="stable")], np.cumsum(np.bincount(label))[:-1])


def _touch(low: FloatArray, high: FloatArray, box_low: FloatArray, box_high: FloatArray) -> BoolArray:
    """Return (k,) True for boxes from `low` to `high` (k, 2) that touch the box from `box_low` to `box_high` (2,)."""
    does_touch = np.ones(len(low), dtype=bool)
    for x in range(2):  # NumPy is slow at arrays of pairs
        does_touch &= (high[:, x] >= box_low[x]) & (low[:, x] <= box_high[x])
    return does_touch
