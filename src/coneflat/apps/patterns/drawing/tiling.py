"""Tiles: the parts of a sheet that are printed on pages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil
from typing import TYPE_CHECKING

import numpy as np

from ....base import FloatArray
from ..papers import EDGE, OVERLAP, Paper
from ..pieces.numbering import letters
from .allowances import shapely

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

    def shows(self, shape: Polygon) -> bool:
        """Return whether any part of a shape is on the tile."""
        return bool(shape.intersection(shapely().box(*self.low, *self.high)).area > ROUNDING)


def tiles_of(shapes: Sequence[Polygon], width: float, height: float, paper: Paper) -> list[Tile]:
    """Return the tiles of a sheet with anything on them, row by row from the top.

    Tiles overlap, unless no piece crosses the borders of pages side by side. A page as large as the sheet is a single
    tile, and the last one of a roll ends with the sheet.

    Args:
        shapes: what is cut out of the sheet.
        width, height: size of the sheet, mm.
        paper: the paper.
    """
    if paper.width is None:
        size = np.array([width, height])
    elif paper.height is None:
        size = np.array([min(paper.inner_width, width), min(paper.inner_height, height)])
    else:
        size = np.array([paper.inner_width, paper.inner_height])
    tiles = _tiles(shapes, width, height, size, 0.0)
    if crossings(shapes, tiles):
        tiles = _tiles(shapes, width, height, size, OVERLAP)
    if paper.height is not None:
        return tiles
    return [replace(tile, high=np.minimum(tile.high, [width, height])) for tile in tiles]


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
    covered = _needed(shapes, corners, size)

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


def _needed(
    shapes: Sequence[Polygon], corners: Mapping[tuple[int, int], FloatArray], size: FloatArray
) -> set[tuple[int, int]]:
    """Return the places of the tiles that are needed: with something on them that no other one of them shows.

    Args:
        shapes: what is cut out of the sheet.
        corners: the lower left corner of the tile of each row and column.
        size: (2,) the size of tiles, mm.
    """
    contents = {}
    for place, low in corners.items():
        on_tile = shapely().intersection(np.array(shapes), shapely().box(*low, *(low + size)))
        if shapely().area(on_tile).max() > ROUNDING:
            contents[place] = shapely().union_all(on_tile)
    needed = set(contents)
    # Those with the least on them are left out first.
    for row, column in sorted(contents, key=lambda place: (round(contents[place].area, 3), place)):
        neighbours = needed & {(row + i, column + j) for i in (-1, 0, 1) for j in (-1, 0, 1)}
        shown = [
            shapely().box(*(corners[place] + EDGE / 2), *(corners[place] + size - EDGE / 2))
            for place in neighbours - {(row, column)}
        ]
        hidden = shapely().difference(contents[row, column], shapely().union_all(shown))
        if hidden.area <= ROUNDING:
            needed.remove((row, column))
    return needed


def crossings(shapes: Sequence[Polygon], tiles: Sequence[Tile]) -> int:
    """Return the number of shapes that are on no single tile completely."""
    bounds = shapely().bounds(np.array(shapes))
    is_inside = np.zeros(len(bounds), dtype=bool)
    for tile in tiles:
        is_inside |= (bounds[:, :2] >= tile.low - ROUNDING).all(axis=1) & (
            bounds[:, 2:] <= tile.high + ROUNDING
        ).all(axis=1)
    return int((~is_inside).sum())
