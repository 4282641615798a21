"""The assembly guide: the model, its pieces and seams, the map of the pages, and a ruler."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator

import numpy as np

from ...base import FloatArray, plural
from .drawing import Drawing, Text
from .finish import Finish
from .pages import Page, Picture, cut_shapes, page_map, ruler
from .papers import IN_INCHES, MARGIN, OVERLAP, Paper
from .report import piece_sizes
from .result import Pattern
from .tables import Table, laid_out
from .tiling import tiles_of
from .units import area_text, text_of_size
from .views import View, eye_and_up, view_of

# Pixels of pictures per millimetre: 200 per inch.
PIXELS = 200 / 25.4
# Heights of capitals: titles, texts and numbers of pieces on pictures at most, mm; distance of lines of text.
TITLE, BODY, NUMBER, LEADING = 5.0, 2.2, 3.4, 4.2
# Height of the pictures relative to that of the page.
PICTURES = 0.4
# Space between parts of a page, mm.
SPACE = 5.0


def guide_pages(pattern: Pattern, drawing: Drawing, paper: Paper, title: str) -> list[Page]:
    """Return the pages of the assembly guide of a pattern.

    Args:
        pattern: the pattern.
        drawing: its drawing.
        paper: the paper of the pattern; the guide of a roll, or of a page as large as the pattern, is on A4.
        title: the title of the first page.
    """
    own_paper = paper if paper.height is not None else Paper.of("A4")
    tables = [_piece_table(pattern, drawing, paper), *_seam_tables(pattern)]
    low = np.array([MARGIN, MARGIN])
    high = np.array([own_paper.width, own_paper.height], dtype=np.float64) - MARGIN
    return [_overview(pattern, drawing, paper, own_paper, title), *_table_pages(tables, low, high)]


def _table_pages(tables: list[Table], low: FloatArray, high: FloatArray) -> Iterator[Page]:
    width, height = high + MARGIN
    for lines, texts in laid_out(tables, low, high):
        yield Page(Drawing(float(width), float(height), tuple(lines), tuple(texts)))


def _overview(pattern: Pattern, drawing: Drawing, paper: Paper, own_paper: Paper, title: str) -> Page:
    width, height = own_paper.inner_width, own_paper.inner_height
    top = MARGIN + height
    texts = [Text(title, np.array([MARGIN + width / 2, top - TITLE / 2]), TITLE)]
    top -= TITLE + SPACE
    texts += _lines_of_text(_summary(pattern), width, top)
    top = min(float(text.place[1]) for text in texts) - SPACE
    pictures, numbers = _pictures(pattern, width, PICTURES * height, top)
    texts += numbers
    top -= PICTURES * height + SPACE
    about = [
        *_lines_of_text([*_how_to_read(pattern), *_how_to_join(drawing, paper), *pattern.notes], width, top)
    ]
    texts += about
    top = min(float(text.place[1]) for text in about) - SPACE
    rulers = ruler(np.array([MARGIN, MARGIN]), own_paper)
    lines, texts = [*rulers.lines], [*texts, *rulers.texts]
    bottom = MARGIN + (25.0 if own_paper.name in IN_INCHES else 14.0)
    if paper.height is not None and top - bottom > 2 * SPACE:
        small = page_map(drawing, paper, np.array([MARGIN, bottom]), np.array([width, top - bottom]))
        lines, texts = [*lines, *small.lines], [*texts, *small.texts]
    page = Drawing(width + 2 * MARGIN, height + 2 * MARGIN, tuple(lines), tuple(texts))
    return Page(page, pictures=tuple(pictures))


def _pictures(pattern: Pattern, width: float, height: float, top: float) -> tuple[list[Picture], list[Text]]:
    """Return the pictures of the model and of its pieces moved apart, with their numbers."""
    axis = pattern.settings.get("axis")
    eye, up = eye_and_up(pattern.surface, None if axis is None else np.asarray(axis))
    picture_width = (width - SPACE) / 2
    pixels = round(PIXELS * picture_width), round(PIXELS * height)
    pictures: list[Picture] = []
    texts: list[Text] = []
    # A single piece is shown from behind instead of moved apart.
    behind = 2 * (eye @ up) * up - eye
    second = (behind, False) if pattern.piece_count == 1 else (eye, True)
    for i, (direction, apart) in enumerate(((eye, False), second)):
        low = np.array([MARGIN + i * (picture_width + SPACE), top - height])
        view = view_of(pattern.surface, pixels, direction, up, apart)
        pictures.append(Picture(view.pixels, low, picture_width, height))
        texts += _numbers(view, low, picture_width, height)
    return pictures, texts


def _numbers(view: View, low: FloatArray, width: float, height: float) -> Iterator[Text]:
    for piece, (place, radius) in view.numbers.items():
        size = min(NUMBER, 0.9 * radius * height)
        yield Text(str(piece + 1), low + place * np.array([width, height]), size)


def _summary(pattern: Pattern) -> list[str]:
    """Return what the pattern is, in a few lines."""
    extents = np.ptp(pattern.surface.mesh.vertices, axis=0).tolist()
    seams = plural(len(pattern.seams) - len(pattern.darts), "seam")
    darts = f", {plural(len(pattern.darts), 'dart')}" if pattern.darts else ""
    strain = float(np.abs(pattern.strains).max())
    stretched = f"; lengths change by at most {100 * strain:.2g} %" if strain > 1e-6 else ""
    finish = Finish.of(pattern.kind, pattern.settings)
    allowance = (
        f"seam allowance {finish.allowance:g} mm, included" if finish.allowance else "no seam allowance"
    )
    return [
        f"{pattern.kind}: {plural(pattern.piece_count, 'piece')}, {seams}{darts}; "
        f"finished size {text_of_size(extents)}",
        f"{allowance}{stretched}",
    ]


def _how_to_read(pattern: Pattern) -> Iterator[str]:
    """Yield what the lines and texts mean."""
    if pattern.piece_count > 1:
        yield "A (2) at a side: this is seam A, and piece 2 is on the other side of it. Solid black lines are cut."
    else:
        yield "Sides with the same name meet. Solid black lines are cut."
    if pattern.is_sewn:
        yield (
            "Grey dashed lines are sewn. Notches match on both sides of a seam; the double one is the same on both."
        )
    if pattern.has_grain:
        yield "The arrow is the grain."
    if pattern.darts:
        yield "A dart is sewn together along its two sides, from the border to its tip, which is marked by a circle."
    if len(pattern.folds) or pattern.bends or pattern.tabs:
        yield (
            "Blue lines are folded: away from you where dash-dotted (mountains), towards you where dashed (valleys), "
            "by the angle that is written there."
        )
    if any(bend.radius for bend in pattern.bends):
        yield "R is the radius of a bend of the surface, mm; its line is the middle of what is bent."
    eased = [seam for seam in pattern.seams if seam.is_eased]
    if eased:
        yield f"{plural(len(eased), 'seam')} with sides of different lengths: ease in the longer side evenly."


def _how_to_join(drawing: Drawing, paper: Paper) -> Iterator[str]:
    if paper.height is None:
        return
    tiles = tiles_of(cut_shapes(drawing), drawing.width, drawing.height, paper)
    yield "Print at 100 % (actual size), without fitting to the page, and measure the ruler below."
    if len(tiles) > 1 and tiles[0].overlaps:
        yield (
            f"Pages overlap by {OVERLAP:g} mm: cut along the marks on one side, and join them so that the lines meet. "
            "The map shows which page is where."
        )
    elif len(tiles) > 1:
        yield "No piece crosses the border of a page."


def _lines_of_text(paragraphs: list[str], width: float, top: float) -> Iterator[Text]:
    """Yield centred lines of text from the top downward."""
    columns = int(width / (0.78 * BODY))
    lines = [line for paragraph in paragraphs for line in textwrap.wrap(paragraph, columns)]
    for i, line in enumerate(lines):
        yield Text(line, np.array([MARGIN + width / 2, top - i * LEADING - BODY / 2]), BODY)


def _piece_table(pattern: Pattern, drawing: Drawing, paper: Paper) -> Table:
    sizes = piece_sizes(pattern)
    pages = _pages_of_pieces(pattern, drawing, paper)
    rows = tuple(
        (str(i + 1), "1", f"{width:.0f} x {height:.0f}", area_text(area), pages[i])
        for i, (width, height, area) in enumerate(sizes)
    )
    return Table("Pieces", ("number", "cut", "size, mm", "area", "pages"), rows)


def _pages_of_pieces(pattern: Pattern, drawing: Drawing, paper: Paper) -> list[str]:
    """Return the names of the first and the last page on which each piece is."""
    tiles = tiles_of(cut_shapes(drawing), drawing.width, drawing.height, paper)
    surface, names = pattern.surface, []
    for piece in range(pattern.piece_count):
        points = surface.points[np.unique(surface.corners[surface.pieces == piece])]
        low, high = points.min(axis=0), points.max(axis=0)
        tile_names = [tile.name for tile in tiles if (tile.low < high).all() and (tile.high > low).all()]
        names.append(" to ".join(dict.fromkeys([*tile_names[:1], *tile_names[-1:]])))
    return names


def _seam_tables(pattern: Pattern) -> Iterator[Table]:
    if not pattern.seams:
        return
    rows, has_ease = [], any(seam.is_eased for seam in pattern.seams)
    for seam in pattern.seams:
        first, second = (side.piece + 1 for side in seam.sides)
        pieces = (
            f"dart in {first}"
            if seam in pattern.darts
            else f"{first} and {second}"
            if first != second
            else f"{first}, itself"
        )
        ease = f"{seam.ease:.1f}" if seam.is_eased else ""
        rows.append((seam.name, pieces, f"{max(seam.lengths):.1f}", *([ease] if has_ease else [])))
    columns = "name", "pieces", "length, mm", *(["ease, mm"] if has_ease else [])
    yield Table("Seams", columns, tuple(rows))
