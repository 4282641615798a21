"""A page of quads: rectangles of quads take the place of charts, and a square of the board is a quad."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ... import Flattening
from ...base import BoolArray, IntArray, plural
from ...io import Mapped
from ...mesh import label_components
from ..view import Told, flattening_of, page_of
from .quad_mesh import QuadMesh
from .quality import measure_quads
from .transitions import TURNS

# The corners of a square, counterclockwise, and the directions of its sides.
SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])


@dataclass(frozen=True, eq=False)
class Domains:
    """A parting of a mesh of p quads into rectangles of quads.

    Attributes:
        domain: (p,) of each quad.
        places: (p, 4, 2) integers: where the corners of each quad lie in its rectangle, whose least is (0, 0).
        sides: (d, 2) quads along x and along y of each, y being no more.
        is_cut: (4p,) whether side i of quad q, 4 q + i, from its corner i to the next, is on the border of a domain.
    """

    domain: IntArray
    places: IntArray
    sides: IntArray
    is_cut: BoolArray


def find_domains(mesh: QuadMesh) -> Domains:
    """Return the rectangles that lines from irregular vertices part a mesh of quads into.

    From each irregular vertex all lines set out at one time, and each ends where it meets another, or the boundary.
    Other pieces, like a torus without irregular vertices, are divided by lines from their first vertex.
    """
    twin, starts = _twins(mesh), mesh.quads.ravel()
    is_cut = twin < 0
    reached = np.zeros(len(mesh.vertices), dtype=bool)
    reached[starts[is_cut]] = True
    # Inside, four sides set out from a regular vertex; on the boundary two, as the last one is of no quad.
    leaving = np.bincount(starts, minlength=len(mesh.vertices))
    odd = np.where(mesh.is_boundary_vertex, leaving > 2, leaving != 4)
    seeds = np.flatnonzero(odd)
    while True:
        _ride(seeds, starts, twin, is_cut, reached)
        found, is_bad = _laid_out(twin, is_cut, len(mesh.quads))
        if not is_bad.any():
            return found
        # One more vertex of each that is not a rectangle: the first whose lines are not all there.
        first = np.flatnonzero(is_bad[np.repeat(found.domain, 4)] & ~is_cut)
        _, one_of = np.unique(np.repeat(found.domain, 4)[first], return_index=True)
        seeds = np.unique(starts[first[one_of]])


def _twins(mesh: QuadMesh) -> IntArray:
    """Return (4p,) the side of the quad across each side; -1 on the boundary."""
    one, two = mesh.quads.ravel(), np.roll(mesh.quads, -1, axis=1).ravel()
    count = len(mesh.vertices)
    keys, back = one * count + two, two * count + one
    order = np.argsort(keys)
    at = np.minimum(np.searchsorted(keys[order], back), len(order) - 1)
    return np.where(keys[order[at]] == back, order[at], -1)


def _ride(seeds: IntArray, starts: IntArray, twin: IntArray, is_cut: BoolArray, reached: BoolArray) -> None:
    """Cut along the lines from some vertices, in place; all go on by one side at a time."""
    reached[seeds] = True
    riders = np.flatnonzero(np.isin(starts, seeds) & ~is_cut)
    while len(riders):
        is_cut[riders] = is_cut[twin[riders]] = True
        arrived = starts[_next(riders)]
        # Of those that arrive together one goes on, so that there is a straight line through every vertex.
        _, first = np.unique(arrived, return_index=True)
        riders = riders[np.sort(first)]
        riders = riders[~reached[starts[_next(riders)]]]
        reached[starts[_next(riders)]] = True
        beside = twin[_next(riders)]
        on = _next(beside)
        riders = on[(beside >= 0) & ~is_cut[on]]


def _next(side: IntArray) -> IntArray:
    """Return the next side of the same quad."""
    return side - side % 4 + (side + 1) % 4


def _laid_out(twin: IntArray, is_cut: BoolArray, count: int) -> tuple[Domains, BoolArray]:
    """Return the domains as they lie in the plane, and which of them are not rectangles."""
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
        here, there = sides // 4, twin[sides] // 4
        # The side runs the other way in the quad across.
        turn[there] = (turn[here] + sides % 4 + 2 - twin[sides] % 4) % 4
        end = origin[here] + _turned(turn[here], SQUARE[(sides + 1) % 4])
        origin[there] = end - _turned(turn[there], SQUARE[twin[sides] % 4])
        front = there
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
    upright = sides[:, 1] > sides[:, 0]
    lying = places[..., ::-1] * [-1, 1] + np.stack([sides[:, 1], 0 * sides[:, 1]], axis=1)[domain][:, None]
    places = np.where(upright[domain][:, None, None], lying, places)
    sides = np.where(upright[:, None], sides[:, ::-1], sides)
    return Domains(domain, places, sides, is_cut), is_bad


def _turned(turn: IntArray, vectors: IntArray) -> IntArray:
    found: IntArray = np.einsum("qxy,qy->qx", TURNS[turn], vectors)
    return found


def arranged(domains: Domains) -> tuple[IntArray, int]:
    """Return (p, 4, 2) integers where corners of quads lie if all rectangles lie apart, and the side of a square.

    They lie in rows, the tallest below, so that all are about square; a gap of one quad is around each.
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


def page_of_quads(quads: QuadMesh, *, name: str = "Quads", show: str | None = None, **look: Any) -> str:
    """Return the page of a mesh of quads as text; arguments and errors are those of `page_of`.

    Triangles are halves of quads. Charts, which it shows first, are the rectangles of `find_domains`, laid out apart,
    and seams their borders. Irregular vertices are cones: red where fewer than four quads meet, black where more do.
    """
    domains = find_domains(quads)
    result, charts = as_flattening(quads, domains), len(domains.sides)
    irregular = plural(len(quads.irregular), "irregular vertex", "irregular vertices")
    told = Told(
        title=f"{plural(len(quads.quads), 'quad')}  ·  {irregular}  ·  {plural(charts, 'rectangle')}",
        rows=[
            *measure_quads(quads).rows(),
            ("red dots", f"{(result.curvatures > 0).sum():,}", "vertices with fewer than four quads"),
            ("black dots", f"{(result.curvatures < 0).sum():,}", "vertices with more than four quads"),
            ("charts", f"{charts:,}", "rectangles between lines from the irregular vertices"),
        ],
        squares=float(np.sqrt(len(quads.quads))),
    )
    if show is None:
        show = "charts" if look.get("texture") is None else "picture"
    return page_of(result, name=name, show=show, told=told, **look)


def as_flattening(quads: QuadMesh, domains: Domains) -> Flattening:
    """Return the triangles of quads with UVs in which all are squares of one size, in rectangles that lie apart."""
    places, side = arranged(domains)
    corner_uv = places.reshape(-1, 2)[quads.triangle_corners] / side
    result = flattening_of(Mapped(quads.vertices, quads.triangles, corner_uv, len(quads.quads), 0, 0))
    irregular = quads.irregular
    return replace(
        result, cones=irregular, curvatures=(4 - quads.valences[irregular]) * np.pi / 2, notes=quads.notes
    )
