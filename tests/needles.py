"""Meshes with caps and needles: triangles that are much longer than high."""

from __future__ import annotations

import numpy as np

from coneflat.mesh.connectivity import TriangleMesh


def with_caps(
    vertices: np.ndarray, faces: np.ndarray, height: float, count: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return a mesh with vertices placed beside edges, at a height relative to their length."""
    points, triangles = list(vertices), faces.tolist()
    for f in rng.permutation(len(triangles))[:count].tolist():
        a, b, c = triangles[f]
        across = (points[c] - points[a] + points[c] - points[b]) / 2
        along = points[b] - points[a]
        across -= along * (across @ along) / (along @ along)
        foot = points[a] + rng.uniform(0.2, 0.8) * along
        apex = len(points)
        points.append(foot + height * np.linalg.norm(along) * across / np.linalg.norm(across))
        triangles[f] = [a, b, apex]
        triangles += [[b, c, apex], [c, a, apex]]
    return np.array(points), np.array(triangles)


def with_needles(
    vertices: np.ndarray, faces: np.ndarray, height: float, count: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return a mesh with edges split at a relative distance from one of their ends."""
    mesh = TriangleMesh(vertices, faces)
    points, triangles = list(vertices), faces.tolist()
    split: set[int] = set()
    for e in rng.permutation(len(mesh.edges)).tolist():
        sides = mesh.edge_halfedges[e]
        beside = {int(side) // 3 for side in sides if side >= 0}
        if beside & split or len(split) >= 2 * count:
            continue
        split |= beside
        start, end = mesh.edges[e].tolist()
        middle = len(points)
        points.append(points[start] + height * (points[end] - points[start]))
        for f in beside:
            triangles.append([middle if v == start else v for v in triangles[f]])
            triangles[f] = [middle if v == end else v for v in triangles[f]]
    return np.array(points), np.array(triangles)
