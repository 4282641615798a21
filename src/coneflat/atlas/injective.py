"""Charts without overlaps, as few as there can be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..base.arrays import FloatArray, IntArray, rows_of
from ..base.text import plural
from ..geometry.overlap import overlaps_of_mesh
from ..geometry.planar import signed_double_areas
from ..mesh.connectivity import TriangleMesh
from ..stages import Layout, SeamSpec
from .charts import ChartLayout, Seams
from .glue import glue_charts
from .split import as_disk, split_overlaps, unpinched

# Parts of the area that charts should have at least. Where the cheapest cuts leave several charts, costlier ones that
# leave larger pieces may leave fewer.
LEAST_PARTS = (0.0, 0.002, 0.01)
# On larger meshes, triangles, only where there are slivers.
LARGE_TRIANGLES = 50_000
# Where so many charts are split off, larger pieces are tried first: most would only have to be glued on again.
LARGEST_FIRST_CHARTS = 64
# Below this part of the area a chart is a sliver.
SLIVER_AREA = 0.001


def injective_charts(
    mesh: TriangleMesh,
    points: FloatArray,
    corners: IntArray,
    lengths: FloatArray,
    disk: TriangleMesh | None = None,
) -> ChartLayout:
    """Return a layout of a connected mesh in charts that do not overlap themselves.

    What overlaps is split off by the cheapest cuts, and what was split off is glued on where it fits. Charts are
    not moved apart.

    Args:
        mesh: the mesh.
        points: (u, 2) of the plane, at the mesh's scale.
        corners: (m, 3) the point of each triangle corner; one disk.
        lengths: (e,) of the edges, which cuts and seams cost.
        disk: a mesh whose faces are the corners, with a vertex for each point, if there is one.
    """
    whole = ChartLayout(points, corners, np.zeros(len(corners), dtype=np.int64))
    places = rows_of(points, corners)
    areas = signed_double_areas(places)
    pairs = overlaps_of_mesh(mesh.edge_halfedges, places).pairs
    # An inverted triangle cannot be separated from its neighbours.
    pairs = pairs[(areas[pairs] > 0).all(axis=1)]
    if not len(pairs):
        return glue_charts(mesh, whole, lengths).numbered_anew()
    disk = as_disk(points, corners) if disk is None else unpinched(disk.moved_to(points))
    found: list[tuple[tuple[int, int, float], int, ChartLayout]] = []
    for part in LEAST_PARTS:
        least = part * float(np.abs(areas).sum())
        most = LARGEST_FIRST_CHARTS if part < LEAST_PARTS[-1] else np.inf
        chart = split_overlaps(
            points, corners, lengths[mesh.halfedge_edges], np.abs(areas), pairs, least, most, disk
        )
        if chart is None:
            continue
        layout = glue_charts(mesh, whole.split(chart), lengths).numbered_anew()
        rank = _rank(mesh, layout, np.abs(areas), lengths)
        found.append((rank, len(found), layout))
        if rank[1] == 1 or (not rank[0] and len(corners) > LARGE_TRIANGLES):
            break
    return min(found, key=lambda one: one[:2])[2]


def _rank(
    mesh: TriangleMesh, layout: ChartLayout, areas: FloatArray, lengths: FloatArray
) -> tuple[int, int, float]:
    """Return the number of slivers, that of charts, and the length of seams."""
    sizes = np.bincount(layout.chart, weights=areas)
    slivers = int((sizes < SLIVER_AREA * sizes.sum()).sum())
    return slivers, len(sizes), float(lengths[Seams(mesh, layout).edges].sum())


def separate_overlaps(layout: Layout, costs: FloatArray, spec: SeamSpec) -> Layout:
    """Return the layout split, as little as can be, into charts that do not overlap themselves.

    Args:
        layout: in one chart.
        costs: (e,) of cutting edges.
        spec: which edges to avoid.
    """
    mesh = layout.mesh
    costs = np.where(spec.is_avoided | spec.is_forbidden, costs + costs.sum(), costs)
    charts = injective_charts(mesh, layout.points, layout.corners, costs, layout.disk)
    edges = Seams(mesh, charts).edges
    count = int(spec.is_forbidden[edges].sum())
    separated = replace(
        layout,
        points=charts.points,
        corners=charts.corners,
        chart=charts.chart,
        disk=None,
        seams=mesh.edges[edges],
    )
    if not count:
        return separated
    return separated.with_notes(
        f"{plural(count, 'forbidden edge')} had to be cut, or charts would overlap themselves."
    )
