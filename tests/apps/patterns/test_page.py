"""The page of a pattern in the viewer."""

from __future__ import annotations

import json

import numpy as np
import pytest
import shapes
from axe import axe_source, findings
from browsing import NARROW, WIDE, Visit, thing
from chromium import browser_path
from click.testing import CliRunner
from flat_pieces import gores, sheet, two_pieces, with_dart

import coneflat
from coneflat import Pattern
from coneflat.apps.cli.main import cli
from coneflat.apps.patterns import page_of_pattern
from coneflat.apps.patterns.page import as_flattening, parts_of
from coneflat.errors import UnknownFormatError

pytest.importorskip("shapely")
needs_browser = pytest.mark.skipif(browser_path() is None, reason="there is no Chromium here")

PATTERNS = [two_pieces(shrink=0.9), with_dart(), gores(8), Pattern("sheet", sheet(), 1.0)]
NAMES = ["pieces", "dart", "gores", "sheet"]


@pytest.mark.parametrize("pattern", PATTERNS, ids=NAMES)
def test_its_lengths_are_those_of_the_pattern(pattern):
    result = as_flattening(pattern)
    assert result.uv.min() >= 0
    assert result.uv.max() == pytest.approx(1)
    apart = result.uv[:, None] - result.uv
    expected = pattern.surface.points[:, None] - pattern.surface.points
    assert apart / result.uv_scale == pytest.approx(expected, abs=1e-9)
    assert result.distortion.flipped == result.distortion.overlapping_pairs == 0
    assert len(result.seams) == len(pattern.surface.seams)


@pytest.mark.parametrize("pattern", PATTERNS, ids=NAMES)
def test_strains_are_those_of_the_report(pattern):
    strain = parts_of(pattern).strain
    assert np.abs(strain).max() == pytest.approx(pattern.report()["strain_max"], abs=1e-12)
    if pattern is PATTERNS[0]:
        assert strain[pattern.surface.pieces == 0] == pytest.approx(0, abs=1e-12)
        assert strain[pattern.surface.pieces == 1].min() == pytest.approx(-0.1)


@pytest.mark.parametrize("pattern", PATTERNS, ids=NAMES)
def test_numbers_are_in_the_middle_of_their_pieces(pattern):
    parts, surface = parts_of(pattern), pattern.surface
    assert np.array_equal(surface.pieces[parts.anchors], np.arange(pattern.piece_count))
    for piece, anchor in enumerate(parts.anchors):
        places = surface.places[surface.pieces == piece].reshape(-1, 2)
        off = surface.places[anchor].mean(axis=0) - (places.min(axis=0) + places.max(axis=0)) / 2
        assert np.abs(off).max() < 0.4 * np.ptp(places, axis=0).max()


def test_the_tip_of_a_dart_is_a_cone_that_opens_as_far():
    result = as_flattening(with_dart())
    assert result.vertices[result.cones] == pytest.approx(np.array([[60, 40, 0]]))
    (opening,) = result.curvatures
    assert opening == pytest.approx(2 * np.arctan(1 / 4), abs=0.2)
    assert np.abs(result.curvature_residual).max() < np.pi


def test_names_of_seams():
    parts = parts_of(two_pieces(shrink=0.9))
    assert parts.names == ["A"]
    assert parts.seam_texts == ["Seam A, 80.0 mm eased to 72.0 mm"]
    assert parts_of(with_dart()).seam_texts[0].startswith("Dart A, ")
    assert parts_of(gores(8)).names == list("ABCDEFGH")


def test_edges_of_a_net_have_the_names_of_its_straight_parts():
    cube = net_of_cube()
    parts, drawn = parts_of(cube), [text.text for text in cube.drawing().texts]
    assert len(parts.names) == 7  # edges of a cube that are cut
    assert all(drawn.count(name) == 2 for name in parts.names)
    surface = cube.surface
    edges = surface.seams[np.argsort(parts.edge_names)]
    assert np.array_equal(np.bincount(parts.edge_names), np.ones(7))
    assert len(edges) == 7
    for number, name in enumerate(parts.names):
        seam = cube.seams[parts.seams[np.flatnonzero(parts.edge_names == number)[0]]]
        assert name.rstrip("0123456789") == seam.name


def net_of_cube():
    return coneflat.pattern(*shapes.box(1), kind="net", unit="mm", scale=50)


def bracket():
    """A strip that is bent up by a right angle along x = z = 0, and back about a cylinder around x = -10, z = 40."""
    turn = np.linspace(0, np.pi / 2, 7)
    arc = np.stack([10 * np.cos(turn) - 10, 40 + 10 * np.sin(turn)], axis=1)
    profile = np.concatenate([[[60, 0], [0, 0]], arc, [[-60, 50]]])
    vertices = np.concatenate([np.insert(profile, 1, y, axis=1) for y in (0.0, 30.0)])
    first = np.arange(len(profile) - 1)
    quads = np.stack([first, first + 1, first + 1 + len(profile), first + len(profile)], axis=1)
    return coneflat.pattern(
        vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]), kind="sheet", unit="mm"
    )


@pytest.mark.parametrize("make", [net_of_cube, bracket])
def test_folds_are_the_same_on_the_model_and_in_the_plane(make):
    pattern = make()
    folds, extent = parts_of(pattern).folds, np.ptp(pattern.surface.points, axis=0).max()
    assert len(folds.uv) == len(pattern.folds) + len(pattern.bends) > 1
    on_model, in_plane = (
        np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) for ends in (folds.places, folds.uv)
    )
    assert on_model == pytest.approx(in_plane * extent)
    expected = [line.points for line in pattern.drawing().lines if line.layer == "fold"][-len(folds.uv) :]
    low = pattern.surface.points.min(axis=0)
    assert folds.uv * extent + low == pytest.approx(np.array(expected))


def test_bends_are_in_their_places_on_the_model():
    pattern = bracket()
    model, places = pattern.surface.mesh.vertices, parts_of(pattern).folds.places
    assert [bend.angle > 0 for bend in pattern.bends] == parts_of(pattern).folds.is_mountain.tolist()
    origin = model.max(axis=0) - [60, 30, 50]  # models are centred
    for bend, ends in zip(pattern.bends, places - origin, strict=True):
        axis = [-10.0, 40.0] if bend.radius else [0.0, 0.0]
        off = np.linalg.norm(ends[:, [0, 2]] - axis, axis=1)
        assert (off <= bend.radius + 1e-6).all()
        assert (off >= bend.radius * np.cos(np.pi / 24) - 1e-6).all()
        assert sorted(ends[:, 1]) == pytest.approx([0, 30])


@needs_browser
def test_folds_and_names_of_parts_in_a_browser(browser, tmp_path):
    path, pattern = tmp_path / "page.html", net_of_cube()
    path.write_text(page_of_pattern(pattern, show="plain"))
    visit = Visit(browser, path)
    assert visit.page.inner_text("#cones") == "Folds"
    for pane in ("model", "layout"):
        visit.run("coneflat.state.set({cones: true})")
        assert blue_pixels(visit.picture(pane)) > 100
        visit.run("coneflat.state.set({cones: false})")
        assert blue_pixels(visit.picture(pane)) == 0
    names = parts_of(pattern).names
    for edge, number in enumerate(parts_of(pattern).edge_names.tolist()):
        visit.run(f"coneflat.state.set({{picked: {{kind: 'seam', index: {edge}}}, hovered: null}})")
        is_divided = names[number] not in [seam.name for seam in pattern.seams]
        assert (f"here {names[number]}" in visit.page.inner_text("#facts")) == is_divided
    visit.close()


def blue_pixels(picture):
    red, green, blue = np.moveaxis(picture.astype(int), 2, 0)[:3]
    return int(((blue > 150) & (red < 100) & (green < 130)).sum())


def test_a_pattern_is_viewed(tmp_path):
    page = two_pieces().view(tmp_path / "toy.html")
    assert page.read_text() == page_of_pattern(two_pieces())
    with pytest.raises(UnknownFormatError, match="pages are written as"):
        two_pieces().view(tmp_path / "toy.pdf")


def test_the_command_writes_only_the_page_if_nothing_else_is_asked_for(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shapes.write_obj(tmp_path / "box.obj", *shapes.box(1))
    run = ["pattern", "box.obj", "--kind", "net", "--unit", "mm", "--scale", "50", "--view"]
    done = CliRunner().invoke(cli, [*run, "box.html"])
    assert done.exit_code == 0, done.output
    assert "wrote box.html" in done.output
    assert not (tmp_path / "box.pdf").exists()
    page = (tmp_path / "box.html").read_text()
    head = json.loads(page.split('id="head">')[1].split("</script>")[0])
    assert head["show"] == "charts"
    assert "1 piece" in head["title"]
    assert len(head["parts"]["names"]) == 7  # edges of a cube
    assert head["parts"]["folds"] == head["parts"]["mountains"] == 5
    assert head["seams"] == 7  # edges of a cube
    assert [row[0] for row in head["rows"]][:3] == ["size", "pieces", "seams"]
    done = CliRunner().invoke(cli, [*run, "box.pdf"])
    assert isinstance(done.exception, UnknownFormatError)
    done = CliRunner().invoke(cli, [*run, "both.html", "-o", "both.svg"])
    assert (done.exit_code, (tmp_path / "both.svg").exists()) == (0, True)


@needs_browser
@pytest.mark.parametrize("pattern", PATTERNS[:3], ids=NAMES[:3])
def test_the_page_in_a_browser(browser, tmp_path, pattern):
    path = tmp_path / "page.html"
    path.write_text(page_of_pattern(pattern, name="Toy"))
    visit = Visit(browser, path)
    assert visit.page.inner_text("#show option:checked") == "Pieces"
    for index, seam in enumerate(pattern.seams):
        visit.page.keyboard.press("h")
        facts = visit.page.inner_text("#facts")
        assert facts.startswith(f"{'Dart' if seam.is_dart else 'Seam'} {seam.name}, ")
        pieces = sorted(side.piece + 1 for side in seam.sides)
        between = f"within piece {pieces[0]}" if pieces[0] == pieces[1] else "between pieces "
        assert between in facts
        assert visit.run(f"coneflat.model.seams[{index}].length") == len(seam.sides[0].halfedges)
    visit.page.select_option("#show", "strain")
    assert visit.page.inner_text("#scale-title").endswith("at true scale")
    anchors = parts_of(pattern).anchors
    x, y = visit.at("layout", thing("triangle", int(anchors[-1])))[0]
    visit.page.mouse.move(x, y)
    assert f"piece {pattern.piece_count}" in visit.page.inner_text("#facts")
    assert "largest change of the length of a side" in visit.page.inner_text("#facts")
    if pattern.darts:
        visit.run("coneflat.state.set({picked: {kind: 'cone', index: 0}, hovered: null})")
        assert visit.page.inner_text("#facts").startswith("Tip of a dart at vertex ")
    visit.close()


@needs_browser
@pytest.mark.parametrize("size", [WIDE, NARROW], ids=["wide", "narrow"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing_serious(browser, tmp_path, size, scheme):
    source, path = axe_source(), tmp_path / "page.html"
    path.write_text(page_of_pattern(with_dart()))
    visit = Visit(browser, path, viewport=size, color_scheme=scheme, bypass_csp=True)
    visit.page.keyboard.press("h")
    visit.run("coneflat.state.set({report: true})")
    assert findings(visit.page, source) == []
    visit.close()


@needs_browser
def test_numbers_of_pieces_are_written_on_both_sides(browser, tmp_path):
    path = tmp_path / "page.html"
    pattern = two_pieces()
    path.write_text(page_of_pattern(pattern, show="plain"))
    visit = Visit(browser, path)
    without = {}
    for hides in (False, True):
        if hides:
            visit.run("coneflat.marks.drawNumbers = () => {}; coneflat.remark()")
        for pane in ("model", "layout"):
            picture = visit.picture(pane)
            if not hides:
                without[pane] = picture
                continue
            changed = np.argwhere(np.abs(picture - without[pane]).max(axis=2) > 40)
            for anchor in parts_of(pattern).anchors:
                (x, y), box = visit.at(pane, thing("triangle", int(anchor)))[0], visit.box(pane)
                is_close = np.abs(changed - [y - box["y"], x - box["x"]]).max(axis=1) < 12
                assert is_close.sum() > 20
    visit.close()
