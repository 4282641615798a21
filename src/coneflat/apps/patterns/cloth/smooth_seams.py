"""Seams moved along the surface so that they become smooth curves, the same for both of their sides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_matrix

from ....base import BoolArray, FloatArray, IntArray
from ....geometry import TriangleTree, dihedral_angles
from ..pieces.cut_surface import CutSurface

# Rounds in which every vertex moves half of the way to the middle between its neighbours on the seam.
ROUNDS = 20
# Times that vertices go back half of the way where the surface is too far away, then all of it, with those around.
HALVINGS = 16
# Angle between the normals of two triangles from which on their edge is a crease, radians.
CREASE = np.pi / 4
# Smallest area of a triangle whose corners moved, relative to the area it had.
MIN_AREA = 0.2
# Smallest cosine of the angle between the normals of a triangle before and after.
MIN_COSINE = 0.8


def with_smooth_seams(surface: CutSurface, tolerance: float, required: IntArray | None = None) -> CutSurface:
    """Return a cut surface whose seams are smoother; ends, forks, creases, the border and required seams stay.

    The vertices of seams slide along the surface, so the two sides of a seam remain equal. Triangles keep their places
    in the plane, and must be laid out again.

    Args:
        surface: the surface.
        tolerance: largest distance between the surfaces before and after, measured at the vertices and at the middles
            of the edges of both.
        required: (k, 2) the vertices of edges that stay where they are; None for none.
    """
    mesh = surface.mesh
    along = mesh.edges[surface.seams]
    is_border = mesh.is_boundary_vertex
    degree = np.bincount(along.ravel(), minlength=len(mesh.vertices))
    is_movable = (degree == 2) & ~is_border
    is_movable[along[np.abs(dihedral_angles(mesh)[surface.seams]) > CREASE]] = False
    if required is not None:
        is_movable[required] = False
    if tolerance == 0 or not is_movable.any():
        return surface
    before, tree = mesh.vertices, TriangleTree(mesh.vertices, mesh.faces)
    neighbours = _mean_of_neighbours(along, len(before))
    vertices = before
    for _ in range(ROUNDS):
        middles = np.where(is_movable[:, None], (vertices + neighbours @ vertices) / 2, vertices)
        moved = vertices.copy()
        moved[is_movable] = _nearest(tree, before, mesh.faces, middles[is_movable])
        corners = np.unique(mesh.faces[_is_bad(before, moved, mesh.faces)])
        moved[corners] = vertices[corners]
        vertices = moved
    surface_after = replace(surface, mesh=mesh.moved_to(vertices))
    return _near_enough(surface, surface_after, tree, tolerance)


def _mean_of_neighbours(along: IntArray, count: int) -> csr_matrix:
    """Return (n, n) the matrix that averages the two neighbours of each vertex on a seam, edges `along` (k, 2)."""
    rows, columns = np.concatenate([along, along[:, ::-1]]).T
    return csr_matrix((np.full(len(rows), 0.5), (rows, columns)), shape=(count, count))


def _nearest(tree: TriangleTree, vertices: FloatArray, faces: IntArray, points: FloatArray) -> FloatArray:
    on, weights = tree.nearest(points)
    return np.einsum("qi,qix->qx", weights, vertices[faces[on]])


def _is_bad(before: FloatArray, after: FloatArray, faces: IntArray) -> BoolArray:
    """Return (m,) triangles that lost most of their area, or turned."""
    normals = [
        np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        for corner in (before[faces], after[faces])
    ]
    sizes = [np.linalg.norm(normal, axis=1) for normal in normals]
    cosines = (normals[0] * normals[1]).sum(axis=1)
    return (sizes[1] < MIN_AREA * sizes[0]) | (cosines < MIN_COSINE * sizes[0] * sizes[1])


def _near_enough(surface: CutSurface, moved: CutSurface, tree: TriangleTree, tolerance: float) -> CutSurface:
    """Return the moved surface, with vertices nearer to their old places where it is too far away."""
    faces, before = surface.mesh.faces, surface.mesh.vertices
    vertices = moved.mesh.vertices
    for halving in range(HALVINGS):
        is_far = _is_far(before, vertices, faces, tolerance, tree) | _is_bad(before, vertices, faces)
        if not is_far.any():
            return replace(moved, mesh=surface.mesh.moved_to(vertices))
        corners = np.unique(faces[is_far])
        vertices = vertices.copy()
        is_last = halving >= HALVINGS // 2
        halfway = (vertices[corners] + before[corners]) / 2
        vertices[corners] = before[corners] if is_last else _nearest(tree, before, faces, halfway)
    return surface


def _is_far(
    before: FloatArray, after: FloatArray, faces: IntArray, tolerance: float, tree: TriangleTree
) -> BoolArray:
    """Return (m,) triangles that are farther from the surface before than the tolerance, or that left a part of it."""
    middles = ((after[faces] + after[faces[:, [1, 2, 0]]]) / 2).reshape(-1, 3)
    to_before = np.linalg.norm(_nearest(tree, before, faces, middles) - middles, axis=1)
    samples = np.concatenate([before[faces], (before[faces] + before[faces[:, [1, 2, 0]]]) / 2], axis=1)
    samples = samples.reshape(-1, 3)
    to_after = np.linalg.norm(_nearest(TriangleTree(after, faces), after, faces, samples) - samples, axis=1)
    distances = np.concatenate([to_before.reshape(-1, 3), to_after.reshape(-1, 6)], axis=1)
    return distances.max(axis=1) > tolerance
