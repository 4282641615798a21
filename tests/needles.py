"""Meshes with caps and needles: triangles that are much longer than high."""

from __future__ import annotations

import numpy as np

from coneflat.mesh.connectivity import TriangleMesh


def with_caps(vertices, faces, height, count, rng):
    """Return a mesh with vertices placed beside edges, at a height relative to their length."""
    vertices, faces = list(vertices), faces.tolist()
    for f in rng.permutation(len(faces))[:count].tolist():
        a, b, c = faces[f]
        across = (vertices[c] - vertices[a] + vertices[c] - vertices[b]) / 2
        along = vertices[b] - vertices[a]
        across -= along * (across @ along) / (along @ along)
        foot = vertices[a] + rng.uniform(0.2, 0.8) * along
        apex = len(vertices)
        vertices.append(foot + height * np.linalg.norm(along) * across / np.linalg.norm(across))
        faces[f] = [a, b, apex]
        faces += [[b, c, apex], [c, a, apex]]
    return np.array(vertices), np.array(faces)


def with_needles(vertices, faces, height, count, rng):
    """Return a mesh with edges split at a relative distance from one of their ends."""
    vertices, faces = list(vertices), faces.tolist()
    mesh = TriangleMesh(np.array(vertices), np.array(faces))
    split: set[int] = set()
    for e in rng.permutation(len(mesh.edges)).tolist():
        sides = mesh.edge_halfedges[e]
        beside = {int(side) // 3 for side in sides if side >= 0}
        if beside & split or len(split) >= 2 * count:
            continue
        split |= beside
        start, end = mesh.edges[e].tolist()
        middle = len(vertices)
        vertices.append(vertices[start] + height * (vertices[end] - vertices[start]))
        for f in beside:
            faces.append([middle if v == start else v for v in faces[f]])
            faces[f] = [middle if v == end else v for v in faces[f]]
    return np.array(vertices), np.array(faces)
