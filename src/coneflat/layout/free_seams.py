"""Layouts without inverted triangles, where seams with equal sides leave no room for all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix, diags

from ..base.arrays import FloatArray, IntArray
from ..base.text import plural
from ..geometry.intrinsic import halfedge_twins
from ..geometry.planar import heights, sides_between, signed_double_areas
from ..geometry.straight import FlatTriangles
from ..linalg.factors import SuperLUFactor
from ..mesh.connectivity import TriangleMesh
from ..stages import Layout
from .patches import DEGENERATE_HEIGHT
from .relax import StretchEnergy, relax
from .relax.relax import rest_sides
from .relax_layouts import LayoutGroup
from .unfold import unfold
from .untangle import MAX_RINGS, are_low, untangle


def free_seams(
    layout: Layout, weights: FloatArray | None, names: IntArray, stretch: float, quantum: float | None
) -> Layout:
    """Return a layout whose inverted triangles are flipped at the expense of the seams near them.

    Points move in the plane, those on the two sides of a seam independently, and are relaxed there. The lengths of the
    sides and the angles around their vertices, cones among them, are what comes out. Where triangles stay inverted, the
    chart is embedded anew as a disk and relaxed. A prescribed boundary stays, and so do seams that turn by quanta.

    Args:
        layout: in one chart.
        weights: (n,) importance of the vertices, or None.
        names: (n,) the user's number of each vertex.
        stretch: from angles, 0, to areas, 1, for relaxing.
        quantum: seams turn by multiples of it, so that nothing is changed; None for any rotation.

    Notes:
        W. T. Tutte, "How to draw a graph", 1963: with every inner point at the mean of its neighbours and the border on
        a convex curve no triangle is inverted. Relaxed from there, a layout is much worse than from one of a flat
        metric.
    """
    flat = _in_the_plane(layout.points, layout.corners)
    if quantum is not None or not are_low(flat.sides, DEGENERATE_HEIGHT):
        return layout
    disk = TriangleMesh(np.zeros((len(layout.points), 3)), layout.corners)
    vertex = np.empty(len(layout.points), dtype=np.int64)
    vertex[layout.corners] = layout.mesh.faces
    held = layout.is_held[vertex]
    # The angle at a vertex of a prescribed boundary stays if the seams that end there do, which they should.
    border = disk.edges[disk.is_boundary_edge]
    beside = held.copy()
    beside[border[held[border].any(axis=1)]] = True
    # Any angle will do on the border of the chart.
    angles = np.where(disk.is_boundary_vertex, np.nan, 2 * np.pi)
    flat = replace(flat, twin=halfedge_twins(disk))
    untangled = untangle(
        flat,
        disk.faces,
        angles,
        disk.is_boundary_vertex,
        (beside, held),
        rest_sides(layout.lengths),
        2 * MAX_RINGS,
    )
    points, is_free = unfold(untangled.flat, disk.faces), np.zeros(len(vertex), dtype=bool)
    is_free[untangled.moved] = True
    but = "the sides of seams near them are unequal"
    if len(untangled.left) and not held.any() and disk.boundary_loops[0] == 1:
        embedded = embedded_disk(disk, float(np.abs(signed_double_areas(points[disk.faces])).sum()))
        if not are_low(_in_the_plane(embedded, disk.faces).sides, DEGENERATE_HEIGHT):
            points, is_free, but = embedded, ~held, "no seam or cone is exact"
    if not is_free.any():
        return layout
    group = LayoutGroup([layout], [weights])
    points = relax(
        disk,
        points,
        disk.faces,
        StretchEnergy(stretch),
        lengths=group.lengths_as_laid_out,
        weights=group.weights,
        free=is_free,
    ).points
    was_free = np.zeros(len(layout.mesh.vertices), dtype=bool)
    was_free[vertex[is_free]] = True
    found = group.described(points, was_free)[0]
    before, after = (
        heights(sides_between(each[disk.faces])) > DEGENERATE_HEIGHT for each in (layout.points, points)
    )
    turned = np.flatnonzero(after & ~before)
    if not len(turned):
        return layout
    name = names[layout.mesh.faces[turned[0], 0]]
    return replace(
        found,
        notes=(
            *found.notes,
            f"{plural(len(turned), 'triangle')} had no room between seams with equal sides, as at vertex "
            f"{name}: they are positively oriented, but {but}.",
        ),
    )


def _in_the_plane(points: FloatArray, corners: IntArray) -> FlatTriangles:
    """Return triangles of the plane, all in one frame, without their neighbours."""
    sides = sides_between(points[corners]).ravel()
    return FlatTriangles(sides, np.ones_like(sides), np.full(len(sides), -1))


def embedded_disk(disk: TriangleMesh, double_area: float) -> FloatArray:
    """Return (c, 2) points of a disk, its border on a circle and every inner point at the mean of its neighbours."""
    border = disk.tails[disk.boundary_walk()]
    turn = 2 * np.pi * np.arange(len(border)) / len(border)
    points = np.zeros((len(disk.vertices), 2))
    points[border] = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    one, two = disk.edges.T
    joins = coo_matrix((np.ones(len(one)), (one, two)), shape=(len(points), len(points)))
    laplacian = csc_matrix(diags(np.bincount(disk.edges.ravel()).astype(float)) - joins - joins.T)
    inside = np.flatnonzero(~disk.is_boundary_vertex)
    if len(inside):
        rows = laplacian[inside]
        points[inside] = SuperLUFactor(csc_matrix(rows[:, inside])).solve(-(rows[:, border] @ points[border]))
    return points * np.sqrt(double_area / np.abs(signed_double_areas(points[disk.faces])).sum())
