"""Small pieces, which separating overlaps leaves, joined to their neighbours where the strain allows it."""

from __future__ import annotations

import numpy as np

from ...base import FloatArray, IntArray, mask_of
from ...geometry import signed_double_areas
from ...mesh import are_among, nearby
from .borders import Seam, find_borders
from .cut_surface import CutSurface
from .relaxing import EVEN, SMALLEST, closed_seams, excess, relaxed
from .strain import Stretch

# Largest area of a small piece, relative to that of all pieces.
MAX_SHARE = 0.01
# Seams of a small piece at which it is joined to its neighbours, the longest first, and of all pieces.
SEAMS, ALL_SEAMS = 2, 24
# Rings of triangles around a joined piece whose points move.
RINGS = 6


def without_small_pieces(surface: CutSurface, stretch: Stretch, required: IntArray) -> CutSurface:
    """Return a cut surface with as many of the small pieces joined to others as possible without overlaps.

    No edge is strained more than allowed that was not before.

    Args:
        surface: the surface.
        stretch: what the material allows.
        required: (k, 2) the vertices of edges that remain cut.
    """
    allowed = excess(surface, stretch).max()
    tries = 0
    while tries < ALL_SEAMS:
        for piece, seam in _candidates(surface, required):
            tries += 1
            joined = _joined(surface, piece, seam, stretch)
            if joined is not None and excess(joined, stretch).max() <= allowed and not len(joined.overlaps()):
                surface = joined
                break
            if tries >= ALL_SEAMS:
                break
        else:
            break
    return surface


def _candidates(surface: CutSurface, required: IntArray) -> list[tuple[int, Seam]]:
    """Return small pieces with their longest seams to others, the smallest piece first."""
    areas = np.bincount(surface.pieces, surface.edges.double_areas)
    is_required = are_among(surface.mesh.edges, required)
    by_piece: dict[int, list[Seam]] = {}
    for seam in find_borders(surface).seams:
        first, second = (side.piece for side in seam.sides)
        may_close = not is_required[surface.mesh.halfedge_edges[seam.sides[0].halfedges]].any()
        if first != second and may_close:
            for piece in (first, second):
                by_piece.setdefault(piece, []).append(seam)
    candidates = []
    for piece in np.argsort(areas, kind="stable").tolist():
        if areas[piece] < MAX_SHARE * areas.sum():
            longest = sorted(by_piece.get(piece, []), key=lambda seam: -seam.surface_length)
            candidates += [(piece, seam) for seam in longest[:SEAMS]]
    return candidates


def _joined(surface: CutSurface, piece: int, seam: Seam, stretch: Stretch) -> CutSurface | None:
    """Return a surface with a piece sewn to another one along a seam, and relaxed around it."""
    moved, fixed = seam.sides if seam.sides[0].piece == piece else seam.sides[::-1]
    is_member = surface.pieces == piece
    places = surface.places.copy()
    places[is_member] = _moved_onto(
        surface.points[moved.points], surface.points[fixed.points[::-1]], places[is_member]
    )
    is_closed = mask_of(len(surface.mesh.edges), surface.mesh.halfedge_edges[moved.halfedges])
    sewn = surface.cut_along(surface.seams[~is_closed[surface.seams]], places)
    if not (signed_double_areas(sewn.places) > 0).all():
        return None
    is_free = nearby(sewn.corners, is_member, RINGS)
    return closed_seams(relaxed(sewn, stretch, (*EVEN, *SMALLEST), is_free))


def _moved_onto(points: FloatArray, goals: FloatArray, places: FloatArray) -> FloatArray:
    """Return places (m, 3, 2) moved as the points (k, 2) must be to come as near as possible to the goals (k, 2)."""
    start, goal = points.mean(axis=0), goals.mean(axis=0)
    p, q = (points - start) @ [1, 1j], (goals - goal) @ [1, 1j]
    product = np.vdot(p, q)
    turn = product / abs(product) if abs(product) > 0 else 1.0
    moved = (places - start) @ np.array([1, 1j]) * turn
    return np.stack([moved.real, moved.imag], axis=-1) + goal
