"""Layout of a flat metric on a cut mesh as points in the plane."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..base.arrays import FloatArray, mask_of, rows_of
from ..base.progress import stage
from ..base.text import plural
from ..errors import MetricError
from ..geometry import angle_defect, corner_angles, double_areas
from ..geometry.planar import layout_curvature, signed_double_areas, vertex_log_scale
from ..geometry.straight import FlatTriangles, rest_sides
from ..geometry.unfolding import unfold
from ..optimise.untangling import MAX_RINGS, untangle
from ..stages import Cut, Embedding, FlatMetric, Layout
from .least_squares import least_squares_layout


@stage("layout")
def lay_out(metric: FlatMetric, cut: Cut, untangles: bool = True) -> Layout:
    """Return the layout of a flat metric on a mesh that is cut open (Section 4.3 of the paper).

    An exact metric with straight triangles is unfolded, by default after inverted triangles are turned back. Lengths of
    an approximately flat metric are laid out by least squares. Other methods provide a map of the cut mesh.

    Args:
        metric: the flat metric.
        cut: the seams and the mesh cut open along them.
        untangles: turn inverted triangles back.

    Raises:
        MetricError: the layout has no area.
    """
    if metric.triangles is not None:
        return _unfolded(metric, metric.triangles, cut, MAX_RINGS if untangles else 0)
    if metric.flat_lengths is not None:
        return _least_squares(metric, metric.flat_lengths, cut)
    assert metric.embed is not None
    return _embedded(metric, metric.embed(cut), cut)


def _layout(metric: FlatMetric, cut: Cut, points: FloatArray, curvature: FloatArray) -> Layout:
    mesh, is_open = metric.mesh, metric.is_open
    if not metric.has_target_cones:
        is_open = is_open.copy()
        is_open[mesh.edges[cut.seams]] = True
    return Layout(
        mesh=mesh,
        lengths=metric.lengths,
        points=points,
        corners=cut.mesh.faces,
        chart=np.zeros(len(mesh.faces), dtype=np.int64),
        cones=metric.cones,
        seams=mesh.edges[cut.seams],
        log_scale=metric.log_scale,
        target=metric.target,
        curvature=curvature,
        is_open=is_open,
        is_fixed=metric.is_fixed,
        statistics=metric.statistics,
        notes=metric.notes,
        disk=cut.mesh,
    )


def _unfolded(metric: FlatMetric, triangles: FlatTriangles, cut: Cut, rings: int) -> Layout:
    mesh = metric.mesh
    on_boundary, stays = mesh.is_boundary_vertex, metric.is_fixed.copy()
    stays[metric.cones] = True
    on_seam = mask_of(len(mesh.vertices), mesh.edges[cut.seams])
    angles = np.where(on_boundary, np.pi, 2 * np.pi) - metric.target
    masks = stays | on_seam | on_boundary, stays | on_boundary, stays
    target_shapes = rest_sides(metric.lengths)
    untangled = untangle(triangles, mesh.faces, angles, on_boundary, masks, target_shapes, rings)
    points = unfold(untangled.flat, cut.mesh.faces) * metric.scale
    curvature = layout_curvature(mesh, rows_of(points, cut.mesh.faces))
    statistics = replace(
        metric.statistics,
        untangled_triangles=int(triangles.is_inverted.sum()) if rings else 0,
        untangled_vertices=len(untangled.moved),
        untangled_move=untangled.largest_move,
    )
    # Where the curvature is not prescribed, the target is set to the resulting curvature.
    target = np.where(metric.is_open, curvature, metric.target)
    return replace(_layout(metric, cut, points, curvature), statistics=statistics, target=target)


def _least_squares(metric: FlatMetric, lengths: FloatArray, cut: Cut) -> Layout:
    points = least_squares_layout(cut.mesh, lengths)
    area = np.abs(signed_double_areas(points[cut.mesh.faces])).sum()
    points = points * np.sqrt(double_areas(lengths).sum() / area)
    mesh = metric.mesh
    return _layout(
        metric, cut, points, angle_defect(mesh.faces, corner_angles(lengths), mesh.is_boundary_vertex)
    )


def _embedded(metric: FlatMetric, embedding: Embedding, cut: Cut) -> Layout:
    mesh, points = metric.mesh, embedding.points
    corners = rows_of(points, cut.mesh.faces)
    doubles = np.abs(signed_double_areas(corners))
    if not doubles.sum() > 0:
        raise MetricError(
            f"all {plural(len(corners), 'triangle')} of the layout lie on a line: use method 'exact'"
        )
    before = double_areas(metric.lengths)
    factor = float(np.sqrt(before.sum() / doubles.sum()))
    curvature = layout_curvature(mesh, corners)
    return replace(
        _layout(metric, cut, points * factor, curvature),
        log_scale=vertex_log_scale(mesh, before, doubles * factor**2),
        target=np.where(mesh.is_boundary_vertex, curvature, metric.target),
        statistics=embedding.statistics,
        notes=(*metric.notes, *embedding.notes),
    )
