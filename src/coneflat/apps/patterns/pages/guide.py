"""The assembly guide: the model, its pieces and seams, the map of the pages, and a ruler."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ....base import FloatArray, plural
from ..drawing.drawing import Drawing, Text
from ..drawing.labels import fitted_size
from ..papers import DEFAULT_PAPER, IN_INCHES, MARGIN, Paper
from ..report import piece_sizes
from ..result import Pattern
from ..units import EXACT_STRAIN, area_text, percentage, text_of_size
from .pages import Page, Picture, page_map, ruler
from .steps import allowance_text, steps_of
from .strain_map import is_strained, strain_map
from .tables import Table, laid_out
from .views import View, eye_and_up, view_of

# Pixels of pictures per millimetre: 200 per inch.
PIXELS = 200 / 25.4
# Heights of capitals: titles, texts and numbers of pieces on pictures at most, mm; distance of lines of text.
TITLE, BODY, NUMBER, LEADING = 5.0, 2.3, 3.4, 4.4
# Width of the numbers of a list, mm.
INDENT = 6.0
# Height of the pictures relative to that of the page, and the smallest one for notes on the same page, and for steps.
PICTURES, MIN_WITH_NOTES, MIN_PICTURES = 0.4, 0.25, 0.15
# Widths of a column of text beside the map of the pages, or that of the strain alone, relative to the page; mean width
# of a character of longer texts relative to the height of capitals.
TEXT_SHARE, HALF, CHARACTER = 0.66, 0.5, 0.76
# Space between parts of a page, mm.
SPACE = 5.0


def guide_pages(pattern: Pattern, title: str) -> list[Page]:
    """Return the pages of the assembly guide of a pattern, on its paper, or on a page of the default size.

    Args:
        pattern: the pattern.
        title: the title of the first page.
    """
    paper = pattern.paper if pattern.paper.height is not None else Paper.of(DEFAULT_PAPER)
    tables = [_piece_table(pattern), *_seam_tables(pattern)]
    low = np.array([MARGIN, MARGIN])
    high = np.array([paper.width, paper.height], dtype=np.float64) - MARGIN
    return [*_overview(pattern, paper, title), *_table_pages(tables, low, high)]


def _table_pages(tables: list[Table], low: FloatArray, high: FloatArray) -> Iterator[Page]:
    width, height = high + MARGIN
    for lines, texts in laid_out(tables, low, high):
        yield Page(Drawing(float(width), float(height), tuple(lines), tuple(texts)))


def _overview(pattern: Pattern, paper: Paper, title: str) -> Iterator[Page]:
    """Yield the first page, and a page of notes if there is no room for them; paper: that of the guide."""
    width, height = paper.inner_width, paper.inner_height
    rulers = ruler(np.array([MARGIN, MARGIN]), paper)
    bottom = MARGIN + (25.0 if paper.name in IN_INCHES else 14.0)
    top = MARGIN + height
    title_size = fitted_size(title, TITLE, width)
    texts = [Text(title, np.array([MARGIN, top - TITLE / 2]), title_size, is_left=True)]
    top -= TITLE + SPACE
    texts += _lines_of_text(_summary(pattern), width, top)
    top = min(float(text.place[1]) for text in texts) - SPACE
    # The map is beside the text. Pictures are smaller where steps need their room.
    has_map, has_strain = len(pattern.tiles) > 1, is_strained(pattern)
    column = (TEXT_SHARE if has_map else HALF if has_strain else 1.0) * width
    steps = [*_list_of_text(steps_of(pattern), column, 0.0)]
    sentences = [_sentence(note) for note in (*pattern.notes, *pattern.drawing().notes)]
    room = top - bottom + float(steps[-1].place[1]) - 3 * SPACE
    room_with_notes = room - _height_of_list(sentences, column)
    if room_with_notes >= MIN_WITH_NOTES * height:
        room = room_with_notes
    picture_height = max(min(PICTURES * height, room), MIN_PICTURES * height)
    pictures, numbers = _pictures(pattern, width, picture_height, top)
    top -= picture_height + SPACE
    texts += [*numbers, *(replace(text, place=text.place + np.array([0.0, top])) for text in steps)]
    text_top = top + float(steps[-1].place[1]) - SPACE
    notes = [*_list_of_text(sentences, column, text_top, numbered=False)]
    have_room = not notes or float(notes[-1].place[1]) > bottom
    texts += notes if have_room else []
    lines, texts = [*rulers.lines], [*texts, *rulers.texts]
    # Both maps share the column beside the text.
    place = np.array([MARGIN + column + SPACE, bottom])
    extent = np.array([width - column - SPACE, (top - bottom) / (has_map + has_strain or 1)])
    if has_strain:
        strain_pictures, legend = strain_map(pattern, place, extent - np.array([0.0, has_map * SPACE]))
        pictures, texts = [*pictures, *strain_pictures], [*texts, *legend.texts]
        place = place + np.array([0.0, extent[1]])
    if has_map:
        small = page_map(pattern.drawing(), pattern.tiles, place, extent)
        lines, texts = [*lines, *small.lines], [*texts, *small.texts]
    size = width + 2 * MARGIN, height + 2 * MARGIN
    yield Page(Drawing(*size, tuple(lines), tuple(texts)), pictures=tuple(pictures))
    if not have_room:
        notes = [*_list_of_text(sentences, width, MARGIN + height, numbered=False)]
        yield Page(Drawing(*size, (), tuple(notes)))


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
    count = sum(not seam.is_dart for seam in pattern.seams)
    seams = f", {plural(count, 'seam')}" if count else ""
    cuts, noun = (pattern.darts, "dart") if pattern.is_sewn else (pattern.corner_cuts, "corner cut")
    darts = f", {plural(len(cuts), noun)}" if cuts else ""
    strain = float(np.abs(pattern.strains).max())
    stretched = f"; edges change by at most {percentage(strain)}" if strain > EXACT_STRAIN else ""
    allowance = allowance_text(pattern)
    included = f"the {allowance} included" if allowance else "no seam allowance"
    return [
        f"{pattern.kind}: {plural(pattern.piece_count, 'piece')}{seams}{darts}; "
        f"finished size {text_of_size(extents)}",
        f"{included}{stretched}",
    ]


def _list_of_text(items: Sequence[str], width: float, top: float, numbered: bool = True) -> Iterator[Text]:
    """Yield the lines of a list, from the top downward: with numbers, or with dots."""
    columns = int((width - INDENT) / (CHARACTER * BODY))
    y = top - BODY / 2
    for i, item in enumerate(items):
        mark = f"{i + 1}." if numbered else "\u2022"
        yield Text(mark, np.array([MARGIN, y]), BODY, is_left=True)
        for line in textwrap.wrap(item, columns):
            yield Text(line, np.array([MARGIN + INDENT, y]), BODY, is_left=True)
            y -= LEADING
        y -= LEADING / 4


def _height_of_list(items: Sequence[str], width: float) -> float:
    """Return the height of a list without numbers, with the space above it; 0 if it is empty."""
    if not items:
        return 0.0
    *_, last = _list_of_text(items, width, 0.0, numbered=False)
    return SPACE + LEADING - float(last.place[1])


def _sentence(note: str) -> str:
    """Return a note with a capital and a full stop."""
    return f"{note[0].upper()}{note[1:].removesuffix('.')}."


def _lines_of_text(paragraphs: Sequence[str], width: float, top: float) -> Iterator[Text]:
    """Yield lines of text from the top downward."""
    columns = int(width / (CHARACTER * BODY))
    lines = [line for paragraph in paragraphs for line in textwrap.wrap(paragraph, columns)]
    for i, line in enumerate(lines):
        yield Text(line, np.array([MARGIN, top - i * LEADING - BODY / 2]), BODY, is_left=True)


def _piece_table(pattern: Pattern) -> Table:
    sizes = piece_sizes(pattern)
    pages = _pages_of_pieces(pattern)
    shapes = _shape_texts(pattern)
    has_shapes = any(shapes)
    rows = tuple(
        (
            str(i + 1),
            "1",
            f"{width:.0f} x {height:.0f}",
            area_text(area),
            pages[i],
            *([shapes[i]] if has_shapes else []),
        )
        for i, (width, height, area) in enumerate(sizes)
    )
    columns = "number", "cut", "size, mm", "area", "pages", *(["shape"] if has_shapes else [])
    return Table("Pieces", columns, rows)


def _shape_texts(pattern: Pattern) -> list[str]:
    """Return of each piece which other one has its shape, and of which one it is the mirror image."""
    copies = pattern.counterparts
    return [
        ", ".join(
            [
                *([f"as {equal + 1}"] if equal is not None else []),
                *([f"mirror image of {mirrored + 1}"] if mirrored is not None else []),
            ]
        )
        for equal, mirrored in zip(copies.equal, copies.mirrored, strict=True)
    ]


def _pages_of_pieces(pattern: Pattern) -> list[str]:
    """Return the names of the first and the last page on which each piece is, with its allowance and tabs."""
    names = []
    for shape in pattern.shapes:
        on_pages = [tile.name for tile in pattern.tiles if tile.shows(shape.cut)]
        names.append(" to ".join(dict.fromkeys([*on_pages[:1], *on_pages[-1:]])))
    return names


def _seam_tables(pattern: Pattern) -> Iterator[Table]:
    if not pattern.seams:
        return
    rows, has_ease = [], any(seam.is_eased for seam in pattern.seams)
    for seam in pattern.seams:
        first, second = (side.piece + 1 for side in seam.sides)
        pieces = (
            f"{'dart' if pattern.is_sewn else 'corner cut'} in {first}"
            if seam.is_dart
            else f"{first} and {second}"
            if first != second
            else f"{first}, itself"
        )
        ease = f"{seam.ease:.1f}" if seam.is_eased else ""
        rows.append((seam.name, pieces, f"{max(seam.lengths):.1f}", *([ease] if has_ease else [])))
    columns = "name", "pieces", "length, mm", *(["ease, mm"] if has_ease else [])
    yield Table("Seams", columns, tuple(rows))
