"""Meshes with metrics that are not their own."""

from __future__ import annotations

import numpy as np

from coneflat import TriangleMesh, edge_lengths
from coneflat.flat.exact.metric import exact_metric


def noisy(shape, amount, seed=0):
    vertices, faces = shape
    return vertices + amount * np.random.default_rng(seed).normal(size=vertices.shape), faces


def with_scale(shape, spread, seed=0):
    """A mesh, and its metric with a random log scale: the larger its spread, the more flips."""
    mesh = TriangleMesh(*shape)
    n = len(mesh.vertices)
    phi = spread * np.random.default_rng(seed).normal(size=n)
    lengths = edge_lengths(mesh.vertices, mesh.faces)
    everywhere = np.ones(n, dtype=bool)
    return mesh, exact_metric(
        mesh, lengths, np.zeros(n), fixed=everywhere, fixed_log_scale=phi, delaunay=False
    )


def with_cones(shape, count=6, seed=0, **options):
    """A mesh with its cones, all of one curvature, and the metric."""
    mesh = TriangleMesh(*shape)
    inside = np.flatnonzero(~mesh.is_boundary_vertex)
    cones = np.random.default_rng(seed).choice(inside, count, replace=False)
    target = np.zeros(len(mesh.vertices))
    target[cones] = 2 * np.pi * mesh.euler_characteristic / count
    lengths = edge_lengths(mesh.vertices, mesh.faces)
    return mesh, cones, exact_metric(mesh, lengths, target, **{"delaunay": False, **options})
