"""Rectangles of quads: the domains between lines from irregular vertices, and UVs in which they are packed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base import BoolArray, FloatArray, IntArray, mask_of
from ..geometry import TURNS, rotated
from ..mesh import label_components
from .quad_mesh import QuadMesh, opposite_sides

# The corners of a square, counterclockwise, and the directions of its sides.
SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])


@dataclass(frozen=True, eq=False)
class Domains:
    """A partition of a mesh of p quads into d rectangular domains.

    Attributes:
        domain: (p,) the domain of each quad.
        places: (p, 4, 2) integer coordinates of the corners of each quad in its rectangle, from (0, 0).
        sides: (d, 2) number of quads along x and along y, which is at most that along x.
        is_cut: (4p,) whether side i of quad q, 4 q + i, from its corner i to the next, is on the border of a domain.
    """

    domain: IntArray
    places: IntArray
    sides: IntArray
    is_cut: BoolArray


def find_domains(mesh: QuadMesh) -> Domains:
    """Return the rectangles into which lines from irregular vertices divide a quad mesh.

    Lines start at all irregular vertices simultaneously, and each ends where it meets another line or the boundary.
    Pieces that are not rectangles, such as a torus without irregular vertices, are divided by lines from one vertex.
    """
    twin, starts = opposite_sides(mesh.quads), mesh.quads.ravel()
    is_cut = twin < 0
    reached = mask_of(len(mesh.vertices), starts[is_cut])
    # Four half-edges leave a regular inner vertex. Two leave a regular boundary vertex: its third edge has none there.
    leaving = np.bincount(starts, minlength=len(mesh.vertices))
    odd = np.where(mesh.is_boundary_vertex, leaving > 2, leaving != 4)
    seeds = np.flatnonzero(odd)
    while True:
        _trace(seeds, starts, twin, is_cut, reached)
        domains, is_bad = _unfold(twin, is_cut, len(mesh.quads))
        if not is_bad.any():
            return domains
        # Each domain that is not a rectangle gets one more start vertex: the first with an uncut side.
        first = np.flatnonzero(is_bad[np.repeat(domains.domain, 4)] & ~is_cut)
        _, one_of = np.unique(np.repeat(domains.domain, 4)[first], return_index=True)
        seeds = np.unique(starts[first[one_of]])


def _trace(seeds: IntArray, starts: IntArray, twin: IntArray, is_cut: BoolArray, reached: BoolArray) -> None:
    """Cut along the lines from some vertices, in place; all lines advance by one side at a time."""
    reached[seeds] = True
    fronts = np.flatnonzero(np.isin(starts, seeds) & ~is_cut)
    while len(fronts):
        is_cut[fronts] = is_cut[twin[fronts]] = True
        arrived = starts[_next(fronts)]
        # Of the lines that arrive at a vertex together, one continues, so that each vertex has a straight line.
        _, first = np.unique(arrived, return_index=True)
        fronts = fronts[np.sort(first)]
        fronts = fronts[~reached[starts[_next(fronts)]]]
        reached[starts[_next(fronts)]] = True
        opposite = twin[_next(fronts)]
        on = _next(opposite)
        fronts = on[(opposite >= 0) & ~is_cut[on]]


def _next(side: IntArray) -> IntArray:
    """Return the next side of the same quad."""
    return side - side % 4 + (side + 1) % 4


def _unfold(twin: IntArray, is_cut: BoolArray, count: int) -> tuple[Domains, BoolArray]:
    """Return the domains unfolded in the plane, and which of them are not rectangles."""
    inner = np.flatnonzero(~is_cut)
    number, domain = label_components(count, inner // 4, twin[inner] // 4)
    turn, origin = np.full(count, -1), np.zeros((count, 2), dtype=np.int64)
    _, seed = np.unique(domain, return_index=True)
    turn[seed] = 0
    front = seed
    while len(front):
        sides = (4 * front[:, None] + np.arange(4)).ravel()
        sides = sides[~is_cut[sides]]
        sides = sides[turn[twin[sides] // 4] < 0]
        _, first = np.unique(twin[sides] // 4, return_index=True)
        sides = sides[first]
        face, neighbour = sides // 4, twin[sides] // 4
        # The side has the opposite direction in the neighbouring quad.
        turn[neighbour] = (turn[face] + sides % 4 + 2 - twin[sides] % 4) % 4
        end = origin[face] + rotated(turn[face], SQUARE[(sides + 1) % 4])
        origin[neighbour] = end - rotated(turn[neighbour], SQUARE[twin[sides] % 4])
        front = neighbour
    places = origin[:, None] + np.einsum("qxy,cy->qcx", TURNS[turn], SQUARE)
    low, high = np.full((number, 2), np.iinfo(np.int64).max), np.full((number, 2), np.iinfo(np.int64).min)
    np.minimum.at(low, domain, places.min(axis=1))
    np.maximum.at(high, domain, places.max(axis=1))
    sides = high - low
    places -= low[domain][:, None]
    flat, across = places.reshape(-1, 2), twin[inner]
    fits = (flat[inner] == flat[_next(across)]).all(axis=1) & (flat[_next(inner)] == flat[across]).all(axis=1)
    is_bad = sides.prod(axis=1) != np.bincount(domain, minlength=number)
    is_bad[domain[inner[~fits] // 4]] = True
    is_tall = sides[:, 1] > sides[:, 0]
    lying = places[..., ::-1] * [-1, 1] + np.stack([sides[:, 1], 0 * sides[:, 1]], axis=1)[domain][:, None]
    places = np.where(is_tall[domain][:, None, None], lying, places)
    sides = np.where(is_tall[:, None], sides[:, ::-1], sides)
    return Domains(domain, places, sides, is_cut), is_bad


def arranged(domains: Domains) -> tuple[IntArray, int]:
    """Return (p, 4, 2) integer coordinates of quad corners with all rectangles packed, and the side of the square.

    Rectangles are packed in rows, the tallest at the bottom, into about a square, with a gap of one quad around each.
    """
    sides = domains.sides + 1
    order = np.lexsort((-sides[:, 0], -sides[:, 1]))
    width = max(int(np.ceil(np.sqrt(sides.prod(axis=1).sum()))), int(sides[:, 0].max()))
    corner = np.zeros_like(sides)
    x = y = height = 0
    for k in order.tolist():
        if x + sides[k, 0] > width:
            x, y, height = 0, y + height, 0
        corner[k] = x, y
        x, height = x + int(sides[k, 0]), max(height, int(sides[k, 1]))
    return 1 + domains.places + corner[domains.domain][:, None], 1 + max(width, y + height)


def quad_uv(mesh: QuadMesh) -> FloatArray:
    """Return (p, 4, 2) UVs of the corners of quads: squares of one size in disjoint rectangles, in the unit square."""
    places, side = arranged(find_domains(mesh))
    return places / side
