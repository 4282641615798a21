"""Splitting of a layout into few charts that do not overlap themselves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..base.arrays import FloatArray, IntArray, rows_of
from ..base.notes import Unmet
from ..base.progress import stage
from ..base.text import plural
from ..geometry.overlap import overlaps_of_mesh
from ..geometry.planar import signed_double_areas
from ..mesh.connectivity import TriangleMesh, label_faces
from ..stages import Layout, SeamSpec
from .charts import ChartLayout, Seams
from .glue import glue_charts
from .split import as_disk, filled_disk, find_steps, split_overlaps, unpinched

# Minimum areas of a chart to try, as fractions of the total area. Where the cheapest cuts leave several charts,
# costlier cuts with larger pieces may leave fewer: a figure of 5,000 triangles gets 9 instead of 11.
MIN_CHART_AREAS = (0.0, 0.002, 0.01)
# Number of charts at which splitting stops and the next minimum area is tried: most charts would be glued on again. A
# surface with 50 handles takes 25 s instead of 28.
MAX_SMALL_CHARTS = 64


def injective_charts(
    mesh: TriangleMesh,
    points: FloatArray,
    corners: IntArray,
    lengths: FloatArray,
    disk: TriangleMesh | None = None,
    tries: int = len(MIN_CHART_AREAS),
) -> ChartLayout:
    """Return a layout of a connected mesh in charts that do not overlap themselves.

    Overlapping layers are separated by the cheapest cuts, and the pieces are glued to other charts where they fit.
    Different charts may still overlap each other.

    Args:
        mesh: the mesh.
        points: (u, 2) positions in the plane, at the mesh's scale.
        corners: (m, 3) point index of each triangle corner; the triangles form one disk, which may have holes.
        lengths: (e,) costs of cutting the edges.
        disk: a mesh whose faces are the corners, with a vertex for each point; None to compute it.
        tries: how many of the minimum areas of a chart are tried: one for the cheapest cuts, all for few charts.
    """
    single_chart = ChartLayout(points, corners, np.zeros(len(corners), dtype=np.int64))
    places = rows_of(points, corners)
    areas = signed_double_areas(places)
    pairs = overlaps_of_mesh(mesh.edge_halfedges, places).pairs
    # An inverted triangle cannot be separated from its neighbours.
    pairs = pairs[(areas[pairs] > 0).all(axis=1)]
    if not len(pairs):
        return glue_charts(mesh, single_chart, lengths).renumbered()
    disk = as_disk(points, corners) if disk is None else unpinched(disk.moved_to(points))
    disk, side_costs = filled_disk(disk, lengths[mesh.halfedge_edges])
    disk_areas = np.pad(np.abs(areas), (0, len(disk.faces) - len(areas)))
    steps = find_steps(pairs, disk.faces)
    candidates = list[ChartLayout]()
    shares = MIN_CHART_AREAS[:tries]
    for share in shares:
        min_area = share * float(disk_areas.sum())
        max_charts = MAX_SMALL_CHARTS if share < shares[-1] else np.inf
        chart = split_overlaps(disk, side_costs, disk_areas, pairs, min_area, max_charts, steps)
        if chart is None:
            continue
        layout = single_chart.split(chart[: len(areas)])
        if len(disk.faces) > len(areas):  # a piece that only filled holes connect is in several charts
            layout = replace(layout, chart=label_faces(layout.corners, len(layout.points))[1])
        layout = glue_charts(mesh, layout, lengths).renumbered()
        candidates.append(layout)
        if not layout.chart.any():
            break
    return min(candidates, key=lambda layout: (layout.chart.max(), lengths[Seams(mesh, layout).edges].sum()))


@stage("atlas")
def separate_overlaps(
    layout: Layout, costs: FloatArray, spec: SeamSpec, tries: int = len(MIN_CHART_AREAS)
) -> Layout:
    """Return the layout split into few charts that do not overlap themselves.

    Args:
        layout: a layout in one chart.
        costs: (e,) costs of cutting the edges.
        spec: which edges to avoid and which are forbidden as cuts.
        tries: see `injective_charts`; one is for the cheapest cuts, all for few charts.

    Returns:
        The split layout, with a note if forbidden edges had to be cut.
    """
    mesh = layout.mesh
    costs = np.where(spec.is_avoided | spec.is_forbidden, costs + costs.sum(), costs)
    charts = injective_charts(mesh, layout.points, layout.corners, costs, layout.disk, tries)
    separated = with_charts(layout, charts)
    count = int(spec.is_forbidden[Seams(mesh, charts).edges].sum())
    note = f"{plural(count, 'forbidden edge')} had to be cut to separate overlaps."
    return separated.with_notes(Unmet(note)) if count else separated


def with_charts(layout: Layout, charts: ChartLayout) -> Layout:
    """Return the layout in other charts."""
    seams = layout.mesh.edges[Seams(layout.mesh, charts).edges]
    return replace(
        layout, points=charts.points, corners=charts.corners, chart=charts.chart, seams=seams, disk=None
    )
