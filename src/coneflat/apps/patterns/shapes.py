"""Shapes of pieces: their seam lines, and what is cut out, with allowances and tabs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from ...base import FloatArray, IntArray
from .allowances import GRID, polygon_of, united, widened
from .borders import Borders
from .cut_surface import CutSurface
from .finish import HEM, Finish
from .tabs import Tab

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
        slits: the lines (2, 2) inside `cut` along which the piece touches itself.
    """

    seam_rings: tuple[FloatArray, ...]
    inside: Polygon
    cut: Polygon
    is_wider: bool
    slits: tuple[FloatArray, ...] = ()

    @property
    def cut_rings(self) -> tuple[FloatArray, ...]:
        """The lines (k, 2) along which it is cut, without repeated ends."""
        if not self.is_wider:
            return self.seam_rings
        return tuple(np.asarray(ring.coords)[:-1] for ring in (self.cut.exterior, *self.cut.interiors))


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
        own_tabs = [tab.polygon for tab in tabs if tab.piece == piece]
        has_allowance = any(width[loop].any() for loop in loops)
        cut = widened(rings, [width[loop] for loop in loops], finish.is_round) if has_allowance else inside
        if own_tabs:
            cut = united([cut, *(polygon_of([points]) for points in own_tabs)])
        # Slits inside allowances are seam lines; without allowances and tabs, the rings are cut, slits among them.
        slits = slits_of(rings) if own_tabs and not has_allowance else ()
        shapes.append(PieceShape(rings, inside, cut, has_allowance or bool(own_tabs), slits))
    return shapes


def slits_of(rings: Sequence[FloatArray]) -> tuple[FloatArray, ...]:
    """Return the edges (2, 2) of rings of points (k, 2) that lie on each other in opposite directions, once each."""
    edges = np.concatenate([np.stack([ring, np.roll(ring, -1, axis=0)], axis=1) for ring in rings])
    ends = edges.reshape(-1, 4)
    pairs = cKDTree(ends).query_ball_point(ends[:, [2, 3, 0, 1]], GRID)
    return tuple(edges[i] for i, partners in enumerate(pairs) if any(i < partner for partner in partners))


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
