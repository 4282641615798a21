"""The worst quads made better, by moving one vertex at a time to the best of places around it."""

from __future__ import annotations

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray, dots
from ..geometry.nearest import Stars, slide_near
from .jacobians import least_jacobians

# Scaled Jacobian of quads that count as bad, and how many times all of their vertices are tried.
BAD, SWEEPS = 0.2, 8
# Where a vertex is tried: so many directions, at such parts of the mean length of its quads' sides.
DIRECTIONS, STEPS = 12, (0.5, 0.25, 0.1, 0.04)


def lift_worst(
    points: FloatArray,
    quads: IntArray,
    faces: IntArray,
    barycentric: FloatArray,
    movable: BoolArray,
    surface: Stars,
    below: float = BAD,
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
    for _ in range(SWEEPS):
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
    angle = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1) @ axes
    offsets = (length * np.array(STEPS)[:, None, None] * circle).reshape(-1, 3)
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
