"""Holes of a mesh filled with triangles whose shape is that of the missing surface, as far as the border tells."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..base.arrays import BoolArray, FloatArray, IntArray, dots, mask_of
from ..mesh.connectivity import NEXT, PREVIOUS, TriangleMesh, are_among
from ..mesh.holes import with_fans
from .opening import mollify
from .triangles import face_normals
from .triangulate import triangulate

# Area relative to that of its polygon down to which a triangle counts as not reversed.
ROUNDING = 1e-9


def filled(
    mesh: TriangleMesh, lengths: FloatArray, loops: Sequence[IntArray]
) -> tuple[TriangleMesh, FloatArray]:
    """Return a mesh with filled holes, and (m + f, 3) side lengths with which every triangle has area.

    A hole is triangulated as a polygon, so that a flat surface stays flat. Where this would cover a part twice, or use
    an edge of the mesh again, the triangles are a fan around a vertex in the middle.

    Args:
        mesh: the mesh; its n vertices and m faces come first in the result.
        lengths: (m, 3) its side lengths, which are preserved up to what opens triangles without area.
        loops: for each hole its vertices in order, the mesh on the left.
    """
    polygons = [loop[::-1] for loop in loops]
    offsets = np.cumsum([0, *map(len, polygons)])
    triangles, _ = triangulate(mesh.vertices, np.concatenate(polygons), offsets)
    hole = np.repeat(np.arange(len(loops)), np.diff(offsets) - 2)
    is_unfit = np.bincount(hole[_are_unfit(mesh, triangles, hole, polygons)], minlength=len(loops)) > 0
    with_polygons = TriangleMesh(mesh.vertices, np.concatenate([mesh.faces, triangles[~is_unfit[hole]]]))
    filled_mesh = with_fans(with_polygons, [loops[i] for i in np.flatnonzero(is_unfit).tolist()])
    ends = filled_mesh.vertices[filled_mesh.edges]
    of_edge = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    of_edge[filled_mesh.halfedge_edges[: lengths.size]] = lengths.ravel()
    sides: FloatArray = of_edge[filled_mesh.halfedge_edges].reshape(-1, 3)
    return filled_mesh, mollify(sides, filled_mesh)[0]


def _are_unfit(
    mesh: TriangleMesh, triangles: IntArray, hole: IntArray, polygons: Sequence[IntArray]
) -> BoolArray:
    """Return (f,) whether triangles of holes are reversed in the plane of their polygon, or have an edge of the mesh.

    Args:
        mesh: the mesh.
        triangles: (f, 3) vertices.
        hole: (f,) the hole of each.
        polygons: for each hole its vertices in the order of the triangles.
    """
    normals = face_normals(mesh.vertices, triangles)
    totals = np.zeros((len(polygons), 3))
    np.add.at(totals, hole, normals)
    is_unfit = ~(dots(normals, totals[hole]) > -ROUNDING * dots(totals, totals)[hole])
    sides = np.stack([triangles[:, NEXT].ravel(), triangles[:, PREVIOUS].ravel()], axis=1)
    borders = np.concatenate([np.stack([polygon, np.roll(polygon, -1)], axis=1) for polygon in polygons])
    on_border = mask_of(len(mesh.vertices), borders)
    chords = mesh.edges[on_border[mesh.edges[:, 0]] & on_border[mesh.edges[:, 1]]]
    is_doubled = are_among(sides, chords) & ~are_among(sides, borders)
    return np.asarray(is_unfit | is_doubled.reshape(-1, 3).any(axis=1))
