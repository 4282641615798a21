"""Quads that smoothing leaves turned over, turned back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..geometry.nearest import Stars
from .jacobians import least_jacobians
from .quad_mesh import QuadMesh
from .worst import lift_worst

# Rings of quads around those turned over whose vertices may leave sharp edges, one more each time; and the scaled
# Jacobian below which quads there make room, rising likewise.
RINGS, ROOM = 6, (0.2, 0.8)


def untangled(quads: QuadMesh) -> QuadMesh:
    """Return a quad mesh with fewer quads turned over, none if that is found.

    Vertices around them move one at a time, on the surface, those on sharp edges among them, which smoothing leaves
    where they are: an edge that is followed less closely is less bad than a quad that is turned over. Those on the
    boundary stay.
    """
    points, faces, barycentric = quads.vertices.copy(), quads.faces.copy(), quads.barycentric.copy()
    surface = None
    for rings in range(RINGS):
        near = least_jacobians(points, quads.quads) <= 0
        if not near.any():
            break
        surface = Stars.of(quads.surface.vertices, quads.surface.faces) if surface is None else surface
        movable = np.zeros(len(points), dtype=bool)
        movable[quads.quads[near]] = True
        for _ in range(rings):
            movable[quads.quads[movable[quads.quads].any(axis=1)]] = True
        movable &= ~quads.is_boundary_vertex
        below = float(np.interp(rings, [0, RINGS - 1], ROOM))
        lift_worst(points, quads.quads, faces, barycentric, movable, surface, below)
    return quads if surface is None else replace(quads, vertices=points, faces=faces, barycentric=barycentric)
