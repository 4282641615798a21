"""Holes of a mesh, the boundary loops of each component but the longest one, and their filling with triangles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..base.arrays import FloatArray, IntArray
from .connectivity import TriangleMesh
from .ties import argmax_tied, mesh_tie_key, tie_key


def find_holes(mesh: TriangleMesh, lengths: FloatArray | None = None) -> list[IntArray]:
    """Return for each hole (b,) its half-edges in order, the mesh on the left.

    A walk starts at the vertex with the largest tie key, and holes are in the order of these keys.

    Args:
        mesh: the mesh; its boundary loops share no vertex.
        lengths: (m, 3) side lengths, by which the longest loop of each component is found; None for distances of
            vertices.
    """
    walks = mesh.boundary_walks()
    if len(walks) <= 1:
        return []
    key = _tie_key(mesh)
    walks = [np.roll(walk, -int(np.argmax(key[mesh.tails[walk]]))) for walk in walks]
    starts = mesh.tails[[walk[0] for walk in walks]]
    size, component = np.array([_length(mesh, walk, lengths) for walk in walks]), mesh.components[1][starts]
    is_hole = np.ones(len(walks), dtype=bool)
    for label in np.unique(component):
        loops = np.flatnonzero(component == label)
        is_hole[loops[argmax_tied(size[loops], key[starts[loops]])]] = False
    return [walks[i] for i in np.argsort(-key[starts], kind="stable").tolist() if is_hole[i]]


def _tie_key(mesh: TriangleMesh) -> FloatArray:
    """Return the tie key (n,) of a mesh in space or in the plane."""
    dimension = mesh.vertices.shape[1]
    return mesh_tie_key(mesh) if dimension > 2 else tie_key(np.pad(mesh.vertices, ((0, 0), (0, 1))))


def _length(mesh: TriangleMesh, walk: IntArray, lengths: FloatArray | None) -> float:
    if lengths is not None:
        return float(lengths.ravel()[walk].sum())
    sides = mesh.vertices[mesh.heads[walk]] - mesh.vertices[mesh.tails[walk]]
    return float(np.linalg.norm(sides, axis=1).sum())


def with_fans(mesh: TriangleMesh, loops: Sequence[IntArray]) -> TriangleMesh:
    """Return a mesh with holes filled by triangles around the means of their vertices, which come last.

    Args:
        mesh: the mesh.
        loops: for each hole its vertices in order, the mesh on the left.
    """
    n = len(mesh.vertices)
    centres = [mesh.vertices[loop].mean(axis=0, keepdims=True) for loop in loops]
    fans = [
        np.stack([np.roll(loop, -1), loop, np.full(len(loop), n + k)], axis=1) for k, loop in enumerate(loops)
    ]
    return TriangleMesh(np.concatenate([mesh.vertices, *centres]), np.concatenate([mesh.faces, *fans]))
