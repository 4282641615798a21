"""Spheres of random points, and curvatures for them."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from coneflat import TriangleMesh
from coneflat.geometry import edge_lengths


def random_sphere(count, seed):
    points = np.random.default_rng(seed).normal(size=(count, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    faces = ConvexHull(points).simplices.astype(np.int64)
    a, b, c = (points[faces[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a) < 0
    faces[inward] = faces[inward][:, ::-1]
    return TriangleMesh(points, faces)


def random_curvatures(count, total, rng, low=-6 * np.pi, high=1.9 * np.pi):
    values = rng.uniform(low, high, count)
    for _ in range(1000):
        values = np.clip(values + (total - values.sum()) / count, low, high)
    return values


def lengths_of(mesh):
    return edge_lengths(mesh.vertices, mesh.faces)


def cones_on(mesh, curvatures, seed=0):
    """Targets with the given curvatures at random inner vertices."""
    inside = np.flatnonzero(~mesh.is_boundary_vertex)
    target = np.zeros(len(mesh.vertices))
    target[np.random.default_rng(seed).choice(inside, len(curvatures), replace=False)] = curvatures
    return target
