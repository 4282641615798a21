"""Layouts with free seams: the two sides of a seam need not be equal, so that triangles are distorted least."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from ..atlas import ChartLayout, separate_overlaps, with_charts
from ..base import BoolArray, FloatArray, IntArray
from ..errors import SeamError
from ..geometry import (
    double_areas,
    find_overlaps,
    layout_curvature,
    signed_double_areas,
    triangle_energies,
    vertex_log_scale,
)
from ..mesh import find_holes, label_faces, open_along
from ..mesh.connectivity import TriangleMesh, are_among
from ..optimise import relaxed_disks, untangled_disk
from ..seams import find_seams
from ..stages import Layout, SeamSpec, SolveStatistics


def freed(
    layout: Layout, free: BoolArray | None = None, tolerance: float = 1e-3, spec: SeamSpec | None = None
) -> tuple[Layout, float]:
    """Return a layout with the least symmetric Dirichlet energy, and this energy, averaged by area.

    The sides of seams move independently, and no triangle is flipped. Flipped triangles of the given layout are
    untangled. If this fails, the minimisation starts from an embedding of W. T. Tutte, "How to draw a graph", 1963.
    Scales and curvatures at vertices remain those of the given layout, see `measured`.

    Args:
        layout: a layout in any number of charts.
        free: (c,) the points that move, next to those that untangling moves; None for all. All move if untangling
            fails or adds cuts.
        tolerance: see `relax`.
        spec: which edges may be cut where untangling fails without it; None for none.
    """
    areas = double_areas(layout.lengths) / 2
    disk = layout.disk or TriangleMesh(np.zeros((len(layout.points), 3)), layout.corners)
    is_bad = ~(signed_double_areas(layout.points[layout.corners]) > 0)
    if 0 < is_bad.sum() < len(is_bad):
        layout = _untangled(layout, disk, spec)
    disk = layout.disk or disk
    free = None if free is None or len(free) != len(layout.points) else free
    points = relaxed_disks(disk, layout.points, layout.lengths, layout.chart, free, tolerance)
    energies = triangle_energies(layout.lengths, points[layout.corners])
    return replace(layout, points=points), float(energies.sum() / areas.sum())


def _untangled(layout: Layout, disk: TriangleMesh, spec: SeamSpec | None) -> Layout:
    """Return a layout with fewer flipped triangles or none.

    Vertices around which triangles wind more than once are cut open if nothing else untangles them.
    """
    fixed = np.zeros(len(layout.points), dtype=bool)
    points, *_ = untangled_disk(disk, layout.points, layout.lengths, fixed, may_wind=spec is not None)
    untangled, places = replace(layout, points=points), points[disk.faces]
    winding = np.flatnonzero((layout_curvature(disk, places) < -np.pi) & ~disk.is_boundary_vertex)
    if spec is None or not len(winding) or not (signed_double_areas(places) > 0).all():
        return untangled
    sides = disk.edge_halfedges[:, 0]
    edges, lengths = layout.mesh.halfedge_edges[sides], layout.lengths.ravel()[sides]
    forbidden = np.flatnonzero(spec.is_forbidden[edges])
    with suppress(SeamError):
        holes = find_holes(disk, layout.lengths)
        costs = lengths, spec.is_avoided[edges]
        paths = find_seams(disk, winding, *costs, forbidden=forbidden, kept_holes=holes)
        return recut(untangled, np.union1d(seam_edges(layout), edges[paths]))
    return layout


def laid_out(
    mesh: TriangleMesh, lengths: FloatArray, places: FloatArray, seams: IntArray, cones: IntArray
) -> Layout:
    """Return the layout that consists of triangles in the plane; scales and curvatures are NaN, see `measured`.

    Args:
        mesh, lengths: the mesh, and (m, 3) its side lengths.
        places: (m, 3, 2) the corners of its triangles in the plane, in one chart.
        seams: (k,) the edges across which they do not fit.
        cones: (s,) vertices at which seams may end.
    """
    disk, unknown = open_along(mesh, seams).mesh, np.full(len(mesh.vertices), np.nan)
    points, is_open = np.empty((len(disk.vertices), 2)), np.ones(len(unknown), dtype=bool)
    points[disk.faces] = places
    return Layout(
        mesh=mesh,
        lengths=lengths,
        points=points,
        corners=disk.faces,
        chart=np.zeros(len(disk.faces), dtype=np.int64),
        cones=cones,
        seams=mesh.edges[seams],
        log_scale=unknown,
        target=unknown,
        curvature=unknown,
        is_open=is_open,
        is_fixed=~is_open,
        statistics=SolveStatistics(),
        disk=disk,
    )


def measured(layout: Layout) -> Layout:
    """Return a layout with free seams with the scales and curvatures that it has."""
    mesh, places = layout.mesh, layout.points[layout.corners]
    areas, flat = double_areas(layout.lengths) / 2, np.abs(signed_double_areas(places)) / 2
    curvature, is_open = layout_curvature(mesh, places), np.ones(len(mesh.vertices), dtype=bool)
    layout_with_scales = replace(layout, log_scale=vertex_log_scale(mesh, areas, flat), curvature=curvature)
    return replace(layout_with_scales, target=curvature, is_open=is_open, is_fixed=~is_open)


def recut(layout: Layout, seams: IntArray) -> Layout:
    """Return a layout that is cut along given edges (k,); the two sides of seams that are closed meet in the middle."""
    mesh, disk = layout.mesh, open_along(layout.mesh, seams).mesh
    corners, places = disk.faces, layout.points[layout.corners].reshape(-1, 2)
    sums = np.stack([np.bincount(corners.ravel(), column) for column in places.T], axis=1)
    points, chart = sums / np.bincount(corners.ravel())[:, None], label_faces(corners, len(sums))[1]
    return replace(layout, points=points, corners=corners, disk=disk, seams=mesh.edges[seams], chart=chart)


def side_by_side(layout: Layout) -> Layout:
    """Return a layout whose charts do not overlap one another."""
    place = np.zeros(len(layout.points))
    place[layout.corners] = layout.chart[:, None]
    width = 1.1 * float(np.ptp(layout.points[:, 0]))
    return replace(layout, points=layout.points + np.stack([width * place, 0 * place], axis=1))


def separate_charts(layout: Layout, costs: FloatArray, spec: SeamSpec) -> Layout:
    """Return a layout in any number of charts, split by the cheapest cuts so that no chart overlaps itself.

    Forbidden edges may be cut, without a note.
    """
    if not layout.chart.any():
        separated = replace(separate_overlaps(layout, costs, spec, 1), notes=layout.notes)
        return replace(separated, chart=label_faces(separated.corners, len(separated.points))[1])
    pairs = find_overlaps(side_by_side(layout).points[layout.corners]).pairs
    label = layout.chart.copy()
    for chart in np.unique(layout.chart[pairs[:, 0]]).tolist():
        faces = np.flatnonzero(layout.chart == chart)
        chart_layout = as_one_chart(layout, faces)
        sides = chart_layout.mesh.edge_halfedges[:, 0]
        edges = layout.mesh.halfedge_edges[3 * faces[sides // 3] + sides % 3]
        chart_spec = replace(spec, is_avoided=spec.is_avoided[edges], is_forbidden=spec.is_forbidden[edges])
        pieces = separate_overlaps(chart_layout, costs[edges], chart_spec, 1).chart
        label[faces] = np.where(pieces > 0, label.max() + pieces, chart)
    charts = ChartLayout(layout.points, layout.corners, layout.chart)
    return with_charts(layout, charts.split(label).renumbered())


def as_one_chart(layout: Layout, faces: IntArray) -> Layout:
    """Return some triangles (k,) of a layout as one chart, on a mesh whose vertices are their points.

    What the layout says of vertices, cones and seams remains that of the whole mesh.
    """
    points_used, corners = np.unique(layout.corners[faces], return_inverse=True)
    points, lengths, chart = (
        layout.points[points_used],
        layout.lengths[faces],
        np.zeros(len(faces), dtype=np.int64),
    )
    mesh = TriangleMesh(np.pad(points, ((0, 0), (0, 1))), corners.reshape(-1, 3))
    chart_layout = replace(layout, mesh=mesh, points=points, corners=mesh.faces, disk=None)
    return replace(chart_layout, lengths=lengths, chart=chart)


def seam_edges(layout: Layout) -> IntArray:
    """Return (k,) the edges of the seams of a layout."""
    return np.flatnonzero(are_among(layout.mesh.edges, layout.seams))
