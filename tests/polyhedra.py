"""Polyhedra, and surfaces of revolution, as triangle meshes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.spatial import ConvexHull
from shapes import subdivide

from coneflat import TriangleMesh, check_mesh

GOLDEN = (1 + 5**0.5) / 2


def hull(points) -> TriangleMesh:
    """The convex hull of points, all of which are corners."""
    points = np.asarray(points, dtype=float)
    faces = ConvexHull(points).simplices.astype(np.int64)
    a, b, c = (points[faces[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a - points.mean(axis=0)) < 0
    faces[inward] = faces[inward][:, ::-1]
    return check_mesh(points, faces).mesh


def tetrahedron() -> TriangleMesh:
    return hull([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])


def cube() -> TriangleMesh:
    return hull([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])


def octahedron() -> TriangleMesh:
    return hull(np.concatenate([np.eye(3), -np.eye(3)]))


def icosahedron() -> TriangleMesh:
    corners = np.array([[0, x, y * GOLDEN] for x in (1, -1) for y in (1, -1)])
    return hull(np.concatenate([np.roll(corners, shift, axis=1) for shift in range(3)]))


def dodecahedron() -> TriangleMesh:
    mesh = icosahedron()
    return hull(mesh.vertices[mesh.faces].mean(axis=1))


def prism(sides: int) -> TriangleMesh:
    angles = 2 * np.pi * np.arange(sides) / sides
    return hull([[np.cos(angle), np.sin(angle), z] for angle in angles for z in (0, 1.5)])


def box_on_box(height: float = 2.0) -> TriangleMesh:
    """A box with a narrow one on the middle of its lid, so that the lid is a ring."""
    ring = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float)
    levels = [(3, 0), (3, 2), (1, 2), (1, 2 + height)]
    vertices = np.concatenate([np.column_stack([size * ring, np.full(4, z)]) for size, z in levels])
    faces = [[0, 2, 1], [0, 3, 2], [12, 13, 14], [12, 14, 15]]
    for level in range(3):
        for i in range(4):
            p, q = 4 * level + i, 4 * level + (i + 1) % 4
            faces += [[p, q, q + 4], [p, q + 4, p + 4]]
    return check_mesh(vertices, np.array(faces)).mesh


def turned(radii, heights, around: int = 24) -> TriangleMesh:
    """The surface of revolution of a profile about z; radii of 0 at its ends are poles."""
    angles = 2 * np.pi * np.arange(around) / around
    vertices, rings = [], []
    for radius, height in zip(radii, heights, strict=True):
        count = around if radius > 0 else 1
        rings.append(len(vertices) + np.arange(around) % count)
        vertices += [[radius * np.cos(a), radius * np.sin(a), height] for a in angles[:count]]
    faces = []
    for lower, upper in pairwise(rings):
        for p, q, r, s in zip(lower, np.roll(lower, -1), np.roll(upper, -1), upper, strict=True):
            faces += [face for face in ([p, q, r], [p, r, s]) if len(set(face)) == 3]
    return check_mesh(np.array(vertices), np.array(faces)).mesh


def uv_sphere(around: int = 24, rings: int = 12) -> TriangleMesh:
    angles = np.linspace(-np.pi / 2, np.pi / 2, rings + 1)
    radii = np.cos(angles)
    radii[[0, -1]] = 0
    return turned(radii, np.sin(angles), around)


def icosphere(rounds: int = 3) -> TriangleMesh:
    mesh = icosahedron()
    vertices, faces = mesh.vertices, mesh.faces
    for _ in range(rounds):
        vertices, faces = subdivide(vertices, faces)
    return check_mesh(vertices / np.linalg.norm(vertices, axis=1, keepdims=True), faces).mesh
