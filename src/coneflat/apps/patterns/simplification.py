"""Dense meshes with fewer triangles, near the surface that they had."""

from __future__ import annotations

import numpy as np

from ... import TriangleMesh
from ...base import FloatArray, IntArray
from ...geometry import coarse_mesh, surface_distances

# Numbers of triangles of a simplified mesh that are tried; one with fewer than LEAST_TRIANGLES is left as it is.
COUNTS, LEAST_TRIANGLES = (6_000, 12_000, 24_000), 10_000


def simplified(mesh: TriangleMesh, tolerance: float) -> tuple[TriangleMesh, float]:
    """Return a mesh with fewer triangles if it has many, and the largest distance between both surfaces.

    Args:
        mesh: the mesh.
        tolerance: largest distance allowed, measured at the vertices and at the middles of the edges of both; 0 for no
            change. If the smallest number of triangles within it is no less than half of those of the mesh, it remains.
    """
    for count in COUNTS:
        if tolerance == 0 or len(mesh.faces) < max(LEAST_TRIANGLES, 2 * count):
            break
        coarse = _simplified_parts(mesh, count)
        distance = _largest_distance(mesh, coarse)
        if distance <= tolerance:
            return coarse, distance
    return mesh, 0.0


def _simplified_parts(mesh: TriangleMesh, count: int) -> TriangleMesh:
    """Return a mesh with about a number of triangles in all components together."""
    vertices, faces, start = list[FloatArray](), list[IntArray](), 0
    for part, _, _ in mesh.split_components():
        share = round(count * len(part.faces) / len(mesh.faces))
        coarse = coarse_mesh(part, max(share, 4)).mesh
        vertices.append(coarse.vertices)
        faces.append(coarse.faces + start)
        start += len(coarse.vertices)
    return TriangleMesh(np.concatenate(vertices), np.concatenate(faces))


def _largest_distance(first: TriangleMesh, second: TriangleMesh) -> float:
    """Return the largest distance of the vertices and middles of edges of each mesh from the other one."""
    return max(
        float(surface_distances(goal.vertices, goal.faces, _samples(mesh)).max())
        for mesh, goal in ((first, second), (second, first))
    )


def _samples(mesh: TriangleMesh) -> FloatArray:
    return np.concatenate([mesh.vertices, mesh.vertices[mesh.edges].mean(axis=1)])
