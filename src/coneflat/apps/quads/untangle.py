"""The worst quads made better, by moving one vertex at a time, and quads turned over turned back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...base import BoolArray, FloatArray, IntArray, dots
from .nearest import Stars, slide_near
from .quad_mesh import QuadMesh, least_jacobians


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

    No quad around a vertex becomes worse than the worst of them was, and none that was upright is turned over.

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


def untangled(quads: QuadMesh, most_rings: int = 6) -> QuadMesh:
    """Return a quad mesh with fewer quads turned over, none if that is found.

    Vertices around them move one at a time, on the surface, those on sharp edges among them, which smoothing leaves
    where they are: an edge that is followed less closely is less bad than a quad that is turned over. Those on the
    boundary stay.
    """
    points, faces, barycentric = quads.vertices.copy(), quads.faces.copy(), quads.barycentric.copy()
    surface = None
    for rings in range(most_rings):
        near = least_jacobians(points, quads.quads) <= 0
        if not near.any():
            break
        surface = Stars.of(quads.surface.vertices, quads.surface.faces) if surface is None else surface
        movable = np.zeros(len(points), dtype=bool)
        movable[quads.quads[near]] = True
        for _ in range(rings):
            movable[quads.quads[movable[quads.quads].any(axis=1)]] = True
        movable &= ~quads.is_boundary_vertex
        below = float(np.interp(rings, [0, most_rings - 1], [0.2, 0.8]))
        lift_worst(points, quads.quads, faces, barycentric, movable, surface, below)
    return quads if surface is None else replace(quads, vertices=points, faces=faces, barycentric=barycentric)
