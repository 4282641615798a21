"""Charts without overlaps, as few as there can be."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from .._arrays import FloatArray, IntArray, dots, rows_of
from ..flat import LaidOut
from ..geometry.graph import edges_beside
from ..geometry.overlap import overlaps_of_mesh
from ..geometry.planar import signed_double_areas
from ..input.components import Component, seam_costs
from ..input.symmetry import Symmetry
from ..mesh import TriangleMesh
from ..options import Options
from ..text import plural
from ..threads import meanwhile
from .chart_seams import Layout, Seams
from .glue import glue_charts
from .mirrored import mirror_charts, split_alike
from .split import as_disk, split_overlaps, unpinched

# Parts of the area that charts should have at least. Where the cheapest cuts leave several charts, dearer ones that
# leave larger pieces may leave fewer.
LEAST_PARTS = (0.0, 0.002, 0.01)
# On larger meshes, triangles, only where there are slivers.
LARGE = 50_000
# Where so many charts are split off, larger pieces are tried first: most would only have to be glued on again.
MANY = 64
# Below this part of the area a chart is a sliver.
SLIVER = 0.001
# So many charts more there may be for the two sides of a symmetric model to be alike.
MORE_ALIKE = 2
# Of the root of the area: charts that are off their mirror images by less look symmetric.
SEEN = 0.005


def injective_charts(
    mesh: TriangleMesh,
    points: FloatArray,
    corners: IntArray,
    lengths: FloatArray,
    symmetry: Symmetry | None = None,
    disk: TriangleMesh | None = None,
) -> Layout:
    """Return a layout of a connected mesh in charts that do not overlap themselves.

    What overlaps is split off by the cheapest cuts, and what was split off is glued on where it fits. Charts are
    not moved apart.

    Args:
        mesh: the mesh.
        points: (u, 2) of the plane, at the mesh's scale.
        corners: (m, 3) the point of each triangle corner; one disk.
        lengths: (e,) of the edges, which cuts and seams cost.
        symmetry: of mesh and layout; charts are split alike on both sides then, if that takes few more of them.
        disk: a mesh whose faces are the corners, with a vertex for each point, if there is one.
    """
    whole = Layout(points, corners, np.zeros(len(corners), dtype=np.int64))
    places = rows_of(points, corners)
    areas = signed_double_areas(places)
    # The disk has to be made only where something overlaps, but the other core has nothing else to do.
    with meanwhile(partial(_ready_disk, points, corners, disk), len(corners)) as opening:
        pairs = overlaps_of_mesh(mesh.edge_halfedges, places).pairs
        # What an inverted triangle covers is not to be had apart from its neighbours.
        pairs = pairs[(areas[pairs] > 0).all(axis=1)]
        if not len(pairs):
            return glue_charts(mesh, whole, lengths).numbered_anew()
        disk = opening.result()
    found: list[tuple[tuple[int, int, float], int, Layout]] = []
    for part in LEAST_PARTS:
        least = part * float(np.abs(areas).sum())
        most = MANY if part < LEAST_PARTS[-1] else np.inf
        chart = split_overlaps(
            points, corners, lengths[mesh.halfedge_edges], np.abs(areas), pairs, least, most, disk
        )
        if chart is None:
            continue
        layout = glue_charts(mesh, whole.split(chart), lengths).numbered_anew()
        rank = _rank(mesh, layout, np.abs(areas), lengths)
        found.append((rank, len(found), layout))
        if rank[1] == 1 or (not rank[0] and len(corners) > LARGE):
            break
    best = min(found, key=lambda one: one[:2])[2]
    if symmetry is None:
        return best
    return _most_alike(mesh, best, whole, lengths, np.abs(areas), pairs, symmetry)


def _ready_disk(points: FloatArray, corners: IntArray, known: TriangleMesh | None) -> TriangleMesh:
    """Return a layout as a mesh of its own, with what cutting it will need; `known` has the same faces."""
    disk = as_disk(points, corners) if known is None else unpinched(known.moved_to(points))
    edges_beside(disk)
    return disk


def _most_alike(
    mesh: TriangleMesh,
    best: Layout,
    whole: Layout,
    lengths: FloatArray,
    areas: FloatArray,
    pairs: IntArray,
    symmetry: Symmetry,
) -> Layout:
    """Return a layout whose charts are more alike on both sides of a plane of symmetry, or the best as it is.

    It has no more slivers, and few more charts; the other arguments are those of `split_alike`.
    """
    slivers, count, _ = _rank(mesh, best, areas, lengths)
    most = count + MORE_ALIKE
    partner = symmetry.mirror.partner
    off = mirror_charts(mesh, best, partner).off
    for part in LEAST_PARTS if off > SEEN else ():
        alike = split_alike(mesh, whole, lengths, areas, pairs, symmetry, part * float(areas.sum()))
        if alike is None:
            continue
        more_slivers, more, _ = _rank(mesh, alike, areas, lengths)
        alike_off = mirror_charts(mesh, alike, partner).off
        if more_slivers <= slivers and more <= most and alike_off < off:
            best, off = alike, alike_off
    return best


def _rank(
    mesh: TriangleMesh, layout: Layout, areas: FloatArray, lengths: FloatArray
) -> tuple[int, int, float]:
    """Return the number of slivers, that of charts, and the length of seams."""
    sizes = np.bincount(layout.chart, weights=areas)
    slivers = int((sizes < SLIVER * sizes.sum()).sum())
    return slivers, len(sizes), float(lengths[Seams(mesh, layout).edges].sum())


def cut_costs(laid_out: LaidOut, part: Component, options: Options) -> FloatArray:
    """Return (e,) what cuts along the edges of a layout's mesh cost."""
    mesh = laid_out.mesh
    costs, avoided, forbidden = seam_costs(part, options)
    costs = np.where(avoided | forbidden, costs + costs.sum(), costs)
    if laid_out.cuts is None:
        return costs
    # Parts of edges cost their part, and those that are new what they are long.
    origin = laid_out.cuts.edge_origin
    before, after = _edge_lengths(part.mesh), _edge_lengths(mesh)
    share = after / np.where(before > 0, before, 1.0)[origin]
    return np.where(origin >= 0, costs[origin] * share, after)


def without_overlaps(laid_out: LaidOut, part: Component, options: Options) -> LaidOut:
    """Return the layout split, as little as can be, into charts that do not overlap themselves."""
    mesh, use = laid_out.mesh, laid_out.symmetry
    symmetry = use.symmetry if use is not None and use.seams and mesh is part.mesh else None
    costs = cut_costs(laid_out, part, options)
    disk = laid_out.disk
    charts = injective_charts(mesh, laid_out.points, laid_out.corners, costs, symmetry, disk)
    edges = Seams(mesh, charts).edges
    return replace(
        laid_out,
        points=charts.points,
        corners=charts.corners,
        chart=charts.chart,
        disk=None,
        seams=mesh.edges[edges],
        notes=(*laid_out.notes, *_forbidden_cuts(laid_out, part, edges)),
    )


def _forbidden_cuts(laid_out: LaidOut, part: Component, edges: IntArray) -> tuple[str, ...]:
    """Return a note if some edges (k,) of a layout's mesh that are cut must not be."""
    if not part.is_forbidden.any():
        return ()
    origin = edges if laid_out.cuts is None else laid_out.cuts.edge_origin[edges]
    is_forbidden = part.is_forbidden.ravel()[part.mesh.edge_halfedges[:, 0]]
    count = int(is_forbidden[np.unique(origin[origin >= 0])].sum())
    if not count:
        return ()
    return (
        f"Cut all the same: {plural(count, 'edge')} forbidden as seams, or charts would overlap themselves.",
    )


def _edge_lengths(mesh: TriangleMesh) -> FloatArray:
    """Return (e,) the lengths of edges in space."""
    ends = mesh.vertices[mesh.edges]
    lengths: FloatArray = np.sqrt(dots(ends[:, 1] - ends[:, 0], ends[:, 1] - ends[:, 0]))
    return lengths
