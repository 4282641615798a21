"""Layouts with free seams: the two sides of a seam need not be equal, so that triangles are distorted least."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ... import TriangleMesh
from ...base import BoolArray, ComplexArray, FloatArray, IntArray
from ...geometry import (
    as_complex,
    as_pairs,
    cotangent_laplacian,
    cotangents,
    double_areas,
    layout_curvature,
    signed_double_areas,
    vertex_log_scale,
)
from ...layout import StretchEnergy, relax
from ...linalg import factorize
from ...mesh import label_faces, open_along
from ...stages import Layout
from .options import ISOMETRIC


def freed(layout: Layout, free: BoolArray | None = None, tolerance: float = 1e-3) -> tuple[Layout, float]:
    """Return a layout with the least symmetric Dirichlet energy, and this energy, averaged by area.

    The sides of seams move independently, and no triangle is flipped. If the given layout has flipped triangles, the
    minimisation starts from an embedding of W. T. Tutte, "How to draw a graph", 1963.

    Args:
        layout: a layout in any number of charts; in one chart if triangles are flipped.
        free: (c,) the points that move; None for all.
    """
    mesh, areas = layout.mesh, double_areas(layout.lengths) / 2
    disk = layout.disk or TriangleMesh(np.zeros((len(layout.points), 3)), layout.corners)
    points = layout.points
    if not (signed_double_areas(points[layout.corners]) > 0).all():
        points = as_pairs(_tutte_embedding(disk))
    energy, sides = StretchEnergy(1.0), layout.lengths
    found = relax(disk, points, layout.corners, energy, lengths=sides, free=free, tolerance=tolerance)
    if free is not None and not free.all():
        free_layout = replace(layout, points=found.points)
        return free_layout, float(triangle_energies(free_layout).sum())
    # The relaxation keeps the lengths relative to the area at its start.
    start = np.abs(signed_double_areas(points[layout.corners])).sum() / 2
    points = found.points * np.sqrt(areas.sum() / start)
    flat = np.abs(signed_double_areas(points[layout.corners])) / 2
    curvature = layout_curvature(mesh, points[layout.corners])
    found_layout = replace(
        layout,
        points=points,
        log_scale=vertex_log_scale(mesh, areas, flat),
        target=curvature,
        curvature=curvature,
        is_open=np.ones(len(mesh.vertices), dtype=bool),
        is_fixed=np.zeros(len(mesh.vertices), dtype=bool),
    )
    return found_layout, ISOMETRIC * found.energy


def _tutte_embedding(disk: TriangleMesh) -> ComplexArray:
    """Return (n,) the vertices of a disk in the plane: the boundary on a circle, others at the mean of neighbours."""
    count, loop = len(disk.vertices), disk.heads[disk.boundary_walk()]
    points = np.zeros(count, dtype=np.complex128)
    points[loop] = np.exp(2j * np.pi * np.arange(len(loop)) / len(loop))
    inner = np.flatnonzero(~disk.is_boundary_vertex)
    if len(inner):
        laplacian = cotangent_laplacian(disk.faces, np.ones(disk.faces.shape), count)[inner]
        right = as_pairs(-(laplacian @ points))
        points[inner] = as_complex(factorize(laplacian[:, inner]).solve(right))
    return points


def recut(layout: Layout, seams: IntArray) -> Layout:
    """Return a layout that is cut along given edges (k,), all its present seams among them."""
    cut = open_along(layout.mesh, seams)
    points = np.empty((len(cut.origin), 2))
    points[cut.mesh.faces] = layout.points[layout.corners]
    return replace(
        layout,
        points=points,
        corners=cut.mesh.faces,
        disk=cut.mesh,
        seams=layout.mesh.edges[seams],
        chart=label_faces(cut.mesh.faces, len(points))[1],
    )


def seam_edges(layout: Layout) -> IntArray:
    """Return (k,) the edges of the seams of a layout."""
    mesh, count = layout.mesh, len(layout.mesh.vertices)
    keys = np.sort(mesh.edges, axis=1) @ [count, 1]
    return np.flatnonzero(np.isin(keys, np.sort(layout.seams, axis=1) @ [count, 1]))


def triangle_energies(layout: Layout) -> FloatArray:
    """Return (m,) the symmetric Dirichlet energy of each triangle, multiplied by its share of the area."""
    places = layout.points[layout.corners]
    sides = places[:, [2, 0, 1]] - places[:, [1, 2, 0]]
    areas = double_areas(layout.lengths) / 2
    squares = (cotangents(layout.lengths) * (sides**2).sum(axis=2)).sum(axis=1) / (2 * areas)
    ratio = signed_double_areas(places) / (2 * areas)
    return squares * (1 + ratio**-2) * areas / areas.sum()
