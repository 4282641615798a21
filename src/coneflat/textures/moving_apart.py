"""Small overlaps of a layout that are moved apart, so that they need no cuts."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from ..base import FloatArray, IntArray, mask_of
from ..errors import ConvergenceError, MetricError, OptionError
from ..geometry import signed_double_areas
from ..geometry.overlap import overlaps_of_mesh
from ..mesh import nearby
from ..mesh.connectivity import TriangleMesh
from ..optimise import PointConstraints, StretchEnergy, relax
from ..stages import Layout

# Most pairs of overlapping triangles that are moved apart: of 58 overlaps with up to 26,000 pairs this succeeded for 7,
# with up to 25. Where limbs overlap, triangles would have to be flipped.
MAX_PAIRS = 100
# Number of times that borders are moved apart; and the distance between them afterwards, relative to the mean length of
# their edges.
ROUNDS, GAP = 4, 0.1
# Rings of triangles around overlaps that move.
RINGS = 24


def moved_apart(layout: Layout, tolerance: float) -> Layout | None:
    """Return a layout in one chart whose overlaps are moved apart, or None if it has none or large ones, or it fails.

    A point of the border that is inside another triangle moves half of the way to the nearest place of the border where
    it is outside, and this place the other half. The points around them follow with the least energy.

    Args:
        layout: a layout without flipped triangles.
        tolerance: see `relax`.
    """
    pairs = overlaps_of_mesh(layout.mesh.edge_halfedges, layout.points[layout.corners]).pairs
    if not 0 < len(pairs) <= MAX_PAIRS:
        return None
    disk = layout.disk or TriangleMesh(np.zeros((len(layout.points), 3)), layout.corners)
    points, is_pinned = layout.points, np.zeros(len(layout.points), dtype=bool)
    for _ in range(ROUNDS):
        shifts = _shifts_apart(disk, points, pairs)
        is_pinned |= shifts.any(axis=1)
        is_near = nearby(disk.faces, mask_of(len(disk.faces), np.unique(pairs)), RINGS)
        pinned = PointConstraints(pinned=np.flatnonzero(is_pinned), places=(points + shifts)[is_pinned])
        with suppress(ConvergenceError, MetricError, OptionError):
            points = relax(
                disk,
                points,
                disk.faces,
                StretchEnergy(1.0),
                pinned,
                lengths=layout.lengths,
                free=is_near | is_pinned,
                tolerance=tolerance,
                to_scale=True,
            ).points
        pairs = overlaps_of_mesh(layout.mesh.edge_halfedges, points[layout.corners]).pairs
        if not len(pairs):
            return replace(layout, points=points)
    return None


def _shifts_apart(disk: TriangleMesh, points: FloatArray, pairs: IntArray) -> FloatArray:
    """Return (c, 2) the shifts of points that move overlapping borders apart.

    Args:
        disk, points: the layout.
        pairs: (k, 2) the pairs of triangles that overlap.
    """
    shifts = np.zeros_like(points)
    sides = disk.edge_halfedges[disk.is_boundary_edge, 0]
    starts, ends = disk.ends_of(sides[mask_of(len(disk.faces), np.unique(pairs))[sides // 3]])
    inside = _border_points_inside(disk, points, pairs)
    if not (len(starts) and len(inside)):
        return shifts
    along = points[ends] - points[starts]
    from_start = points[inside][:, None] - points[starts]
    share = np.clip((from_start * along).sum(axis=2) / (along**2).sum(axis=1), 0.0, 1.0)
    ways = share[..., None] * along - from_start
    # The border leads counterclockwise around the chart.
    is_left = along[:, 0] * from_start[..., 1] > along[:, 1] * from_start[..., 0]
    is_own = (inside[:, None] == starts) | (inside[:, None] == ends)
    distance = np.where(is_left & ~is_own, np.linalg.norm(ways, axis=2), np.inf)
    nearest = distance.argmin(axis=1)
    row = np.flatnonzero(np.isfinite(distance[np.arange(len(inside)), nearest]))
    nearest, depth = nearest[row], distance[row, nearest[row]]
    gap = GAP * np.linalg.norm(along, axis=1).mean()
    moves = ways[row, nearest] * ((depth + gap) / (2 * np.maximum(depth, np.finfo(float).tiny)))[:, None]
    # Of several moves of a point, the largest counts.
    order = np.argsort(depth, kind="stable")
    for k in order.tolist():
        shifts[[starts[nearest[k]], ends[nearest[k]]]] = -moves[k]
    shifts[inside[row[order]]] = moves[order]
    return shifts


def _border_points_inside(disk: TriangleMesh, points: FloatArray, pairs: IntArray) -> IntArray:
    """Return (p,) the points of the border inside a triangle that a triangle of theirs overlaps."""
    faces, overlapped = np.concatenate([pairs, pairs[:, ::-1]]).T
    corners = disk.faces[faces]
    around = points[disk.faces[overlapped]][:, None].repeat(3, axis=1)
    is_inside = disk.is_boundary_vertex[corners]
    for side in range(3):
        triangles = around.copy()
        triangles[:, :, side] = points[corners]
        areas = signed_double_areas(triangles.reshape(-1, 3, 2)).reshape(-1, 3)
        is_inside &= areas > 0
    return np.unique(corners[is_inside])
