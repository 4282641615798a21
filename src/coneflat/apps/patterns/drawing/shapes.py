"""Shapes of pieces: their seam lines, and what is cut out, with allowances and tabs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ....base import FloatArray, IntArray
from ..finish import HEM, Finish
from ..net.tabs import Tab
from ..pieces.borders import Borders
from ..pieces.cut_surface import CutSurface
from .allowances import GRID, polygon_of, united, widened

if TYPE_CHECKING:
    from shapely import Polygon


@dataclass(frozen=True, eq=False)
class PieceShape:
    """A piece in the plane.

    Attributes:
        seam_rings: the points (k, 2) of its borders, the outer one first.
        inside: what its borders enclose.
        cut: what is cut out: the piece with seam allowances and tabs.
        is_wider: whether it has any.
        cut_rings: the lines (k, 2) along which it is cut, without repeated ends. Tabs may touch the piece and each
            other there, and are cut apart.
    """

    seam_rings: tuple[FloatArray, ...]
    inside: Polygon
    cut: Polygon
    is_wider: bool
    cut_rings: tuple[FloatArray, ...]


def piece_shapes(
    surface: CutSurface, borders: Borders, finish: Finish, tabs: tuple[Tab, ...] = ()
) -> list[PieceShape]:
    """Return the shapes of the pieces of a cut surface.

    Raises:
        OptionError: the finish names a seam that does not exist.
    """
    finish.check_names([seam.name for seam in borders.seams])
    width = allowance_of_halfedges(len(surface.corners), borders, finish)
    shapes = []
    for piece, loops in enumerate(borders.loops):
        rings = tuple(surface.points[tails(surface, loop)] for loop in loops)
        inside = polygon_of(rings)
        own_tabs = [tab for tab in tabs if tab.piece == piece]
        if any(width[loop].any() for loop in loops):
            cut = widened(rings, [width[loop] for loop in loops], finish.is_round)
            cut = united([cut, *(polygon_of([tab.polygon]) for tab in own_tabs)]) if own_tabs else cut
            cut_rings = tuple(np.asarray(ring.coords)[:-1] for ring in (cut.exterior, *cut.interiors))
            shapes.append(PieceShape(rings, inside, cut, True, cut_rings))
        elif own_tabs:
            cut = united([inside, *(polygon_of([tab.polygon]) for tab in own_tabs)])
            tab_of = {
                int(borders.seams[tab.seam].sides[tab.side].halfedges[tab.edges[0]]): tab for tab in own_tabs
            }
            cut_rings = tuple(_with_tabs(surface, borders, loop, tab_of) for loop in loops)
            shapes.append(PieceShape(rings, inside, cut, True, cut_rings))
        else:
            shapes.append(PieceShape(rings, inside, inside, False, rings))
    return shapes


def _with_tabs(
    surface: CutSurface, borders: Borders, loop: IntArray, tab_of: Mapping[int, Tab]
) -> FloatArray:
    """Return the points (k, 2) of a border with the outlines of tabs, without rounding.

    Args:
        surface: the pieces.
        borders: their borders.
        loop: the half-edges of the border.
        tab_of: tabs by the first half-edge of their base.
    """
    starts = [place for place, halfedge in enumerate(loop.tolist()) if halfedge in tab_of]
    if not starts:
        return surface.points[tails(surface, loop)]
    loop = np.roll(loop, -starts[0])
    border, parts, place = surface.points[tails(surface, loop)], list[FloatArray](), 0
    while place < len(loop):
        tab = tab_of.get(int(loop[place]))
        if tab is None:
            parts.append(border[place : place + 1])
            place += 1
        else:
            before, base, after = _divided(_side_of_tab(surface, borders, tab), tab.polygon)
            parts.append(np.concatenate([before, base[:1], tab.polygon[1:-1], base[-1:], after])[:-1])
            place += tab.edges[1] - tab.edges[0]
    return np.concatenate(parts)


def fold_of_tab(surface: CutSurface, borders: Borders, tab: Tab) -> FloatArray:
    """Return the points (k, 2) of the border of a piece along the base of a tab."""
    return _divided(_side_of_tab(surface, borders, tab), tab.polygon)[1]


def _side_of_tab(surface: CutSurface, borders: Borders, tab: Tab) -> FloatArray:
    """Return the points (k, 2) of the straight part of a border on which a tab is."""
    first, last = tab.edges
    return surface.points[borders.seams[tab.seam].sides[tab.side].points[first : last + 1]]


def _divided(side: FloatArray, polygon: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the points (k, 2) of a straight side before the base of a tab, along it, and after it.

    Where the base begins or ends at a point of the side, this point is the exact one.
    """
    along = side[-1] - side[0]
    along = along / np.linalg.norm(along)
    stations, (start, end) = (side - side[0]) @ along, (polygon[[0, -1]] - side[0]) @ along
    corners = [
        point[None] if np.abs(stations - station).min() > GRID else np.empty((0, 2))
        for station, point in ((start, polygon[0]), (end, polygon[-1]))
    ]
    is_inside = (stations >= start - GRID) & (stations <= end + GRID)
    before, after = side[~is_inside & (stations < end)], side[~is_inside & (stations > start)]
    return before, np.concatenate([corners[0], side[is_inside], corners[1]]), after


def tails(surface: CutSurface, halfedges: IntArray) -> IntArray:
    """Return (k,) the points at which half-edges begin, 3 times the triangle plus the corner opposite."""
    return surface.corners[halfedges // 3, (halfedges + 1) % 3]


def allowance_of_halfedges(triangles: int, borders: Borders, finish: Finish) -> FloatArray:
    """Return (3m,) the width of the seam allowance at each half-edge, 0 inside pieces."""
    width = np.zeros(3 * triangles)
    for seam in borders.seams:
        for side in seam.sides:
            width[side.halfedges] = finish.width(seam.name)
    for hem in borders.hems:
        width[hem.halfedges] = finish.width(HEM)
    return width
