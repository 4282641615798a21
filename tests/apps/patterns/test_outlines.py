"""What is drawn of pieces: allowances, notches, names."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from itertools import combinations

import numpy as np
import polyhedra
import pytest
import shapes
from flat_pieces import gores, sheet, two_pieces, with_dart

import coneflat
from coneflat import Pattern, TriangleMesh
from coneflat.apps.patterns.drawing.allowances import polygon_of, widened
from coneflat.apps.patterns.drawing.gaps import notes_on_gaps, notes_on_short_seams
from coneflat.apps.patterns.drawing.labels import box_of
from coneflat.apps.patterns.drawing.notches import notches_of
from coneflat.apps.patterns.finish import Finish, read_allowances
from coneflat.apps.patterns.net.tabs import Tab
from coneflat.apps.patterns.pages.nesting import GAP, nested
from coneflat.apps.patterns.pieces.borders import find_borders
from coneflat.apps.patterns.pieces.cut_surface import CutSurface
from coneflat.apps.patterns.pieces.grain import grain_up
from coneflat.apps.patterns.pieces.polylines import distances, ends_of_straight_parts
from coneflat.errors import OptionError

shapely = pytest.importorskip("shapely")

SQUARE = np.array([[0.0, 0], [100, 0], [100, 100], [0, 100]])
CORNER = np.array([[0.0, 0], [100, 0], [100, 40], [40, 40], [40, 100], [0, 100]])


def uniform(ring, width):
    return np.full(len(ring), float(width))


def lengths_of(lines):
    return [
        distances(np.vstack([line.points, line.points[:1]]) if line.is_closed else line.points)[-1]
        for line in lines
    ]


def test_a_mitred_allowance_has_the_area_of_its_strips_and_corners():
    assert widened([SQUARE], [uniform(SQUARE, 7)]).area == pytest.approx(114**2)
    # Five corners add a square, and one takes it away.
    expected = 6400 + 400 * 5 + 4 * 25
    assert widened([CORNER], [uniform(CORNER, 5)]).area == pytest.approx(expected)


def test_a_round_allowance_has_the_area_of_its_strips_and_arcs():
    area = widened([SQUARE], [uniform(SQUARE, 7)], is_round=True).area
    assert area == pytest.approx(100**2 + 400 * 7 + np.pi * 49, rel=1e-5)


def test_single_seams_have_allowances_of_their_own():
    wide = widened([SQUARE], [np.array([10.0, 2.0, 0.0, 5.0])])
    assert wide.bounds == pytest.approx((-5, -10, 102, 100))
    assert wide.area == pytest.approx(107 * 110)


def test_a_hole_becomes_narrower():
    hole = (SQUARE * 0.4 + 30)[::-1]
    wide = widened([SQUARE, hole], [uniform(SQUARE, 0), uniform(hole, 6)])
    assert wide.area == pytest.approx(100**2 - 28**2)
    assert len(wide.interiors) == 1
    assert not widened([SQUARE, hole], [uniform(SQUARE, 0), uniform(hole, 25)]).interiors


@pytest.mark.parametrize("is_round", [True, False])
def test_an_allowance_is_nowhere_too_narrow_and_corners_are_trimmed(is_round):
    rng = np.random.default_rng(3)
    angles = np.sort(rng.random(60)) * 2 * np.pi
    ring = (50 + 30 * rng.random(60))[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    piece = polygon_of([ring])
    wide = widened([ring], [uniform(ring, 6)], is_round)
    # Chords of arcs are a little inside of them.
    assert wide.buffer(0.06).contains(piece.buffer(6))
    # A trimmed corner ends twice as far out, over the whole width of both allowances.
    assert piece.buffer(6.1 if is_round else 6 * 5**0.5 + 0.1).contains(wide)


def test_pockets_between_allowances_are_filled():
    outside = [[0.0, 0], [60, 0], [60, 60], [31, 60]]
    around_pocket = [[31, 50], [50, 50], [50, 10], [10, 10], [10, 50], [29, 50]]
    ring = np.array([*outside, *around_pocket, [29, 60], [0, 60]])
    wide = widened([ring], [uniform(ring, 2)])
    assert not wide.interiors
    assert wide.area == pytest.approx(64 * 64)


def test_without_allowance_the_cut_line_is_the_border_itself():
    drawing = two_pieces(allowance=0.0).drawing()
    assert sorted(lengths_of(line for line in drawing.lines if line.layer == "cut")) == pytest.approx(
        [280, 280]
    )


def test_with_allowance_all_sides_are_drawn_inside():
    pattern = two_pieces(allowance=5.0)
    dashed = [line for line in pattern.drawing().lines if line.layer == "mark" and line.dashes]
    sides = [*pattern.borders.hems, *(side for seam in pattern.seams for side in seam.sides)]
    expected = [distances(pattern.surface.points[side.points])[-1] for side in sides]
    assert sorted(lengths_of(dashed)) == pytest.approx(sorted(expected))
    assert sum(expected) == pytest.approx(560)


def test_seams_are_named_in_allowances():
    pattern = two_pieces(allowance=0.0, seam_allowances="A=10mm")
    assert [shape.cut.area for shape in pattern.shapes] == pytest.approx([70 * 80] * 2)
    with pytest.raises(
        OptionError, match="names the seam Q, which the pattern does not have: its seams are A"
    ):
        two_pieces(seam_allowances="Q=1cm").drawing()


def test_hems_have_a_name_in_allowances():
    pattern = two_pieces(allowance=0.0, seam_allowances="hem=10")
    assert [shape.cut.area for shape in pattern.shapes] == pytest.approx([70 * 100] * 2)


@pytest.mark.parametrize("text", ["A", "A=", "A=-1mm", "=3mm", "A=3kg"])
def test_allowances_that_cannot_be_read_are_errors(text):
    with pytest.raises(OptionError, match=r"such as A=10mm,B=0, got"):
        read_allowances(text)


def test_allowances_are_read():
    assert read_allowances("A=10mm, B=0,hem=1in") == {"A": 10.0, "B": 0.0, "hem": 25.4}


def test_notches_match_along_both_sides():
    pattern = gores(radius=100.0)
    points = pattern.surface.points
    for seam in pattern.seams:
        first, second = notches_of(seam, points)
        assert len(first) == len(second) > 1
        for notches, side in zip((first, second), seam.sides, strict=True):
            assert [notch.is_double for notch in notches] == [True] + [False] * (len(notches) - 1)
            line = shapely.LineString(points[side.points])
            at = [line.project(shapely.Point(notch.place)) for notch in notches]
            assert [line.distance(shapely.Point(notch.place)) for notch in notches] == pytest.approx(
                [0] * len(at)
            )
            from_end = at if side is seam.sides[0] else [line.length - place for place in at]
            assert from_end == pytest.approx((np.arange(len(at)) + 0.5) / len(at) * line.length)


def test_a_single_notch_is_not_in_the_middle():
    (seam,) = two_pieces().seams
    first, second = notches_of(seam, two_pieces().surface.points)
    assert len(first) == 1
    assert {float(notch.place[1]) for notch in (*first, *second)} == {32.0}


def test_short_seams_and_darts_have_no_notches():
    pattern = with_dart()
    assert [notches_of(seam, pattern.surface.points) for seam in pattern.seams] == [([], [])]
    small = Pattern("cloth", replace(two_pieces().surface, points=two_pieces().surface.points / 10), 1.0)
    assert notches_of(small.seams[0], small.surface.points) == ([], [])


def test_notches_point_out_of_the_piece():
    pattern = two_pieces()
    for notches, shape in zip(
        notches_of(pattern.seams[0], pattern.surface.points), pattern.shapes, strict=True
    ):
        for notch in notches:
            assert not shape.inside.contains(shapely.Point(notch.place + 0.1 * notch.outward))
            assert shape.inside.contains(shapely.Point(notch.place - 0.1 * notch.outward))


def test_a_seam_whose_sides_differ_says_by_how_much():
    pattern = nested(two_pieces(shrink=0.98))
    texts = [text.text for text in pattern.drawing().texts]
    assert "A (2), ease 1.6 mm" in texts
    assert "A (1)" in texts
    report = pattern.report()
    assert (report["eased_seams"], report["ease_max"]) == (1, pytest.approx(1.6))
    first, second = notches_of(pattern.seams[0], pattern.surface.points)
    assert len(first) == len(second)


def test_a_dart_is_marked_and_its_wedge_is_not_cut_out():
    pattern = with_dart(allowance=6.0)
    assert len(pattern.darts) == 1
    drawing = pattern.drawing()
    assert [text.text for text in drawing.texts].count("dart A") == 2
    tip = pattern.surface.points[pattern.darts[0].tip]
    assert any(line.is_closed and np.allclose(line.points.mean(axis=0), tip) for line in drawing.lines)
    (shape,) = pattern.shapes
    assert shape.cut.contains(shapely.Point(tip - [0, 5]))


@pytest.mark.parametrize("count", [6, 30])
def test_no_text_covers_another_and_names_are_inside(count):
    pattern = nested(gores(count, radius=60.0))
    drawing = pattern.drawing()
    boxes = [box_of(text) for text in drawing.texts]
    assert not [pair for pair in combinations(boxes, 2) if pair[0].intersects(pair[1])]
    numbers = {text.text for text in drawing.texts}
    assert {str(i + 1) for i in range(count)} <= numbers
    cut = [shape.cut for shape in pattern.shapes]
    assert all(any(piece.contains(box) for piece in cut) for box in boxes)
    names = [text.text.split()[0] for text in drawing.texts if "(" in text.text]
    assert all(names.count(seam.name) == 2 for seam in pattern.seams)


def test_both_sides_of_every_seam_have_a_name_however_small_the_pattern_is():
    result = coneflat.pattern(*shapes.sphere(3), height=40, strain=0.03)
    drawing = result.drawing()
    names = Counter(text.text.removeprefix("dart ").split(" ")[0] for text in drawing.texts)
    assert min(seam.lengths[0] for seam in result.seams) < 5
    assert [seam.name for seam in result.seams if names[seam.name] < 2] == []
    assert drawing.notes == ()


def test_straight_parts_of_seams_of_nets_have_names_of_their_own():
    pattern = two_pieces("net")
    assert sorted(text.text for text in pattern.drawing().texts if text.text.startswith("A")) == [
        "A (1)",
        "A (2)",
    ]
    bent = gores(4, 6, kind="net", page="A3")
    names = [text.text for text in nested(bent).drawing().texts]
    assert names.count("A1 (2)") + names.count("A1 (4)") == 1


def test_straight_parts_of_seams_end_where_they_have_turned_by_half_a_degree():
    def arc(degrees):
        turns = np.radians(degrees)
        return np.concatenate([[[0, 0]], np.cumsum(np.stack([np.cos(turns), np.sin(turns)], axis=1), axis=0)])

    line = arc(np.zeros(11))
    ends = [ends_of_straight_parts(line, arc(np.arange(11) * step)).tolist() for step in (0, 0.01, 0.2, 5)]
    assert ends == [[0, 11], [0, 11], [0, 3, 6, 9, 11], list(range(12))]
    corner = arc([0, 0, 0, 90, 90, 90, 90, 90, 90, 90, 90])
    for sides in ((line, corner), (corner, line)):
        assert ends_of_straight_parts(*sides).tolist() == [0, 3, 11]


def test_tabs_are_cut_out_with_their_piece():
    tab = Tab(np.array([[60.0, 10], [66, 16], [66, 64], [60, 70]]), seam=0, side=0, piece=0, edges=(0, 1))
    pattern = replace(two_pieces("net"), tabs=(tab,))
    assert [shape.cut.area for shape in pattern.shapes] == pytest.approx([4800 + 54 * 6, 4800])
    folds = [line for line in pattern.drawing().lines if line.layer == "fold"]
    assert lengths_of(folds) == pytest.approx([60])


def test_slits_beside_tabs_are_cut():
    """The lid of the wide box is a ring, and a wall of the narrow one fills its hole."""
    mesh = polyhedra.box_on_box()
    pattern = coneflat.pattern(mesh.vertices, mesh.faces, kind="net", height="200mm")
    cut = shapely.MultiLineString(
        [
            np.vstack([line.points, line.points[:1]]) if line.is_closed else line.points
            for line in pattern.drawing().lines
            if line.layer in ("cut", "fold")
        ]
    )
    for side in (side for seam in pattern.seams for side in seam.sides):
        ends = pattern.surface.points[side.points]
        assert shapely.distance(shapely.points((ends[1:] + ends[:-1]) / 2), cut).max() < 1e-4


def test_folds_are_dashed_by_their_kind_with_their_angle():
    surface = sheet()
    ends = np.array([[5, 9], [10, 14]])
    pattern = Pattern("net", surface, 1.0, folds=ends, fold_angles=np.radians([90.0, -30.0]))
    folds = [line for line in pattern.drawing().lines if line.layer == "fold"]
    assert folds[0].dashes != folds[1].dashes
    assert [len(line.dashes) for line in folds] == [4, 2]
    assert {"90\u00b0", "30\u00b0"} <= {text.text for text in pattern.drawing().texts}


def test_bends_are_drawn_where_their_piece_is_placed():
    corners = [[x, y, z] for y in (0, 80) for x, z in ((0, 0), (60, 0), (60, 40))]
    faces = [[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]]
    placed = coneflat.pattern(corners, faces, kind="sheet", unit="mm", page="none")
    (bend,), (shape,) = placed.bends, placed.shapes
    assert shape.inside.buffer(1e-6).contains(shapely.LineString(bend.line))
    drawing = placed.drawing()
    assert "90\u00b0" in {text.text for text in drawing.texts}
    assert lengths_of(line for line in drawing.lines if line.layer == "fold") == pytest.approx([80])


@pytest.mark.parametrize("page", ["A4", "A2", "roll:300mm", "none"])
@pytest.mark.parametrize("kind", ["gores", "sheet"])
def test_nested_pieces_are_apart_and_move_rigidly(kind, page):
    pattern = gores(7, 8, radius=45.0, kind=kind, page=page)
    placed = nested(pattern)
    cut = [shape.cut for shape in placed.shapes]
    gaps = [first.distance(second) for first, second in combinations(cut, 2)]
    assert min(gaps) >= GAP - 1e-9
    assert np.min([shape.bounds[:2] for shape in cut]) >= 1 - 1e-9
    before, after = (
        np.sort(p.surface.edges.vectors(p.surface.points) ** 2 @ [1, 1]) for p in (pattern, placed)
    )
    assert after == pytest.approx(before)
    if kind == "gores":
        vectors = [p.surface.edges.vectors(p.surface.points) for p in (pattern, placed)]
        assert np.abs(vectors[0]) == pytest.approx(np.abs(vectors[1]), abs=1e-9)
    assert nested(pattern).surface.points.tolist() == placed.surface.points.tolist()
    share = placed.report()["sheet_share"]
    assert (0.2 if page == "A4" else 0.4) < share < 1  # On pages, rows of whole pieces leave a part empty.


def test_pieces_that_fit_on_pages_cross_no_border():
    placed = nested(gores(12, 8, radius=60.0, page="A4"))
    boxes = np.array([shape.cut.bounds for shape in placed.shapes])
    assert (boxes[:, 0] // 190 == boxes[:, 2] // 190).all()
    assert (boxes[:, 1] // 277 == boxes[:, 3] // 277).all()


def test_a_piece_wider_than_the_roll_is_an_error():
    with pytest.raises(OptionError, match=r"a piece is 120 mm wide and the roll 98 mm without its margins"):
        nested(two_pieces(page="roll:120mm", allowance=30.0))


def test_a_roll_takes_pieces_of_nets_at_any_angle():
    long = Pattern("sheet", sheet(200.0, 80.0), 1.0, settings={"page": "roll:120mm"})
    assert nested(long).report()["sheet_height"] > 200


@pytest.mark.parametrize(
    ("height", "page", "problem"),
    [
        (1e5, "A4", "would fill 1,.* pages of A4, more than 2,000"),
        (1e9, "none", r"would be .* m, more than 1 km"),
    ],
)
def test_what_is_too_large_is_an_error(height, page, problem):
    mesh = polyhedra.cube()
    with pytest.raises(OptionError, match=problem):
        coneflat.pattern(mesh.vertices, mesh.faces, kind="net", height=height, page=page)


def test_a_large_pattern_is_drawn_on_one_page():
    mesh = polyhedra.cube()
    large = coneflat.pattern(mesh.vertices, mesh.faces, kind="net", height="100m", page="none")
    assert large.drawing().width > 2e5
    assert shapely.area(large.shapes[0].cut) >= 6e10


def test_the_grain_points_up():
    surface = sheet()
    angle = 0.7
    turned = surface.points @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    turned_up = grain_up(replace(surface, points=turned), np.array([0.0, 1.0, 0.0]))
    flat = turned_up.points - turned_up.points.mean(axis=0)
    assert flat == pytest.approx(surface.points - surface.points.mean(axis=0), abs=1e-9)


def test_borders_of_a_pattern_by_hand():
    borders = find_borders(two_pieces().surface)
    assert [seam.lengths for seam in borders.seams] == [pytest.approx((80, 80))]


def slotted(width: float) -> Pattern:
    """A plate of 100 x 100 mm with a slot of 90 mm in the middle."""
    x, y = np.array([0, 50 - width / 2, 50 + width / 2, 100]), np.array([0, 5, 95, 100])
    points = np.array([[a, b] for a in x for b in y], dtype=float)
    squares = [4 * i + j for i in range(3) for j in range(3) if (i, j) != (1, 1)]
    faces = [face for k in squares for face in ([k, k + 4, k + 5], [k, k + 5, k + 1])]
    mesh = TriangleMesh(np.pad(points, ((0, 0), (0, 1))), np.array(faces))
    return Pattern("cloth", CutSurface(mesh, mesh.faces, points), 1.0)


@pytest.mark.parametrize(
    ("slot", "allowance"), [(10.0, 7.0), (10.0, 4.9), (14.1, 7.0), (2.0, 0.0), (5.0, 7.0)]
)
def test_a_slot_that_allowances_fill_is_noted(slot, allowance):
    pattern = slotted(slot)
    notes = [*notes_on_gaps(pattern.surface, pattern.borders, Finish(allowance))]
    (shape,) = replace(pattern, settings={"allowance": allowance}).shapes
    is_filled = not len(shape.cut.interiors)
    assert len(notes) == is_filled == (slot < 2 * allowance)
    if is_filled:
        assert f"less allowance than requested at hem of piece 1, along {180:.0f} mm" in notes[0]
        assert f"{slot:.1f} mm" in notes[0]


def test_corners_and_darts_are_no_gaps():
    for pattern in (two_pieces("cloth"), gores(4, 6)):
        assert not [*notes_on_gaps(pattern.surface, pattern.borders, Finish(7.0))]


@pytest.mark.parametrize(
    ("settings", "note"),
    [
        ({}, None),
        ({"allowance": 100.0}, "1 seam of 1 is shorter than its allowance of 100 mm"),
        ({"seam_allowances": "A=90mm"}, "1 seam of 1 is shorter than its allowance of 90 mm"),
        ({"allowance": 100.0, "seam_allowances": "A=5mm"}, None),
    ],
)
def test_seams_are_short_if_their_own_allowance_is_wider(settings, note):
    pattern = two_pieces(**settings)
    notes = [*notes_on_short_seams(pattern.seams, pattern.finish)]
    assert [text.partition(":")[0] for text in notes] == ([] if note is None else [note])


def test_several_short_seams_are_counted():
    around = gores(4, 4, radius=40.0, allowance=200.0, seam_allowances="B=150mm,C=1mm")
    (note,) = notes_on_short_seams(around.seams, around.finish)
    assert note.startswith("3 seams of 4 are shorter than their allowances of up to 200 mm: ")
