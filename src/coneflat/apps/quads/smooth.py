"""Quads made squarer by moving their vertices on the surface; the worst made better one vertex at a time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from ...base import BoolArray, FloatArray, IntArray, dots
from ...errors import OptionError
from ...mesh import NEXT
from .features import edge_indices, sharp_edges
from .nearest import Stars, slide_near
from .options import ROUNDS
from .quad_mesh import QuadMesh, least_jacobians

# Scaled Jacobian below which no quad goes that was above, nor any deeper that was below.
MIN_JACOBIAN = 0.5
# Radians: edges of the surface that bend more are sharp, and quad vertices on them stay.
SHARP_ANGLE = np.deg2rad(40.0)


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
    """Return (q,) the vertices that must stay, lest a quad be worse than MIN_JACOBIAN and than it was."""
    stays = np.zeros(len(old), dtype=bool)
    bound = np.minimum(least_jacobians(old, quads), MIN_JACOBIAN)
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
    sharp = np.zeros(len(mesh.edges), dtype=bool)
    sharp[sharp_edges(mesh, SHARP_ANGLE)] = True
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


def lift_worst(
    points: FloatArray,
    quads: IntArray,
    faces: IntArray,
    barycentric: FloatArray,
    movable: BoolArray,
    surface: Stars,
    below: float = 0.2,
) -> None:
    """Move vertices of bad quads to where the worst quad around each is best, on the surface.

    No quad around a vertex becomes worse than the worst of them was, and none that was positively oriented is flipped.

    Args:
        points: (q, 3) the vertices, changed.
        quads: (p, 4) vertex indices.
        faces, barycentric: (q,), (q, 3) where in which triangle the vertices lie, changed.
        movable: (q,) which may move.
        surface: that they lie on.
        below: scaled Jacobian of quads that count as bad.
    """
    order = np.argsort(quads.ravel(), kind="stable") // 4
    start = np.concatenate([[0], np.cumsum(np.bincount(quads.ravel(), minlength=len(points)))])
    for _ in range(8):
        least = least_jacobians(points, quads)
        bad = np.flatnonzero(least < below)
        worst_first = quads[bad[np.argsort(least[bad], kind="stable")]].ravel()
        _, first = np.unique(worst_first, return_index=True)
        tried = worst_first[np.sort(first)]
        gained = [
            _lift(int(v), order[start[v] : start[v + 1]], points, quads, faces, barycentric, surface)
            for v in tried[movable[tried]].tolist()
        ]
        if not any(gained):
            return


def _lift(
    vertex: int,
    star: IntArray,
    points: FloatArray,
    quads: IntArray,
    faces: IntArray,
    barycentric: FloatArray,
    surface: Stars,
) -> bool:
    """Move a vertex to the best place tried, and return whether there is a better one than where it is."""
    around = quads[star]
    sides = points[np.roll(around, -1, axis=1)] - points[around]
    length = float(np.sqrt(dots(sides, sides)).mean())
    axes = surface.axes(int(faces[vertex]))
    angle = 2 * np.pi * np.arange(12) / 12
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1) @ axes
    offsets = (length * np.array([0.5, 0.25, 0.1, 0.04])[:, None, None] * circle).reshape(-1, 3)
    on, weights = np.full(len(offsets), faces[vertex]), np.tile(barycentric[vertex], (len(offsets), 1))
    slide_near(surface, points[vertex] + offsets, on, weights)
    places = surface.at(on, weights)
    # The star with the vertex at each of the places, one after the other; the last one is as it is.
    trials = np.concatenate([places, points[vertex][None]])
    corners = np.tile(points[around], (len(trials), 1, 1, 1))
    corners[:, around == vertex] = trials[:, None]
    numbers = np.arange(corners.size // 3).reshape(-1, 4)
    each = least_jacobians(corners.reshape(-1, 3), numbers).reshape(len(trials), -1)
    inverts = ((each <= 0) & (each[-1] > 0)).any(axis=1)
    least = np.where(inverts, -np.inf, each.min(axis=1))
    best = int(np.argmax(least[:-1]))
    if least[best] <= least[-1]:
        return False
    points[vertex], faces[vertex], barycentric[vertex] = places[best], on[best], weights[best]
    return True


def untangled(quads: QuadMesh) -> QuadMesh:
    """Return a quad mesh with fewer quads flipped, none if that is found.

    Vertices around them move one at a time, on the surface, those on sharp edges among them, which smoothing leaves
    where they are: an edge that is followed less closely is less bad than a quad that is flipped. Those on the
    boundary stay.
    """
    points, faces, barycentric = quads.vertices.copy(), quads.faces.copy(), quads.barycentric.copy()
    surface = None
    for rings in range(6):
        near = least_jacobians(points, quads.quads) <= 0
        if not near.any():
            break
        surface = Stars.of(quads.surface.vertices, quads.surface.faces) if surface is None else surface
        movable = np.zeros(len(points), dtype=bool)
        movable[quads.quads[near]] = True
        for _ in range(rings):
            movable[quads.quads[movable[quads.quads].any(axis=1)]] = True
        movable &= ~quads.is_boundary_vertex
        below = float(np.interp(rings, [0, 5], [0.2, 0.8]))
        lift_worst(points, quads.quads, faces, barycentric, movable, surface, below)
    return quads if surface is None else replace(quads, vertices=points, faces=faces, barycentric=barycentric)
