"""Quads made squarer by moving their vertices on the surface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from ...base import BoolArray, FloatArray, IntArray, dots
from ...errors import OptionError
from ...mesh import NEXT
from .features import edge_indices
from .nearest import Stars, slide_near
from .options import ROUNDS
from .quad_mesh import QuadMesh, least_jacobians
from .untangle import lift_worst

# Scaled Jacobian below which no quad goes that was above, nor any deeper that was below.
LEAST = 0.5
# Radians: edges of the surface that bend more are sharp, and quad vertices on them stay.
SHARP = np.deg2rad(40.0)


def smooth_quads(quads: QuadMesh, rounds: int = ROUNDS, features: ArrayLike = ()) -> QuadMesh:
    """Return a quad mesh with squarer quads, whose vertices have moved on the surface.

    Each quad asks its corners to go to the nearest square (S. Bouaziz, M. Deuss, Y. Schwartzburg, T. Weise, M. Pauly,
    "Shape-Up: shaping discrete geometry with projections", 2012, Section 4). Each vertex goes to the mean of what its
    quads ask for, and from there to the nearest point of the surface nearby. A quad whose scaled Jacobian would fall
    too low keeps its corners where they were. Quads that are bad in the end are made better by moving single vertices.
    Vertices of the boundary stay, and those on edges of the surface that bend by 40 degrees and more.

    Args:
        quads: the quad mesh.
        rounds: how many times.
        features: (f, 2) vertices of further edges of the surface on which vertices stay.

    Raises:
        OptionError: the number of rounds is negative.
    """
    if rounds < 0:
        raise OptionError(f"smoothing takes 0 rounds or more, not {rounds}")
    movable = ~(
        quads.is_boundary_vertex | _is_held(quads, np.asarray(features, dtype=np.int64).reshape(-1, 2))
    )
    surface = Stars.of(quads.surface.vertices, quads.surface.faces)
    points, faces, barycentric = quads.vertices.copy(), quads.faces.copy(), quads.barycentric.copy()
    for _ in range(rounds):
        wanted = _squared(points, quads.quads)[movable]
        new_faces, new_barycentric = faces[movable], barycentric[movable]
        slide_near(surface, wanted, new_faces, new_barycentric)
        new = points.copy()
        new[movable] = surface.at(new_faces, new_barycentric)
        stays = _held_back(points, new, quads.quads)
        gone = movable & ~stays
        faces[gone], barycentric[gone] = new_faces[gone[movable]], new_barycentric[gone[movable]]
        points[gone] = new[gone]
    if rounds:
        lift_worst(points, quads.quads, faces, barycentric, movable, surface)
    return replace(quads, vertices=points, faces=faces, barycentric=barycentric)


def _squared(points: FloatArray, quads: IntArray) -> FloatArray:
    """Return (q, 3) the mean of where quads ask each vertex to go: to the corner of the nearest square.

    Of the square with centre c, corner k is at c + J^k z, J being the quarter turn in the plane of the quad; the mean
    of J^-k (p_k - c) is the z that is nearest.
    """
    corners = points[quads]
    centre = corners.mean(axis=1)
    u, w = corners[:, 0] - corners[:, 2], corners[:, 1] - corners[:, 3]
    normal = np.cross(u, w)
    normal /= np.maximum(np.sqrt(dots(normal, normal)), np.finfo(float).tiny)[:, None]
    z = (u - np.cross(normal, w)) / 4
    turned = np.cross(normal, z)
    asked = centre[:, None] + np.stack([z, turned, -z, -turned], axis=1)
    count = np.maximum(np.bincount(quads.ravel(), minlength=len(points)), 1)
    sums = [np.bincount(quads.ravel(), asked[..., x].ravel(), len(points)) for x in range(3)]
    return np.stack(sums, axis=1) / count[:, None]


def _held_back(old: FloatArray, new: FloatArray, quads: IntArray) -> BoolArray:
    """Return (q,) the vertices that must stay, lest a quad be worse than LEAST and than it was."""
    stays = np.zeros(len(old), dtype=bool)
    bound = np.minimum(least_jacobians(old, quads), LEAST)
    while True:
        points = np.where(stays[:, None], old, new)
        bad = least_jacobians(points, quads) < bound
        bad &= ~stays[quads].all(axis=1)
        if not bad.any():
            return stays
        stays[quads[bad]] = True


def _is_held(quads: QuadMesh, features: IntArray) -> BoolArray:
    """Return (q,) the vertices on sharp edges of the surface, and on features (f, 2)."""
    mesh = quads.surface
    corners = mesh.vertices[mesh.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.sqrt(dots(normal, normal)), np.finfo(float).tiny)[:, None]
    one, two = mesh.edge_faces.T
    sharp = (dots(normal[one], normal[two]) < np.cos(SHARP)) & ~mesh.is_boundary_edge
    sharp[edge_indices(mesh, features)] = True
    has_sharp = np.zeros(len(mesh.vertices), dtype=bool)
    has_sharp[mesh.edges[sharp]] = True
    within = quads.barycentric > 0
    held = np.zeros(len(quads.faces), dtype=bool)
    edges = mesh.halfedge_edges.reshape(-1, 3)[quads.faces]
    for i in range(3):
        a, b = NEXT[i], NEXT[NEXT[i]]
        held |= ~within[:, i] & within[:, a] & within[:, b] & sharp[edges[:, i]]
        held |= within[:, i] & ~within[:, a] & ~within[:, b] & has_sharp[mesh.faces[quads.faces, i]]
    return held
