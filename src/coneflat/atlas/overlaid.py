"""Both sides of a mirror symmetric model in one place of the texture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .._arrays import FloatArray, IntArray
from ..flat import LaidOut
from ..geometry.mirror import mirrored_corners
from ..input.components import Component
from ..mesh import TriangleMesh
from ..options import Options
from ..seams import open_along
from .chart_seams import Layout, Seams
from .injective import cut_costs, injective_charts, without_overlaps

NOT_OVERLAID = (
    "Both sides of a component are laid out apart: they lie on each other only where cones and cut are symmetric, and "
    "every vertex has a mirror image."
)


def overlaid(laid_out: LaidOut, part: Component, options: Options) -> LaidOut:
    """Return the layout in charts of which those of the right side lie on those of the left, mirrored.

    Only overlaps of the left side with itself are taken away. Where that cannot be done, nothing overlaps, and a note
    says so.
    """
    source = _sources(laid_out)
    if source is None:
        apart = without_overlaps(laid_out, part, options)
        return replace(apart, notes=(*apart.notes, NOT_OVERLAID))
    mesh, is_left = laid_out.mesh, np.flatnonzero(source[:, 0] < 0)
    half, costs = _left_half(mesh, is_left, cut_costs(laid_out, part, options))
    used, corners = np.unique(laid_out.corners[is_left], return_inverse=True)
    layout = injective_charts(half, laid_out.points[used], corners.reshape(-1, 3), costs)
    every, chart = np.empty_like(laid_out.corners), np.empty(len(mesh.faces), dtype=np.int64)
    every[is_left], chart[is_left] = layout.corners, layout.chart
    # The right side has points of its own, at the same places.
    right = np.flatnonzero(source[:, 0] >= 0)
    count = len(layout.points)
    every[right] = every.ravel()[source[right]] + count
    chart[right] = chart[source[right, 0] // 3] + layout.chart.max() + 1
    used, corners = np.unique(every, return_inverse=True)
    found = Layout(np.tile(layout.points, (2, 1))[used], corners.reshape(-1, 3), chart)
    return replace(
        laid_out,
        points=found.points,
        corners=found.corners,
        chart=found.chart,
        disk=None,
        seams=mesh.edges[Seams(mesh, found).edges],
        # All points of the left are used, so that they are numbered as before.
        lies_on=np.where(used < count, np.arange(len(used)), used - count),
    )


def _sources(laid_out: LaidOut) -> IntArray | None:
    """Return (m, 3) for faces on the right the corners on the left that they lie on, -1 on the left; None if not."""
    use = laid_out.symmetry
    if use is None or not use.seams or use.symmetry.is_left is None or not use.symmetry.is_alike:
        return None
    is_left = use.symmetry.is_left
    if len(is_left) != len(laid_out.mesh.faces):  # a refinement has faces of its own
        return None
    source = mirrored_corners(laid_out.mesh, use.symmetry.mirror.partner, is_left).reshape(-1, 3)
    return None if (source[~is_left] < 0).any() else source


def _left_half(mesh: TriangleMesh, faces: IntArray, costs: FloatArray) -> tuple[TriangleMesh, FloatArray]:
    """Return the left side of a mesh alone, and what its edges cost."""
    is_left = np.zeros(len(mesh.faces), dtype=bool)
    is_left[faces] = True
    inside = np.flatnonzero(~mesh.is_boundary_edge)
    sides = is_left[mesh.edge_faces[inside]]
    opened = open_along(mesh, inside[sides[:, 0] != sides[:, 1]]).mesh
    half = next(part for part, _, own in opened.split_components() if is_left[own[0]])
    side = half.edge_halfedges[:, 0]
    return half, costs[mesh.halfedge_edges[3 * faces[side // 3] + side % 3]]
