"""Papers and tiles, rulers and the map of pages."""

from __future__ import annotations

from dataclasses import replace
from math import ceil

import numpy as np
import polyhedra
import pytest
from flat_pieces import annulus, gores, sheet, two_pieces

import coneflat
from coneflat import Pattern
from coneflat.apps.patterns.drawing.labels import CHARACTER_WIDTH, box_of
from coneflat.apps.patterns.drawing.tiling import tiles_of
from coneflat.apps.patterns.pages.assembly import pattern_pages
from coneflat.apps.patterns.pages.guide import CHARACTER
from coneflat.apps.patterns.pages.nesting import nested
from coneflat.apps.patterns.pages.pages import page_map, ruler
from coneflat.apps.patterns.papers import LONGEST, MARGIN, PAGE_SIZES, RULER, Paper
from coneflat.errors import OptionError

shapely = pytest.importorskip("shapely")


def square(side: float, low=(1.0, 1.0)):
    return shapely.box(*low, low[0] + side, low[1] + side)


def pages_of(pattern):
    return pattern_pages(pattern, "toy")


def tile_pages(pattern):
    return [page for page in pages_of(pattern) if page.content is not None]


@pytest.mark.parametrize("name", PAGE_SIZES)
def test_papers_have_a_size(name):
    paper = Paper.of(name.upper())
    assert (paper.width, paper.height) == PAGE_SIZES[name]
    assert paper.inner_width == pytest.approx(paper.width - 20)


@pytest.mark.parametrize(
    "name", ["A9", "roll", "roll:", "roll:3mm", "roll:119mm", "roll:5.1m", "roll:900kg", "letterbox", ""]
)
def test_other_papers_are_errors(name):
    with pytest.raises(OptionError, match="page must be A0, A1, .* or a roll of 120 to 5080 mm such as"):
        Paper.of(name)


def test_rolls_take_any_unit():
    assert Paper.of("roll:36in").width == pytest.approx(914.4)


def test_the_number_of_tiles_follows_from_the_overlap():
    # 190 + 180 + 180 >= 401, and 277 + 267 >= 401.
    tiles = tiles_of([square(400)], 402.0, 402.0, Paper.of("A4"))
    assert [tile.name for tile in tiles] == ["A1", "A2", "A3", "B1", "B2", "B3"]
    assert tiles[0].overlaps
    assert tiles[0].high[0] - tiles[1].low[0] == pytest.approx(10)
    assert tiles[3].high[1] - tiles[0].low[1] == pytest.approx(10)
    assert tiles[1].neighbours == ("A1", "B2", "A3", "")
    covered = shapely.union_all([shapely.box(*tile.low, *tile.high) for tile in tiles])
    assert covered.covers(square(400))


def test_empty_tiles_are_left_out():
    shapes = [square(60), square(60, (330.0, 330.0)), shapely.box(1, 100, 260, 120)]
    tiles = tiles_of(shapes, 391.0, 391.0, Paper.of("A4"))
    assert [tile.name for tile in tiles] == ["A2", "A3", "B1", "B2"]
    assert tiles[0].neighbours == ("", "B2", "A3", "")


def test_a_tile_whose_content_other_tiles_show_is_left_out():
    # The square reaches 5 mm into the tile on the right, which the first tile shows, too; at 12 mm it does not.
    wide = [shapely.box(1, 1, 350, 20)]
    shown, beyond = square(60, (125.0, 100.0)), square(60, (132.0, 100.0))
    assert [tile.name for tile in tiles_of([*wide, shown], 351.0, 500.0, Paper.of("A4"))] == ["B1", "B2"]
    tall = shapely.box(1, 1, 20, 300)
    names = [
        [tile.name for tile in tiles_of([tall, part], 351.0, 301.0, Paper.of("A4"))]
        for part in (shown, beyond)
    ]
    assert names == [["A1", "B1"], ["A1", "B1", "B2"]]


def test_a_tile_inside_a_large_piece_is_not_left_out():
    assert len(tiles_of([square(900)], 902.0, 902.0, Paper.of("A4"))) == 5 * 4


def test_tiles_do_not_overlap_where_no_piece_crosses_their_borders():
    tiles = tiles_of([square(150), square(150, (191.0, 1.0))], 342.0, 152.0, Paper.of("A4"))
    assert [tile.name for tile in tiles] == ["A1", "A2"]
    assert not tiles[0].overlaps
    assert tiles[0].high[0] == tiles[1].low[0]


def test_each_point_of_a_line_is_visible_on_a_page_at_its_true_size():
    pattern = nested(Pattern("sheet", sheet(500.0, 350.0), 1.0, settings={"page": "A4"}))
    drawing = pattern.drawing()
    seen = {}
    for page in tile_pages(pattern):
        low, high = page.window
        assert (high - low).tolist() == pytest.approx([190, 277])
        for line in page.content.lines:
            if line.layer == "cut":
                ring = shapely.LinearRing(line.points)
                shift = tuple(np.round(drawing.lines[0].points[0] - line.points[0], 9))
                seen[shift] = shapely.transform(
                    shapely.intersection(ring, shapely.box(*low, *high)), lambda points, s=shift: points + s
                )
    border = shapely.LinearRing(drawing.lines[0].points)
    joined = shapely.union_all(list(seen.values()))
    assert len(seen) == 4
    assert joined.hausdorff_distance(border) < 1e-6


PLAIN = {"cloth": two_pieces, "gores": gores}
LONG = "A name of a file that is much longer than the page is wide, with its date and version 2026-11-30"


@pytest.mark.parametrize("page", ["A4", "A5", "letter", "none", "roll:120mm"])
@pytest.mark.parametrize("kind", [*PLAIN, "net", "sheet"])
def test_nothing_is_outside_of_a_page(kind, page):
    if kind in PLAIN:
        pattern = PLAIN[kind](page=page)
    else:
        side = polyhedra.turned([0.3, 0.3], [0.0, 0.5], 7) if kind == "sheet" else polyhedra.icosphere(1)
        pattern = coneflat.pattern(side.vertices, side.faces, kind=kind, height="30mm", page=page)
    notes = tuple(f"note {i}: {'some words about it, ' * 4}and more" for i in range(3))
    pattern, share = nested(replace(pattern, notes=notes)), CHARACTER / CHARACTER_WIDTH
    for sheet_of_paper in pattern_pages(pattern, LONG):
        drawing = sheet_of_paper.drawing
        box = shapely.box(0, 0, drawing.width, drawing.height)
        # Boxes of texts are rather too wide; the mean width of characters is that of longer texts.
        texts = [
            box_of(replace(text, text=text.text[: ceil(share * len(text.text))])) for text in drawing.texts
        ]
        assert all(box.covers(text) for text in texts)
        assert all(box.covers(shapely.LineString(line.points)) for line in drawing.lines)
        for picture in sheet_of_paper.pictures:
            high = picture.low + np.array([picture.width, picture.height])
            assert box.covers(shapely.box(*picture.low, *high))


def test_rulers_have_their_length():
    lines = ruler(np.zeros(2), Paper.of("A4")).lines
    assert max(np.ptp(line.points[:, 0]) for line in lines) == 100
    inches = ruler(np.zeros(2), Paper.of("letter")).lines
    assert sorted({round(np.ptp(line.points[:, 0]), 6) for line in inches}) == [0, 100, 101.6]


def test_the_map_shows_each_page_within_its_place():
    pattern = nested(gores(12, 8, radius=120.0, page="A4"))
    shown = page_map(pattern.drawing(), pattern.tiles, np.array([10.0, 20.0]), np.array([150.0, 80.0]))
    assert [text.text for text in shown.texts] == [tile.name for tile in pattern.tiles]
    points = np.vstack([line.points for line in shown.lines])
    assert (points.min(axis=0) >= [10 - 1e-9, 20 - 1e-9]).all()
    assert (points.max(axis=0) <= [160 + 1e-9, 100 + 1e-9]).all()


@pytest.mark.parametrize("page", ["A4", "A5", "letter"])
def test_the_guide_comes_first_and_lists_all_pieces_and_seams(page):
    pattern = nested(gores(9, 8, radius=50.0, page=page))
    pages, paper = pages_of(pattern), pattern.paper
    texts = [text.text for page in pages if page.content is None for text in page.drawing.texts]
    assert {seam.name for seam in pattern.seams} <= set(texts)
    assert any(text.startswith("gores: 9 pieces, 9 seams") for text in texts)
    # The model, its pieces moved apart, and the map of the strain with its legend.
    assert len(pages[0].pictures) == 4
    assert pages[0].pictures[0].pixels.std() > 10
    assert all((page.drawing.width, page.drawing.height) == (paper.width, paper.height) for page in pages)
    for page in pages:
        boxes = shapely.union_all([box_of(text) for text in page.drawing.texts])
        assert shapely.box(0, 0, paper.width, paper.height).covers(boxes)


def write_stl(path, mesh):
    corners = mesh.vertices[mesh.faces].tolist()
    facets = (
        "facet normal 0 0 0\nouter loop\n"
        + "".join(f"vertex {x!r} {y!r} {z!r}\n" for x, y, z in triangle)
        + "endloop\nendfacet\n"
        for triangle in corners
    )
    path.write_text(f"solid bar\n{''.join(facets)}endsolid bar\n")


@pytest.mark.parametrize(("axis", "upward"), [(None, 2), ((0, 1, 0), 1)])
def test_the_guide_shows_the_model_upright(tmp_path, axis, upward):
    """A bar along z, which is upward in STL files: it stands in the picture, or lies if y is upward."""
    path = tmp_path / "bar.stl"
    write_stl(path, polyhedra.hull([[x, y, z] for x in (-1, 1) for y in (-2, 2) for z in (-9, 9)]))
    pattern = coneflat.pattern(path, kind="net", height="100mm", axis=axis, repair=True)
    assert pattern.settings["axis"] == tuple(np.eye(3)[upward])
    image = pages_of(pattern)[0].pictures[0].pixels
    rows, columns = ((image < 250).any(axis=2).any(axis=axis).sum() for axis in (1, 0))
    assert (rows > columns) == (upward == 2)


def test_long_tables_go_on_to_further_pages():
    pages = pages_of(nested(gores(150, 2, radius=60.0, page="A4", allowance=0.0)))
    tables = [page for page in pages if page.content is None][1:]
    assert len(tables) > 1
    rows = [text.text for page in tables for text in page.drawing.texts]
    assert rows.count("Seams") > 1
    assert sum("and" in row for row in rows) == 150


@pytest.mark.parametrize("page", ["roll:600mm", "none"])
def test_a_roll_has_one_page_with_a_ruler_and_the_guide_last(page):
    pages = pages_of(nested(gores(12, 8, radius=100.0, page=page)))
    assert pages[0].content is not None
    assert [page.content is None for page in pages[1:]] == [True] * (len(pages) - 1)
    assert (pages[-1].drawing.width, pages[-1].drawing.height) == PAGE_SIZES["A4"]
    lengths = [np.ptp(line.points[:, 0]) for line in pages[0].drawing.lines]
    assert 100 in lengths
    if page != "none":
        assert pages[0].drawing.width <= 600 + 1e-9


STRIP = sheet(100.0, 5200.0)


def test_a_page_larger_than_a_pdf_allows_is_an_error():
    pattern = Pattern("sheet", STRIP, 1.0, settings={"page": "none"})
    with pytest.raises(
        OptionError, match="a page of 121 x 5241 mm is larger than the 5080 mm that a PDF allows"
    ):
        pages_of(pattern)
    assert pattern.report()["pages"] == 1


@pytest.mark.parametrize("height", [5030.0, 5048.0, 5060.0, 5200.0])
def test_pages_of_rolls_are_not_larger_than_a_pdf_allows(height):
    pattern = nested(Pattern("sheet", sheet(100.0, height), 1.0, settings={"page": "roll:300mm"}))
    assert max(page.drawing.height for page in pages_of(pattern)) <= LONGEST
    # The longest page without its margins and its ruler has 5,040 mm, and the edge of the sheet is 1 mm wide.
    assert len(tile_pages(pattern)) == (1 if height <= 5038 else 2)


def test_the_last_page_of_a_roll_ends_with_the_pattern():
    pattern = nested(Pattern("sheet", STRIP, 1.0, settings={"page": "roll:300mm"}))
    last, first = tile_pages(pattern)
    # The sheet has an edge of 1 mm; pages have margins and a ruler, 40 mm, and overlap by 10 mm.
    assert first.drawing.height + last.drawing.height == pytest.approx(5200 + 2 + 2 * 40 + 10)


@pytest.mark.parametrize("page", ["roll:120mm", "roll:300mm", "none", "A5", "letter"])
def test_rulers_are_on_the_page(page):
    pattern = nested(Pattern("sheet", sheet(10.0, 10.0), 1.0, settings={"page": page}))
    pages = pages_of(pattern)
    assert any(np.ptp(line.points[:, 0]) == RULER for page in pages for line in page.drawing.lines)
    for page in pages:
        printed = shapely.box(MARGIN, MARGIN, page.drawing.width - MARGIN, page.drawing.height - MARGIN)
        assert all(printed.covers(shapely.LineString(line.points)) for line in page.drawing.lines)


def ring(page):
    return Pattern("sheet", annulus(), 1.0, settings={"page": page})


@pytest.mark.parametrize(
    ("pattern", "count"),
    [
        (ring("A4"), None),
        (ring("A2"), None),
        (ring("none"), 1),
        (Pattern("sheet", STRIP, 1.0, settings={"page": "roll:300mm"}), 2),
        (Pattern("sheet", STRIP, 1.0, settings={"page": "A4"}), 20),
        (two_pieces(page="A5"), 2),
    ],
    ids=["ring", "A2", "none", "roll", "strip", "cloth"],
)
def test_the_report_counts_the_pages_that_are_printed(pattern, count):
    placed = nested(pattern)
    pages = tile_pages(placed)
    assert placed.report()["pages"] == len(pages) == len(placed.tiles)
    assert count in (None, len(pages))


def test_holes_of_pieces_are_on_no_page():
    for page in tile_pages(nested(ring("A4"))):
        window = shapely.box(*page.window.ravel())
        assert any(shapely.LinearRing(line.points).intersects(window) for line in page.content.lines)


def pages_in_table(pattern):
    """The pages of each piece in the table of the guide, by its number."""
    texts = [text for page in pages_of(pattern) if page.content is None for text in page.drawing.texts]
    heading = next(text for text in texts if text.text == "pages")
    number = next(text for text in texts if text.text == "number")
    rows = {float(text.place[1]): text.text for text in texts if text.place[0] == number.place[0]}
    return {
        rows[float(text.place[1])]: text.text
        for text in texts
        if text.place[0] == heading.place[0] and text is not heading
    }


def test_the_guide_lists_the_pages_of_pieces_with_their_allowances():
    # The first two pages end at 370 mm. The piece of 330 mm begins at 21 mm, and its allowance ends at 371 mm.
    surface = sheet(330.0, 60.0)
    surface = replace(surface, points=surface.points + 21.0)
    pattern = Pattern("cloth", surface, 1.0, settings={"page": "A4", "allowance": 20.0})
    assert pages_in_table(pattern) == {"1": "A1 to A3"}
    assert pages_in_table(replace(pattern, settings={"page": "A4", "allowance": 0.0})) == {"1": "A1 to A2"}


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        ({}, "the seam allowance of 7 mm is included"),
        ({"allowance": 0.0}, "no seam allowance"),
        ({"allowance": 0.0, "seam_allowances": "A=9mm"}, "the seam allowances of 0 to 9 mm are included"),
        ({"seam_allowances": "A=9mm,hem=9mm"}, "the seam allowance of 9 mm is included"),
    ],
)
def test_the_guide_gives_the_widths_of_all_allowances(settings, text):
    lines = [line.text for line in pages_of(two_pieces(**settings))[0].drawing.texts]
    assert any(line.startswith(text) for line in lines)
    assert text in " ".join(lines).partition("Cut out")[2]


def test_the_guide_lists_the_page_of_each_piece():
    assert pages_in_table(nested(two_pieces(page="A5"))) == {"1": "A1", "2": "A2"}


def test_a_pattern_of_one_page_has_no_marks_for_joining():
    pages = pages_of(nested(two_pieces(page="A3")))
    assert [text.text for text in pages[-1].drawing.texts] == ["toy"]
    assert not pages[-1].drawing.lines
