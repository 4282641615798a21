"""Pages of a PDF: a drawing divided into tiles, with what is needed to put them together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ....base import FloatArray
from ....errors import OptionError
from ..drawing.drawing import Drawing, Line, Text
from ..drawing.labels import box_of, fitted_size
from ..drawing.tiling import Tile
from ..papers import IN_INCHES, LONGEST, MARGIN, NARROWEST, RULER, Paper

# Length of crop marks, gap between them and the corner, and radius of registration marks, mm.
CROP, CROP_GAP, REGISTRATION = 6.0, 1.5, 2.0
# Height of capitals in margins, mm; share of the width of a page that the title takes there, between the names of
# neighbours.
MARGIN_TEXT, TITLE_SHARE = 2.2, 0.45
#: Length of the ruler in inches, and the height of the longest ticks of rulers, mm.
RULER_INCHES, TICK = 4, 4.0
INCH = 25.4


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture on a page.

    Attributes:
        pixels: (h, w, 3) colours from 0 to 255, the first row at the top.
        low: (2,) its lower left corner, mm.
        width, height: its size on the page, mm.
    """

    pixels: NDArray[np.uint8]
    low: FloatArray
    width: float
    height: float


@dataclass(frozen=True, eq=False)
class Page:
    """A page.

    Attributes:
        drawing: what is drawn on it; its size is that of the page.
        window: (2, 2) the lower left and the upper right corner of the part in which `content` is visible.
        content: a drawing in the place in which it appears on the page, visible in the window only.
        pictures: pictures, below everything else.
    """

    drawing: Drawing
    window: FloatArray | None = None
    content: Drawing | None = None
    pictures: tuple[Picture, ...] = ()


def tiled(drawing: Drawing, tiles: Sequence[Tile], paper: Paper, title: str) -> list[Page]:
    """Return the pages of a drawing on a sheet, one for each tile.

    On rolls, and pages as large as the drawing, there is a ruler below the drawing.

    Args:
        drawing: the drawing.
        tiles: the parts of it that are printed.
        paper: the paper.
        title: text in the margin of every page.

    Raises:
        OptionError: a page as large as the drawing would be larger than a PDF allows.
    """
    pages = [_page(drawing, tile, paper, len(tiles), title) for tile in tiles]
    for page in pages:
        if max(page.drawing.width, page.drawing.height) > LONGEST:
            raise OptionError(
                f"a page of {page.drawing.width:.0f} x {page.drawing.height:.0f} mm is larger than the {LONGEST:g} mm "
                "that a PDF allows: choose a page size or a roll, or write an SVG or DXF file"
            )
    return pages


def _page(drawing: Drawing, tile: Tile, paper: Paper, count: int, title: str) -> Page:
    low = np.array([MARGIN, paper.below])
    size = tile.high - tile.low
    width, height = np.maximum(size + low + MARGIN, [NARROWEST, 0.0])
    lines: list[Line] = []
    name = f"{title}   page {tile.name} of {count}" if count > 1 else title
    place = np.array([width / 2, MARGIN / 2])
    texts = [Text(name, place, fitted_size(name, MARGIN_TEXT, TITLE_SHARE * float(width)))]
    if tile.overlaps and count > 1:
        lines += _crop_marks(low, low + size)
        texts += _neighbours(tile, low, low + size)
    if paper.height is None:
        rulers = ruler(np.array([MARGIN, MARGIN]), paper)
        lines, texts = [*lines, *rulers.lines], [*texts, *rulers.texts]
    marks = Drawing(float(width), float(height), tuple(lines), tuple(texts))
    return Page(marks, np.array([low, low + size]), _visible(drawing, tile).moved(low - tile.low))


def _visible(drawing: Drawing, tile: Tile) -> Drawing:
    """Return what of a drawing is on a tile, or touches its box."""

    def is_visible(points: FloatArray) -> bool:
        return bool((points.max(axis=0) >= tile.low).all() and (points.min(axis=0) <= tile.high).all())

    lines = tuple(line for line in drawing.lines if is_visible(line.points))
    texts = tuple(text for text in drawing.texts if is_visible(np.asarray(box_of(text).exterior.coords)))
    return Drawing(drawing.width, drawing.height, lines, texts)


def _crop_marks(low: FloatArray, high: FloatArray) -> Iterator[Line]:
    """Yield lines in the margins that show where a page is cut, and crosses where pages that overlap meet."""
    for corner, away in (
        (low, (-1, -1)),
        (high, (1, 1)),
        ((high[0], low[1]), (1, -1)),
        ((low[0], high[1]), (-1, 1)),
    ):
        for axis in (0, 1):
            arm = np.zeros(2)
            arm[axis] = away[axis]
            yield Line("mark", corner + np.outer([CROP_GAP, CROP_GAP + CROP], arm))
    middle = (low + high) / 2
    for place in ((low[0], middle[1]), (high[0], middle[1]), (middle[0], low[1]), (middle[0], high[1])):
        for arm in np.eye(2):
            yield Line("mark", np.array(place) + np.outer([-REGISTRATION, REGISTRATION], arm))


def _neighbours(tile: Tile, low: FloatArray, high: FloatArray) -> Iterator[Text]:
    """Yield the names of the tiles beside one, in the margins."""
    share = low + 0.25 * (high - low)
    left, below, right, above = tile.neighbours
    half = MARGIN / 2
    for name, place, angle in (
        (left, (low[0] - half, share[1]), np.pi / 2),
        (below, (share[0], low[1] - half), 0.0),
        (right, (high[0] + half, share[1]), np.pi / 2),
        (above, (share[0], high[1] + half), 0.0),
    ):
        if name:
            yield Text(f"to {name}", np.array(place), MARGIN_TEXT, angle)


def ruler(low: FloatArray, paper: Paper) -> Drawing:
    """Return a ruler of 100 mm with its lower left end at a place, and for papers in inches one of 4 inches above."""
    lines, texts = _ruler(low, RULER, 1.0, f"{RULER} mm: measure this line after printing")
    if paper.name in IN_INCHES:
        above = low + np.array([0.0, 3 * TICK])
        more_lines, more_texts = _ruler(above, RULER_INCHES, INCH, f"{RULER_INCHES} inches")
        lines, texts = [*lines, *more_lines], [*texts, *more_texts]
    return Drawing(0.0, 0.0, tuple(lines), tuple(texts))


def _ruler(low: FloatArray, count: int, unit: float, name: str) -> tuple[list[Line], list[Text]]:
    lines = [Line("mark", low + np.array([[0.0, 0.0], [count * unit, 0.0]]))]
    step = 5 if count > 50 else 1
    for i in range(0, count + 1, step):
        tick = TICK if i % (2 * step) == 0 else TICK / 2
        lines.append(Line("mark", low + np.array([[i * unit, 0.0], [i * unit, tick]])))
    place = low + np.array([count * unit / 2, TICK + MARGIN_TEXT])
    return lines, [Text(name, place, MARGIN_TEXT)]


def page_map(drawing: Drawing, tiles: Sequence[Tile], low: FloatArray, size: FloatArray) -> Drawing:
    """Return a small picture of the sheet with its pages and their names.

    Args:
        drawing: the drawing on the sheet.
        tiles: its pages.
        low: (2,) the lower left corner of the place for it, mm.
        size: (2,) the width and height of the place, mm.
    """
    corners = np.array([corner for tile in tiles for corner in (tile.low, tile.high)])
    first, extent = corners.min(axis=0), np.ptp(corners, axis=0)
    scale = float((size / extent).min())
    shift = low + (size - scale * extent) / 2
    lines = [
        replace(line, layer="mark", points=shift + scale * (line.points - first), dashes=())
        for line in drawing.lines
        if line.layer == "cut"
    ]
    texts = []
    for tile in tiles:
        a, b = shift + scale * (tile.low - first), shift + scale * (tile.high - first)
        lines.append(Line("fold", np.array([a, [b[0], a[1]], b, [a[0], b[1]]]), is_closed=True))
        height = min(4.0, 0.3 * float((b - a).min()))
        texts.append(Text(tile.name, (a + b) / 2, height))
    return Drawing(0.0, 0.0, tuple(lines), tuple(texts))
