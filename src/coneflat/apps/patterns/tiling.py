"""Tiles: the parts of a sheet that are printed on pages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from typing import TYPE_CHECKING

import numpy as np

from ...base import FloatArray
from .allowances import shapely
from .borders import letters
from .papers import OVERLAP, Paper

if TYPE_CHECKING:
    from shapely import Polygon

# Areas and distances that are left to rounding, mm^2 and mm.
ROUNDING = 1e-6


@dataclass(frozen=True, eq=False)
class Tile:
    """The part of a sheet on a page.

    Attributes:
        name: a letter for the row, from the top, and a number for the column.
        low, high: (2,) its lower left and its upper right corner on the sheet, mm.
        neighbours: the names of the tiles on the left, below, on the right and above; "" where there is none.
        overlaps: whether neighbouring tiles overlap by OVERLAP.
    """

    name: str
    low: FloatArray
    high: FloatArray
    neighbours: tuple[str, str, str, str]
    overlaps: bool


def tiles_of(shapes: Sequence[Polygon], width: float, height: float, paper: Paper) -> list[Tile]:
    """Return the tiles of a sheet with anything on them, row by row from the top.

    Tiles overlap, unless no piece crosses the borders of pages side by side.

    Args:
        shapes: what is cut out of the sheet.
        width, height: size of the sheet, mm.
        paper: the paper.
    """
    size = np.array([min(paper.inner_width, width), min(paper.inner_height, height)])
    if paper.height is not None:
        size = np.array([paper.inner_width, paper.inner_height])
    side_by_side = _tiles(shapes, width, height, size, 0.0)
    if _are_whole(shapes, side_by_side):
        return side_by_side
    return _tiles(shapes, width, height, size, OVERLAP)


def _tiles(
    shapes: Sequence[Polygon], width: float, height: float, size: FloatArray, overlap: float
) -> list[Tile]:
    step = size - overlap
    counts = [
        max(ceil((extent - overlap) / pitch - ROUNDING), 1)
        for extent, pitch in zip((width, height), step, strict=True)
    ]
    corners = {
        (row, column): np.array([column * step[0], (counts[1] - 1 - row) * step[1]])
        for row in range(counts[1])
        for column in range(counts[0])
    }
    covered = {
        place
        for place, low in corners.items()
        if shapely().area(shapely().intersection(np.array(shapes), shapely().box(*low, *(low + size)))).max()
        > ROUNDING
    }

    def name(row: int, column: int) -> str:
        return f"{letters(row)}{column + 1}" if (row, column) in covered else ""

    return [
        Tile(
            name(row, column),
            low,
            low + size,
            (name(row, column - 1), name(row + 1, column), name(row, column + 1), name(row - 1, column)),
            overlap > 0,
        )
        for (row, column), low in corners.items()
        if (row, column) in covered
    ]


def _are_whole(shapes: Sequence[Polygon], tiles: Sequence[Tile]) -> bool:
    """Return whether each shape is on a single tile."""
    bounds = shapely().bounds(np.array(shapes))
    is_inside = np.zeros(len(bounds), dtype=bool)
    for tile in tiles:
        is_inside |= (bounds[:, :2] >= tile.low - ROUNDING).all(axis=1) & (
            bounds[:, 2:] <= tile.high + ROUNDING
        ).all(axis=1)
    return bool(is_inside.all())
