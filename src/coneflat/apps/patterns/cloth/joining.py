"""Pieces joined to their neighbours where the strain allows it: the fewer there are, the less is to be sewn."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ....base import BoolArray, FloatArray, IntArray, begin_step, has_any, mask_of
from ....geometry import signed_double_areas
from ....mesh import are_among, nearby
from ..pieces.borders import Seam, find_borders
from ..pieces.cut_surface import CutSurface
from ..pieces.relaxing import EVEN, SMALLEST, closed_seams, excess, relaxed
from ..pieces.strain import Stretch

# Rings of triangles around a joined piece whose points move.
RINGS = 6
# Points that are moved in all tries together, relative to those of the surface.
WORK = 24.0
# Excess of the relative strain, if it is moderately even, above which it cannot be within the bound.
HOPELESS = 1.0


class _Joint(NamedTuple):
    """A seam that may be closed: one between two pieces, or a dart.

    Attributes:
        seam: the seam.
        edges: (k,) the edges of the mesh on it.
        moved: the piece that is moved to the other one; None for darts.
        key: the first edge, the number of edges, and the sizes of the two pieces: it changes if one of them does.
        rank: joints with a smaller one are tried first.
    """

    seam: Seam
    edges: IntArray
    moved: int | None
    key: tuple[int, ...]
    rank: tuple[float, ...]


def with_joined_pieces(surface: CutSurface, stretch: Stretch, required: IntArray) -> CutSurface:
    """Return a cut surface with as many pieces joined, and then darts closed, as possible without overlaps.

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
    joints = _joints(surface, is_required, failures)
    while joints and points_left > 0:
        begin_step()
        joint = joints.pop(0)
        sewn, is_free = _sewn(surface, joint)
        points_left -= int(is_free.sum())
        joined = _within(sewn, is_free, stretch, allowed)
        if joined is None:
            failures.add(joint.key)
        else:
            surface = joined
            joints = _joints(surface, is_required, failures)
    return surface


def _joints(surface: CutSurface, is_required: BoolArray, failures: set[tuple[int, ...]]) -> list[_Joint]:
    """Return the seams that may be closed, except those that failed, in the order in which they are tried.

    These are seams of the smallest pieces, the longest first, and then darts, the shortest first.
    """
    areas = np.bincount(surface.pieces, surface.edges.double_areas)
    sizes = np.bincount(surface.pieces)
    joints = []
    for seam in find_borders(surface).seams:
        first, second = (side.piece for side in seam.sides)
        edges = surface.mesh.halfedge_edges[seam.sides[0].halfedges]
        key = int(edges.min()), len(edges), *sorted((int(sizes[first]), int(sizes[second])))
        if key in failures or is_required[edges].any():
            continue
        if first != second:
            moved = min(first, second, key=lambda piece: areas[piece])
            joints.append(_Joint(seam, edges, moved, key, (0.0, areas[moved], -seam.surface_length)))
        elif seam.is_dart:
            joints.append(_Joint(seam, edges, None, key, (1.0, seam.surface_length)))
    return sorted(joints, key=lambda joint: joint.rank)


def _sewn(surface: CutSurface, joint: _Joint) -> tuple[CutSurface, BoolArray]:
    """Return a surface with a seam closed, whose piece was moved to the other one, and the points to move then."""
    places, mesh = surface.places.copy(), surface.mesh
    is_around = has_any(mask_of(len(mesh.vertices), mesh.edges[joint.edges]), mesh.faces)
    if joint.moved is not None:
        moved, fixed = (
            joint.seam.sides if joint.seam.sides[0].piece == joint.moved else joint.seam.sides[::-1]
        )
        is_around = surface.pieces == joint.moved
        places[is_around] = _moved_onto(
            surface.points[moved.points], surface.points[fixed.points[::-1]], places[is_around]
        )
    sewn = surface.cut_along(np.setdiff1d(surface.seams, joint.edges), places)
    return sewn, nearby(sewn.corners, is_around, RINGS)


def _within(surface: CutSurface, is_free: BoolArray, stretch: Stretch, allowed: float) -> CutSurface | None:
    """Return a surface relaxed at free points; None if that does not lead to one without overlaps within the bound."""
    if not (signed_double_areas(surface.places) > 0).all():
        return None
    even = relaxed(surface, stretch, EVEN, is_free)
    if excess(even, stretch).max() > allowed + HOPELESS:
        return None
    flat = relaxed(even, stretch, SMALLEST, is_free)
    if excess(flat, stretch).max() > allowed:
        return None
    closed = closed_seams(flat, is_free)
    if excess(closed, stretch).max() > allowed:
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
