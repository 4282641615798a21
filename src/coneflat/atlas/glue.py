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
    layout = layout.joined(seams.coinciding(layout, inner, CONGRUENT))
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
    sizes = np.bincount(layout.chart)
    total = np.bincount(stretch, weights=lengths[seams.edges[between]])
    for best in np.argsort(-total, kind="stable")[: np.count_nonzero(total)]:
        members = between[stretch == best]
        key = (int(seams.edges[members[0]]), len(members), *sizes[seams.charts[members[0]]].tolist())
        if key in refused:
            continue
        found = _glued_at(layout, seams, members, sizes)
        if found is not None:
            return found
        refused.add(key)
    return None


def _glued_at(layout: Layout, seams: Seams, members: IntArray, sizes: IntArray) -> Layout | None:
    """Return the layout with the smaller of two charts moved to continue the other; None if it does not fit."""
    here, there = layout.places[seams.here[members]], layout.places[seams.there[members]]
    longest = np.argmax(np.abs(here[:, 1] - here[:, 0]))
    (kept, moved), here, there = seams.charts[members[longest]], here[longest], there[longest]
    if sizes[kept] < sizes[moved]:
        kept, moved, here, there = moved, kept, there, here
    across = there[1] - there[0]
    turn = (here[1] - here[0]) / across if across else 0.0
    if not abs(abs(turn) - 1) <= CONGRUENT:
        return None
    is_moved = layout.chart == moved
    ids = np.unique(layout.corners[is_moved])
    places = (layout.places[ids] - there.mean()) * (turn / abs(turn)) + here.mean()
    points = layout.points.copy()
    points[ids] = np.stack([places.real, places.imag], axis=1)
    candidate = Layout(points, layout.corners, np.where(is_moved, kept, layout.chart))
    pairs = seams.coinciding(candidate, seams.within(kept, moved), CONGRUENT)
    joined = candidate.joined(pairs)
    return joined if _fits(joined, is_moved, joined.chart == kept) else None


def _fits(layout: Layout, is_moved: BoolArray, is_chart: BoolArray) -> bool:
    """Whether moved triangles are upright, and overlap none of the others of their chart."""
    corners = layout.points[layout.corners]
    sides = corners[is_moved][:, 1:] - corners[is_moved][:, :1]
    if not (sides[:, 0, 0] * sides[:, 1, 1] > sides[:, 0, 1] * sides[:, 1, 0]).all():
        return False
    low, high = corners.min(axis=1), corners.max(axis=1)
    is_other = is_chart & ~is_moved
    near = np.zeros_like(is_moved)
    for some, others in ((is_moved, is_other), (is_other, is_moved)):
        meets = (high >= low[others].min(axis=0)) & (low <= high[others].max(axis=0))
        near |= some & meets.all(axis=1)
    return not len(find_overlaps(layout.points, layout.corners[near], limit=1).pairs) if near.any() else True
