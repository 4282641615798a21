"""Pieces side by side on a sheet, a roll or pages, so that little material is left over."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ....atlas import (
    Outlines,
    PageGrid,
    SheetPacking,
    pack_page_grid,
    pack_sheets,
    pack_strip,
    rotated_boxes,
    straight_angle,
)
from ....base import FloatArray
from ....errors import OptionError
from ..drawing.allowances import shapely
from ..drawing.labels import rotated
from ..drawing.shapes import PieceShape
from ..drawing.tiling import crossings, tiles_of
from ..papers import EDGE, OVERLAP, Paper
from ..result import Pattern

if TYPE_CHECKING:
    from shapely import Polygon

# Distance of what is cut out, mm.
GAP = 3.0
# Random changes of the plan of a sheet that are tried, for all its widths together.
TRIES = 150
# Cell of the grid on which pieces are placed, mm, and the smallest and the largest number of cells across a sheet.
CELL, MIN_COLUMNS, MAX_COLUMNS = 1.0, 400, 1_200
# Pages that the area of the pieces fills at most.
MAX_PAGES = 2000
# Widths of a sheet without a given one, relative to the square root of the area of the pieces.
WIDTHS = (1.1, 1.3, 1.6)
# Columns of pages side by side that are tried, around those of a square sheet.
MORE_COLUMNS = 2
# Rows of pages on which pieces may be placed, relative to those that their area fills.
MORE_PAGES = 2.0
# Angles tried for pieces without a grain: at most these, and so many for all pieces together.
TURNS, MAX_PLACEMENTS = 16, 480


def nested(pattern: Pattern) -> Pattern:
    """Return a pattern with its pieces side by side, at least GAP apart, allowances and tabs included.

    A grain remains upward or downward; other pieces take any angle. Where each piece fits on a
    page, pieces are distributed over the fewest pages, and none crosses the border of one. Otherwise, pages are
    put together to a sheet on which the fewest are needed, and then the fewest pieces cross their borders.

    Raises:
        OptionError: a piece is wider than the roll, or options of the pattern cannot be met.
    """
    pieces = _Pieces(_outlines(pattern.shapes), _angles(pattern.shapes, pattern.has_grain))
    return _moved(pattern, _packed(pieces, pattern.shapes, pattern.paper))


@dataclass(frozen=True, eq=False)
class _Pieces:
    outlines: Outlines
    angles: FloatArray

    @property
    def narrowest(self) -> float:
        """The width that the widest piece needs at its best angle."""
        return float(self.extents.real.min(axis=1).max())

    @cached_property
    def extents(self) -> NDArray[np.complex128]:
        """(k, t) the width of each piece at each angle, and i times its height."""
        return rotated_boxes(self.outlines, self.angles)[1]

    def strip(self, width: float, tries: int = TRIES) -> SheetPacking | None:
        """Return the pieces on a strip of a width; None if one is wider."""
        inner = width - 2 * EDGE
        packing = pack_strip(self.outlines, self.angles, GAP, inner, _columns(inner), tries)
        return None if packing is None else _inset(packing)

    def pages(self, paper: Paper) -> SheetPacking | None:
        """Return the pieces on the fewest pages; None if one is larger than a page."""
        width, height = paper.inner_width - 2 * EDGE, paper.inner_height - 2 * EDGE
        packing = pack_sheets(self.outlines, self.angles, GAP, width, height, _columns(width))
        return None if packing is None else _inset(packing)

    def page_grid(self, paper: Paper, columns: int, area: float) -> SheetPacking | None:
        """Return the pieces on pages that overlap, at most some columns of them; None if they have no place.

        Args:
            paper: the paper.
            columns: the number of columns.
            area: the area of the pieces, mm^2.
        """
        step = np.array([paper.inner_width, paper.inner_height]) - OVERLAP
        tallest = self.extents.imag.min(axis=1).max() / step[1]
        rows = int(np.ceil(MORE_PAGES * area / (columns * step.prod()) + tallest)) + 1
        grid = PageGrid(paper.inner_width, paper.inner_height, OVERLAP, EDGE, columns, rows)
        return pack_page_grid(self.outlines, self.angles, GAP, grid, _columns(columns * float(step[0])))


def _inset(packing: SheetPacking) -> SheetPacking:
    return replace(packing, shift=packing.shift + EDGE * (1 + 1j))


def _columns(width: float) -> int:
    return int(np.clip(np.ceil(width / CELL), MIN_COLUMNS, MAX_COLUMNS))


def _outlines(shapes: Sequence[PieceShape]) -> Outlines:
    sides, start = [], [0]
    for shape in shapes:
        rings = [ring[:, 0] + 1j * ring[:, 1] for ring in shape.cut_rings]
        sides += [np.stack([ring, np.roll(ring, -1)], axis=1) for ring in rings]
        start.append(start[-1] + sum(map(len, rings)))
    return Outlines(np.concatenate(sides), np.array(start))


def _angles(shapes: Sequence[PieceShape], has_grain: bool) -> FloatArray:
    """Return (k, t) the angles at which each piece may be placed."""
    if has_grain:
        return np.tile([0.0, np.pi], (len(shapes), 1))
    turns = 4 * min(max(MAX_PLACEMENTS // (4 * len(shapes)), 1), TURNS // 4)
    straight = [
        straight_angle(ring[:, 0] + 1j * ring[:, 1], np.empty(0))
        for ring in (shape.cut_rings[0] for shape in shapes)
    ]
    return np.array(straight)[:, None] + 2 * np.pi / turns * np.arange(turns)


def _packed(pieces: _Pieces, shapes: Sequence[PieceShape], paper: Paper) -> SheetPacking:
    area = sum(shape.cut.area for shape in shapes)
    if paper.width is not None and paper.height is not None:
        count = area / (paper.inner_width * paper.inner_height)
        if count > MAX_PAGES:
            raise OptionError(
                f"the pieces would fill {count:,.0f} pages of {paper.name}, more than {MAX_PAGES:,}: choose a smaller "
                "height or scale, or page none and an SVG or DXF file"
            )
        on_pages = pieces.pages(paper)
        return _fewest_pages(pieces, shapes, paper) if on_pages is None else _pages_in_rows(on_pages, paper)
    if paper.width is not None:
        packing = pieces.strip(paper.inner_width)
        if packing is None:
            raise OptionError(
                f"a piece is {pieces.narrowest:.0f} mm wide and the roll {paper.inner_width - 2 * EDGE:.0f} mm "
                "without its margins: choose a wider roll, a page size, or a smaller height"
            )
        return packing
    widths = {max(factor * area**0.5, 1.01 * pieces.narrowest + 2 * EDGE) for factor in WIDTHS}
    return min(_strips(pieces, sorted(widths)), key=lambda strip: strip[0] * strip[1].height)[1]


def _strips(pieces: _Pieces, widths: Sequence[float]) -> Iterator[tuple[float, SheetPacking]]:
    for width in widths:
        packing = pieces.strip(width, TRIES // len(widths))
        if packing is not None:
            yield width, packing


def _fewest_pages(pieces: _Pieces, shapes: Sequence[PieceShape], paper: Paper) -> SheetPacking:
    """Return the pieces on a sheet of pages that overlap, of which the fewest are needed.

    Pieces on strips of several widths are compared with pieces that are placed page by page.
    """
    step = paper.inner_width - OVERLAP
    min_columns = max(int(np.ceil((1.01 * pieces.narrowest + 2 * EDGE - OVERLAP) / step)), 1)
    area = sum(shape.cut.area for shape in shapes)
    square = max(round((1.2 * area) ** 0.5 / step), min_columns)
    counts = range(max(min_columns, square - MORE_COLUMNS), square + MORE_COLUMNS + 1)
    candidates = [packing for _, packing in _strips(pieces, [count * step + OVERLAP for count in counts])]
    on_grid = pieces.page_grid(paper, square + 1, area)
    if on_grid is not None:
        candidates.append(on_grid)

    def cost(packing: SheetPacking) -> tuple[int, int, float]:
        cut = _cut_out(shapes, packing)
        width, height = shapely().total_bounds(cut)[2:] + EDGE
        tiles = tiles_of(cut, width, height, paper)
        return len(tiles), crossings(cut, tiles), width * height

    return min(candidates, key=cost)


def _pages_in_rows(packing: SheetPacking, paper: Paper) -> SheetPacking:
    """Return pieces on pages with the pages side by side on a sheet that is about as wide as high, the first on top."""
    count = int(packing.sheet.max()) + 1
    columns = int(np.ceil(count**0.5))
    rows = -(-count // columns)
    row, column = np.divmod(packing.sheet, columns)
    corner = column * paper.inner_width + 1j * (rows - 1 - row) * paper.inner_height
    return replace(packing, shift=packing.shift + corner)


def _cut_out(shapes: Sequence[PieceShape], packing: SheetPacking) -> list[Polygon]:
    """Return what is cut out, placed by a packing."""

    def moved(polygon: Polygon, i: int) -> Polygon:
        return shapely().transform(polygon, lambda points: _placed_points(points, packing, i))

    return [moved(shape.cut, i) for i, shape in enumerate(shapes)]


def _placed_points(points: FloatArray, packing: SheetPacking, piece: int) -> FloatArray:
    shift = packing.shift[piece]
    return rotated(points, packing.angle[piece]) + np.array([shift.real, shift.imag])


def _moved(pattern: Pattern, packing: SheetPacking) -> Pattern:
    """Return a pattern with its pieces placed by a packing."""
    surface = pattern.surface
    points = surface.points.copy()
    for piece, members in enumerate(surface.points_of_pieces):
        points[members] = _placed_points(points[members], packing, piece)
    tabs = tuple(
        replace(tab, polygon=_placed_points(tab.polygon, packing, tab.piece)) for tab in pattern.tabs
    )
    return replace(pattern, surface=replace(surface, points=points), tabs=tabs)
