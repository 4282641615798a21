"""Pieces that overlap themselves, divided by the shortest cuts."""

from __future__ import annotations

import numpy as np

from .... import TriangleMesh
from ....atlas import injective_charts
from ....base import IntArray
from ....mesh import point_seams
from .cut_surface import CutSurface


def without_overlaps(surface: CutSurface) -> CutSurface:
    """Return a cut surface of which no piece overlaps itself; the same one if none does."""
    pairs = surface.overlaps()
    if not len(pairs):
        return surface
    places, seams = surface.places.copy(), [surface.seams]
    for piece in np.unique(surface.pieces[pairs[:, 0]]).tolist():
        faces = surface.triangles_of_pieces[piece]
        indices, corners = np.unique(surface.corners[faces], return_inverse=True)
        points = surface.points[indices]
        mesh = TriangleMesh(np.pad(points, ((0, 0), (0, 1))), corners.reshape(-1, 3))
        edges = _edges_of_surface(surface, faces, mesh)
        charts = injective_charts(mesh, points, mesh.faces, surface.edge_lengths[edges])
        places[faces] = charts.points[charts.corners]
        seams.append(edges[point_seams(mesh, charts.corners)])
    return surface.cut_along(np.unique(np.concatenate(seams)), places)


def _edges_of_surface(surface: CutSurface, faces: IntArray, piece: TriangleMesh) -> IntArray:
    """Return the edge of the surface of each edge of a piece, which consists of some of its faces."""
    sides = piece.edge_halfedges[:, 0]
    return surface.mesh.halfedge_edges[3 * faces[sides // 3] + sides % 3]
