"""What the viewer's page shows in a browser, and what mouse, keys and fingers do there."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from browsing import NARROW, WIDE, Visit, need_browser, thing
from gltf_scenes import coloured_ball

import coneflat
from coneflat.apps.view.page.content import content_of
from coneflat.options.declared import SHOWS

need_browser()


def colour_at(visit, u, v):
    """The colour that the layout has at a point of the plane."""
    x, y = visit.run(
        f"(({{camera}}, m) => camera.project([({u} - m.uvCentre[0]) * m.uvUnit, ({v} - m.uvCentre[1]) * m.uvUnit, 0]))"
        "(coneflat.panes[1], coneflat.model)"
    )[:2]
    return visit.picture("layout")[int(y), int(x)]


def inner_points(viewed, cell, count=12):
    """Middles of squares of the plane that lie well inside a triangle-covered part."""
    from coneflat.apps.view.figures.render import rasterise

    flat = np.column_stack([1000 * viewed.uv, np.zeros(len(viewed.uv))])
    covered = rasterise(flat, viewed.uv_faces, 1000, 1000).covered
    steps = [slice(int(1000 * i * cell), int(1000 * (i + 1) * cell)) for i in range(int(1 / cell))]
    inside = [(i, j) for i, u in enumerate(steps) for j, v in enumerate(steps) if covered[v, u].all()]
    return [inside[k] for k in np.linspace(0, len(inside) - 1, count).astype(int)]


def quarters(path):
    """A picture whose quarters are red, green (above), blue and white (below)."""
    from PIL import Image

    pixels = np.zeros((64, 64, 3), dtype=np.uint8)
    pixels[:32, :32], pixels[:32, 32:], pixels[32:, :32], pixels[32:, 32:] = (
        (255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255),
    )  # fmt: skip
    Image.fromarray(pixels).save(path)
    return path


def expected_quarter(u, v):
    return {(0, 1): [255, 0, 0], (1, 1): [0, 255, 0], (0, 0): [0, 0, 255], (1, 0): [255, 255, 255]}[
        u > 0.5, v > 0.5
    ]


@pytest.mark.parametrize("size", [WIDE, NARROW], ids=["wide", "narrow"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_both_views_are_drawn_and_everything_fits(browser, viewed_page, size, scheme):
    visit = Visit(browser, viewed_page, viewport=size, color_scheme=scheme)
    for pane in ("model", "layout"):
        assert 0.1 < visit.drawn_share(pane) < 0.95
        box = visit.box(pane)
        assert box["width"] * box["height"] > 0.25 * size["width"] * size["height"]
    assert visit.state("dark") == (scheme == "dark")
    assert (visit.picture("model")[3, -3] < 60).all() == (scheme == "dark")
    assert visit.run("document.documentElement.scrollWidth") <= size["width"]
    assert visit.run("[...document.querySelectorAll('button, select')].every((one) => {"
                     "const box = one.getBoundingClientRect(); return !box.width || (box.left >= 0 && "
                     "box.right <= innerWidth && box.bottom <= innerHeight); })")  # fmt: skip
    visit.close()


def test_the_browser_has_the_numbers_of_the_result(visit, viewed):
    content = content_of(viewed, 10**6)
    for name, values in (
        ("qc", content.qc), ("area", content.area), ("strain", content.strain), ("flat", content.flat),
    ):  # fmt: skip
        shown = np.array(visit.run(f"Array.from(coneflat.model.arrays.{name})"), dtype=float)
        np.testing.assert_allclose(shown, values, rtol=2**-10 if name == "strain" else 1e-6, atol=1e-9)
    values = {
        "qc": content.qc, "area": content.area, "strain": content.strain, "curvature": content.curvature,
    }  # fmt: skip
    for name, scale in content.scales.items():
        shown = np.array(visit.run(f"Array.from(coneflat.model.tones('{name}'))"))
        expected = np.nan_to_num(scale.position(values.get(name, content.flat)), nan=-1)
        np.testing.assert_allclose(shown, expected, atol=1e-3 if name == "strain" else 1e-5)


def test_report_help_and_theme(visit, viewed):
    assert not visit.page.is_visible("#table")
    visit.page.click("#report")
    assert "seam mismatch" in visit.page.inner_text("#table")
    assert 0.1 < visit.drawn_share("layout") < 0.95  # it has made room
    box, picture = visit.box("layout"), visit.picture()
    gap = picture[
        round(box["y"]) + 5 : round(box["y"] + box["height"]) - 5, round(box["x"]) - 6 : round(box["x"]) - 2
    ]
    assert np.ptp(gap.reshape(-1, 3), axis=0).max() == 0  # nothing is left of what was there
    visit.page.click("#report")
    visit.page.click("#help")
    assert visit.page.is_visible("#keys")
    assert "two fingers" in visit.page.inner_text("#keys")
    visit.page.click("#keys button")
    assert not visit.page.is_visible("#keys")
    visit.page.click("#theme")
    assert (visit.picture("layout")[-3, 3] < 60).all()


def test_another_axis_points_up(visit):
    from coneflat.apps.view.figures.camera import fit_camera

    places = np.array(visit.run("Array.from(coneflat.model.arrays.places)")).reshape(-1, 3)
    shown = []
    for turn_up in (lambda: visit.page.keyboard.press("z"), lambda: visit.page.click("#turn-up")) * 2:
        turn_up()
        axis = visit.state("up")
        assert visit.page.inner_text("#turn-up") == f"{axis} up"
        turn = np.array(visit.run("coneflat.panes[0].camera.turn")).reshape(3, 3)
        np.testing.assert_allclose(turn, fit_camera(places, (1, 1), up=axis).axes, atol=1e-9)
        shown.append(axis)
    assert sorted(shown[:3]) == ["x", "y", "z"]


@pytest.fixture(scope="module")
def damaged_page(viewed, tmp_path_factory):
    """A page whose layout has overlaps, a fold, and parts outside the unit square."""
    uv = viewed.uv.copy()
    uv[viewed.uv_faces[300, 0]] += [0.1, 0.05]
    uv[np.unique(viewed.uv_faces[chart_of(viewed) == 1])] += [0.35, 0.2]
    distortion = coneflat.measure_uv(viewed.vertices, viewed.faces, uv[viewed.uv_faces]).distortion
    damaged = dataclasses.replace(viewed, uv=uv, distortion=distortion)
    return damaged, damaged.view(tmp_path_factory.mktemp("damaged") / "page.html", show="faults")


def chart_of(result):
    from coneflat.mesh import label_faces

    return np.unique(label_faces(result.uv_faces, len(result.uv))[1], return_inverse=True)[1].reshape(-1)


def test_faults_are_coloured_counted_and_visited(browser, damaged_page):
    from coneflat.apps.view import uv_faults

    damaged, path = damaged_page
    visit = Visit(browser, path)
    bits = uv_faults(damaged).bits
    counts = uv_faults(damaged).counts()
    assert min(counts.values()) > 0
    np.testing.assert_array_equal(visit.run("Array.from(coneflat.model.arrays.faults)"), bits)
    legend = visit.page.inner_text("#legend")
    assert all(f"{count:,}" in legend for count in counts.values())
    visit.run("coneflat.state.set({seams: false, cones: false})")
    places = damaged.vertices[damaged.faces]
    red, purple = [0xD6, 0x22, 0x22], [0x7A, 0x35, 0xB8]
    for bit, colour in ((1, purple), (2, red)):
        # The largest triangle of the kind has its colour on the model, which shading makes darker at most.
        areas = np.linalg.norm(np.cross(*(places[:, k] - places[:, 0] for k in (1, 2))), axis=1)
        shown = np.flatnonzero((bits & bit > 0) & ((bits & 1 > 0) == (bit == 1)))
        index = int(shown[np.argmax(areas[shown])])
        visit.run(f"coneflat.find({thing('triangle', index)})")
        visit.run("coneflat.state.set({picked: null})")
        (x, y), box = visit.at("model", thing("triangle", index))[0], visit.box("model")
        seen = visit.picture("model")[int(y - box["y"]), int(x - box["x"])]
        assert np.abs(seen / seen.max() - np.array(colour) / max(colour)).max() < 0.12, (bit, seen)
    # In the layout, flipped triangles are not hidden by those that they overlap.
    visit.run("coneflat.panes.forEach((pane) => pane.camera.fit())")
    assert (np.abs(visit.picture("layout") - purple).max(axis=2) < 8).sum() > 20
    visited = []
    for press in (lambda: visit.page.keyboard.press("j"), lambda: visit.page.click("#next-fault")) * 2:
        press()
        visit.wait_until_drawn()
        index = visit.state("picked")["index"]
        visited.append(index)
        assert bits[index]
        assert "Fault" in visit.page.inner_text("#facts")
        for pane in ("model", "layout"):
            (x, y), box = visit.at(pane, thing("triangle", index))[0], visit.box(pane)
            assert 0 < x - box["x"] < box["width"]
            assert 0 < y - box["y"] < box["height"]
    assert len({*visited}) == min(4, visit.run("coneflat.model.faultCount"))
    visit.close()


def test_a_good_layout_has_no_fault_to_visit(visit):
    visit.page.keyboard.press("j")
    assert visit.state("show") == "faults"
    assert visit.state("picked") is None
    assert visit.page.is_disabled("#next-fault")


def test_the_unit_square_is_in_the_view_of_the_layout(visit):
    box = visit.box("layout")
    picture = visit.picture("layout")
    for side in ([0.5, 0], [1, 0.5], [0.5, 1], [0, 0.5]):
        x, y, _ = visit.run(
            f"coneflat.panes[1].camera.project(coneflat.model.planePlace({side[0]}, {side[1]}))"
        )
        assert 0 < x < box["width"]
        assert 0 < y < box["height"]
        # The line is dashed, grey on white.
        surroundings = picture[max(int(y) - 9, 0) : int(y) + 9, max(int(x) - 9, 0) : int(x) + 9].reshape(
            -1, 3
        )
        assert (np.abs(surroundings - [0x80, 0x88, 0x90]).max(axis=1) < 40).any(), side


def test_the_texture_of_a_file_is_shown_first(browser, tmp_path):
    from click.testing import CliRunner

    from coneflat.apps.cli.main import cli

    pytest.importorskip("PIL")
    (tmp_path / "ball.glb").write_bytes(coloured_ball())
    for words in ([], ["--again"]):
        page = tmp_path / "page.html"
        done = CliRunner().invoke(cli, ["view", str(tmp_path / "ball.glb"), *words, "-o", str(page)])
        assert done.exit_code == 0, done.output
        visit = Visit(browser, page)
        assert visit.state("show") == "picture"
        visit.run("coneflat.state.set({seams: false, cones: false})")
        picture = visit.picture("model").reshape(-1, 3)
        is_red, is_green = picture[:, 0] > 2 * picture[:, 1] + 40, picture[:, 1] > 2 * picture[:, 0] + 40
        assert min(is_red.mean(), is_green.mean()) > 0.02
        visit.close()
    done = CliRunner().invoke(cli, ["view", str(tmp_path / "ball.glb"), "--show", "qc", "-o", str(page)])
    assert '"show":"qc"' in page.read_text()


def test_everything_that_can_be_shown_looks_different(visit):
    seen = []
    for show in SHOWS:
        visit.page.select_option("#show", show)
        assert visit.state("show") == show
        has_scale = show in ("qc", "area", "strain", "curvature", "flat")
        assert visit.page.is_visible("#scale") == has_scale
        assert visit.page.is_visible("#file-label") == (show == "picture")
        seen.append(visit.picture("layout"))
        assert not any(np.array_equal(seen[-1], picture) for picture in seen[:-1])
    visit.page.select_option("#show", "qc")
    assert visit.page.locator("#scale-ticks span").count() == 3
    visit.page.mouse.move(*visit.at("layout", thing("triangle", 200))[0])
    place = float(visit.page.get_attribute("#scale-mark", "style").split("left:")[1].split("%")[0]) / 100
    value = visit.run("coneflat.model.arrays.qc[200]")
    low, high = visit.run("[coneflat.model.head.scales.qc.low, coneflat.model.head.scales.qc.high]")
    assert place == pytest.approx(min((value - low) / (high - low), 1), abs=1e-3)


def test_a_picture_lies_upright(browser, viewed, tmp_path):
    path = viewed.view(tmp_path / "page.html", texture=quarters(tmp_path / "quarters.png"))
    visit = Visit(browser, path)
    visit.run("coneflat.state.set({seams: false, cones: false})")
    assert visit.state("show") == "picture"
    for i, j in inner_points(viewed, 0.07):
        u, v = 0.07 * (i + 0.5), 0.07 * (j + 0.5)
        if min(abs(u - 0.5), abs(v - 0.5)) > 0.05:
            assert np.abs(colour_at(visit, u, v) - expected_quarter(u, v)).max() < 8
    visit.close()


def is_marked(visit, pane, x, y, reach=16):
    """Whether the accent colour of marks is seen near a place."""
    box = visit.box(pane)
    picture = visit.picture(pane)
    row, column = round(y - box["y"]), round(x - box["x"])
    part = picture[max(row - reach, 0) : row + reach, max(column - reach, 0) : column + reach]
    return (np.abs(part - [0xD6, 0x00, 0x6C]).max(axis=2) < 60).any()


def test_pointing_finds_a_triangle_on_both_sides(visit, viewed):
    visit.run("coneflat.state.set({seams: false, cones: false})")  # which come before triangles
    for index in (0, 123, 777, len(viewed.faces) - 1):
        visit.page.mouse.move(*visit.at("layout", thing("triangle", index))[0])
        assert visit.state("hovered") == {"kind": "triangle", "index": index}
        assert f"Triangle {index:,}" in visit.page.inner_text("#facts")
        assert f"QC {viewed.distortion.qc[index]:.4f}" in visit.page.inner_text("#facts")
        for pane in ("model", "layout"):
            (x, y), box = visit.at(pane, thing("triangle", index))[0], visit.box(pane)
            if 0 < x - box["x"] < box["width"] and 0 < y - box["y"] < box["height"]:
                assert is_marked(visit, pane, x, y)
    visit.page.mouse.move(5, 5)
    assert visit.state("hovered") is None


def test_a_click_keeps_a_cone_and_turns_the_model_to_it(visit, viewed):
    for index in range(len(viewed.cones)):
        visit.page.mouse.click(*visit.at("layout", thing("cone", index))[0])
        assert visit.state("picked") == {"kind": "cone", "index": index}
        visit.wait_until_drawn()
        assert visit.run(f"coneflat.marks.isSeen(coneflat.panes[0], {thing('cone', index)}, coneflat.state)")
        (x, y), box = visit.at("model", thing("cone", index))[0], visit.box("model")
        assert 0 < x - box["x"] < box["width"]
        assert 0 < y - box["y"] < box["height"]
        assert is_marked(visit, "model", x, y)
        assert f"{np.degrees(abs(viewed.curvatures[index])):.1f}°" in visit.page.inner_text("#facts")
    visit.page.keyboard.press("Escape")
    assert visit.state("picked") is None


def test_mouse_turns_moves_and_zooms(visit):
    for pane, turns in (("model", True), ("layout", False)):
        box = visit.box(pane)
        x, y = round(box["x"] + box["width"] / 2), round(box["y"] + box["height"] / 2)
        camera = f"coneflat.panes[{int(not turns)}].camera"
        turn, pan = visit.run(f"[{camera}.turn, {camera}.pan]")
        visit.page.mouse.move(x, y)
        visit.page.mouse.down()
        visit.page.mouse.move(x + 60, y + 30, steps=4)
        visit.page.mouse.up()
        assert (visit.run(f"{camera}.turn") != turn) == turns
        assert (visit.run(f"{camera}.pan") != pan) != turns
        rows = np.array(visit.run(f"{camera}.turn")).reshape(3, 3)
        np.testing.assert_allclose(rows @ rows.T, np.eye(3), atol=1e-12)
        # What is under the pointer stays there.
        back = f"[({x - 100} - {box['x']} - {camera}.width / 2) / {camera}.scale + {camera}.pan[0], {camera}.zoom]"
        visit.page.mouse.move(x - 100, y)
        place, zoom = visit.run(back)
        visit.page.mouse.wheel(0, -300)
        visit.wait(f"{camera}.zoom > {1.3 * zoom}")
        later, _ = visit.run(back)
        assert later == pytest.approx(place)
        visit.page.mouse.dblclick(x, y)
        assert visit.run(f"{camera}.zoom") == 1
    assert visit.state("hovered") is None or visit.state("picked") is not None


def test_keys_do_what_the_help_says(visit):
    press = visit.page.keyboard.press
    for key, name in (("s", "seams"), ("c", "cones"), ("t", "edges"), ("r", "report"), ("d", "dark")):
        was = visit.state(name)
        press(key)
        assert visit.state(name) is not was
    for number, show in enumerate(SHOWS[:9], 1):
        press(str(number))
        assert visit.state("show") == show
    squares = visit.state("squares")
    press("]")
    assert visit.state("squares") > squares
    press("[")
    assert visit.state("squares") == pytest.approx(squares)
    visit.page.focus("#layout")
    camera = "coneflat.panes[1].camera"
    pan = visit.run(f"{camera}.pan")
    press("ArrowLeft")
    assert visit.run(f"{camera}.pan") != pan
    press("+")
    assert visit.run(f"{camera}.zoom") > 1
    press("0")
    assert (visit.run(f"{camera}.zoom"), visit.run(f"{camera}.pan")) == (1, pan)
    visit.page.focus("#model")
    turn = visit.run("coneflat.panes[0].camera.turn")
    press("ArrowUp")
    assert visit.run("coneflat.panes[0].camera.turn") != turn
    press("w")
    worst = visit.state("picked")["index"]
    qc = np.array(visit.run("Array.from(coneflat.model.arrays.qc)"))
    assert qc[worst] == np.nanmax(qc)
    press("Escape")
    press("?")
    assert visit.page.is_visible("#keys")
    press("Escape")
    assert not visit.page.is_visible("#keys")
    press("Enter")
    assert visit.state("picked") is None or visit.state("picked")["kind"] in ("triangle", "seam", "cone")
