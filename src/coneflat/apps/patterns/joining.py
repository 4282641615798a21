"""Pieces joined to their neighbours where the strain allows it: the fewer there are, the less is to be sewn."""

from __future__ import annotations

import numpy as np

from ...base import BoolArray, FloatArray, IntArray, begin_step, mask_of
from ...geometry import signed_double_areas
from ...mesh import are_among, nearby
from .borders import Seam, find_borders
from .cut_surface import CutSurface
from .relaxing import EVEN, SMALLEST, closed_seams, excess, relaxed
from .strain import Stretch

# Rings of triangles around a joined piece whose points move.
RINGS = 6
# Points that are moved in all tries together, relative to those of the surface.
WORK = 24.0
# Excess of the relative strain, if it is moderately even, above which it cannot be within the bound.
HOPELESS = 1.0


def with_joined_pieces(surface: CutSurface, stretch: Stretch, required: IntArray) -> CutSurface:
    """Return a cut surface with as many pieces joined as possible without overlaps.

    No edge is strained more than allowed that was not before.

    Args:
        surface: the surface.
        stretch: what the material allows.
        required: (k, 2) the vertices of edges that remain cut.
    """
    allowed = excess(surface, stretch).max()
    is_required = are_among(surface.mesh.edges, required)
    points_left = WORK * len(surface.points)
    failures = set[tuple[int, ...]]()
    candidates = _candidates(surface, is_required, failures)
    while candidates and points_left > 0:
        begin_step()
        key, piece, seam = candidates.pop()
        sewn = _sewn(surface, piece, seam)
        is_free = nearby(sewn.corners, surface.pieces == piece, RINGS)
        points_left -= int(is_free.sum())
        joined = _within(sewn, is_free, stretch, allowed)
        if joined is None:
            failures.add(key)
        else:
            surface = joined
            candidates = _candidates(surface, is_required, failures)
    return surface


def _candidates(
    surface: CutSurface, is_required: BoolArray, failures: set[tuple[int, ...]]
) -> list[tuple[tuple[int, ...], int, Seam]]:
    """Return the seams between two pieces that may be closed, with a key, and the smaller piece.

    The smallest piece is the last one, with its longest seam. The key is the seam's first edge, the number of its edges
    and the sizes of the two pieces: they change if one of the pieces does. Keys among `failures` are left out.
    """
    areas = np.bincount(surface.pieces, surface.edges.double_areas)
    sizes = np.bincount(surface.pieces)
    candidates = []
    for seam in find_borders(surface).seams:
        first, second = (side.piece for side in seam.sides)
        edges = surface.mesh.halfedge_edges[seam.sides[0].halfedges]
        key = int(edges.min()), len(edges), *sorted((int(sizes[first]), int(sizes[second])))
        if first != second and key not in failures and not is_required[edges].any():
            candidates.append((key, min(first, second, key=lambda piece: areas[piece]), seam))
    return sorted(candidates, key=lambda item: (-areas[item[1]], item[2].surface_length))


def _sewn(surface: CutSurface, piece: int, seam: Seam) -> CutSurface:
    """Return a surface with a piece moved to another one and joined to it along a seam."""
    moved, fixed = seam.sides if seam.sides[0].piece == piece else seam.sides[::-1]
    is_member = surface.pieces == piece
    places = surface.places.copy()
    places[is_member] = _moved_onto(
        surface.points[moved.points], surface.points[fixed.points[::-1]], places[is_member]
    )
    is_closed = mask_of(len(surface.mesh.edges), surface.mesh.halfedge_edges[moved.halfedges])
    return surface.cut_along(surface.seams[~is_closed[surface.seams]], places)


def _within(surface: CutSurface, is_free: BoolArray, stretch: Stretch, allowed: float) -> CutSurface | None:
    """Return a surface relaxed at free points; None if that does not lead to one without overlaps within the bound."""
    if not (signed_double_areas(surface.places) > 0).all():
        return None
    even = relaxed(surface, stretch, EVEN, is_free)
    if excess(even, stretch).max() > allowed + HOPELESS:
        return None
    flat = relaxed(even, stretch, SMALLEST, is_free)
    if excess(flat, stretch).max() > allowed or len(flat.overlaps()):
        return None
    closed = closed_seams(flat)
    if excess(closed, stretch).max() > allowed or len(closed.overlaps()):
        return None
    return closed


def _moved_onto(points: FloatArray, goals: FloatArray, places: FloatArray) -> FloatArray:
    """Return places (m, 3, 2) moved as the points (k, 2) must be to come as near as possible to the goals (k, 2)."""
    start, goal = points.mean(axis=0), goals.mean(axis=0)
    p, q = (points - start) @ [1, 1j], (goals - goal) @ [1, 1j]
    product = np.vdot(p, q)
    turn = product / abs(product) if abs(product) > 0 else 1.0
    moved = (places - start) @ np.array([1, 1j]) * turn
    return np.stack([moved.real, moved.imag], axis=-1) + goal
