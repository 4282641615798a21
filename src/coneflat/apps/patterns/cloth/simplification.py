"""Dense meshes with fewer triangles, near the surface that they had."""

from __future__ import annotations

import numpy as np

from .... import TriangleMesh
from ....base import FloatArray, IntArray
from ....geometry import coarse_mesh, surface_distances

# Numbers of triangles of a simplified mesh that are tried.
COUNTS = (6_000, 12_000, 24_000)
# Largest distance of a simplified mesh, relative to the diagonal of the box around the model.
MAX_DISTANCE = 0.01


def simplified(mesh: TriangleMesh, tolerance: float, copies: int = 1) -> tuple[TriangleMesh, FloatArray]:
    """Return a mesh with fewer triangles if it has many, and the distances between both surfaces.

    The distances are measured at the vertices and at the middles of the edges of both.

    Args:
        mesh: the mesh.
        tolerance: largest mean distance allowed; 0 for no change. If the smallest number of triangles within it is no
            less than half of those of the mesh, it remains.
        copies: number of equal meshes that share the triangles.
    """
    for count in (total // copies for total in COUNTS):
        if tolerance == 0 or len(mesh.faces) < 2 * count:
            break
        coarse = _simplified_parts(mesh, count)
        distances = _distances(mesh, coarse)
        is_near = distances.max() <= MAX_DISTANCE * np.linalg.norm(np.ptp(mesh.vertices, axis=0))
        if is_near and distances.mean() <= tolerance:
            return coarse, distances
    return mesh, np.zeros(1)


def _simplified_parts(mesh: TriangleMesh, count: int) -> TriangleMesh:
    """Return a mesh with about a number of triangles in all components together; their extents remain."""
    vertices, faces, start = list[FloatArray](), list[IntArray](), 0
    for part, _, _ in mesh.split_components():
        share = round(count * len(part.faces) / len(mesh.faces))
        extremes = np.concatenate([part.vertices.argmin(axis=0), part.vertices.argmax(axis=0)])
        coarse = coarse_mesh(part, max(share, 4), np.unique(extremes)).mesh
        vertices.append(coarse.vertices)
        faces.append(coarse.faces + start)
        start += len(coarse.vertices)
    return TriangleMesh(np.concatenate(vertices), np.concatenate(faces))


def _distances(first: TriangleMesh, second: TriangleMesh) -> FloatArray:
    """Return the distances of the vertices and middles of edges of each mesh from the other one."""
    parts = [
        surface_distances(goal.vertices, goal.faces, _samples(mesh))
        for mesh, goal in ((first, second), (second, first))
    ]
    return np.concatenate(parts)


def _samples(mesh: TriangleMesh) -> FloatArray:
    return np.concatenate([mesh.vertices, mesh.vertices[mesh.edges].mean(axis=1)])
