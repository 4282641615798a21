"""Charts without overlaps, as few as there can be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .._arrays import FloatArray, IntArray, dots
from ..flat import LaidOut
from ..geometry.overlap import find_overlaps
from ..geometry.planar import signed_double_areas
from ..input.components import Component, seam_costs
from ..mesh import TriangleMesh
from ..options import Options
from .chart_seams import Layout, Seams
from .glue import glue_charts
from .split import split_overlaps

# Parts of the area that charts should have at least. Where the cheapest cuts leave several charts, dearer ones that
# leave larger pieces may leave fewer.
LEAST_PARTS = (0.0, 0.002, 0.01)
# On larger meshes, triangles, only where there are slivers.
LARGE = 50_000
# Where so many charts are split off, larger pieces are tried first: most would only have to be glued on again.
MANY = 64
# Below this part of the area a chart is a sliver.
SLIVER = 0.001


def injective_charts(
    mesh: TriangleMesh, points: FloatArray, corners: IntArray, lengths: FloatArray
) -> Layout:
    """Return a layout of a connected mesh in charts that do not overlap themselves.

    What overlaps is split off by the cheapest cuts, and what was split off is glued on where it fits. Charts are
    not moved apart.

    Args:
        mesh: the mesh.
        points: (u, 2) of the plane, at the mesh's scale.
        corners: (m, 3) the point of each triangle corner; one disk.
        lengths: (e,) of the edges, which cuts and seams cost.
    """
    whole = Layout(points, corners, np.zeros(len(corners), dtype=np.int64))
    areas = signed_double_areas(points[corners])
    pairs = find_overlaps(points, corners).pairs
    # What an inverted triangle covers is not to be had apart from its neighbours.
    pairs = pairs[(areas[pairs] > 0).all(axis=1)]
    if not len(pairs):
        return glue_charts(mesh, whole, lengths).numbered_anew()
    found: list[tuple[tuple[int, int, float], int, Layout]] = []
    for part in LEAST_PARTS:
        least = part * float(np.abs(areas).sum())
        most = MANY if part < LEAST_PARTS[-1] else np.inf
        chart = split_overlaps(
            points, corners, lengths[mesh.halfedge_edges], np.abs(areas), pairs, least, most
        )
        if chart is None:
            continue
        layout = glue_charts(mesh, whole.split(chart), lengths).numbered_anew()
        sizes = np.bincount(layout.chart, weights=np.abs(areas))
        slivers = int((sizes < SLIVER * sizes.sum()).sum())
        length = float(lengths[Seams(mesh, layout).edges].sum())
        found.append(((slivers, len(sizes), length), len(found), layout))
        if len(sizes) == 1 or (not slivers and len(corners) > LARGE):
            break
    return min(found, key=lambda one: one[:2])[2]


def without_overlaps(laid_out: LaidOut, part: Component, options: Options) -> LaidOut:
    """Return the layout split, as little as can be, into charts that do not overlap themselves."""
    mesh = laid_out.mesh
    costs, avoided, forbidden = seam_costs(part, options)
    costs = np.where(avoided | forbidden, costs + costs.sum(), costs)
    if laid_out.cuts is not None:
        # Parts of edges cost their part, and those that are new what they are long.
        origin = laid_out.cuts.edge_origin
        before, after = _edge_lengths(part.mesh), _edge_lengths(mesh)
        share = after / np.where(before > 0, before, 1.0)[origin]
        costs = np.where(origin >= 0, costs[origin] * share, after)
    charts = injective_charts(mesh, laid_out.points, laid_out.corners, costs)
    return replace(
        laid_out,
        points=charts.points,
        corners=charts.corners,
        chart=charts.chart,
        seams=mesh.edges[Seams(mesh, charts).edges],
    )


def _edge_lengths(mesh: TriangleMesh) -> FloatArray:
    """Return (e,) the lengths of edges in space."""
    ends = mesh.vertices[mesh.edges]
    lengths: FloatArray = np.sqrt(dots(ends[:, 1] - ends[:, 0], ends[:, 1] - ends[:, 0]))
    return lengths
