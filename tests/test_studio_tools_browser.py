"""Stories of the studio's brushes, corners, curve and sizes in a browser."""
# ruff: noqa: F811  (fixtures that are imported)

from __future__ import annotations

import json

import numpy as np
import pytest
import shapes
from click.testing import CliRunner
from studio_browsing import open_page, sample, studio, visit  # noqa: F401

import coneflat
from coneflat.apps.cli.main import cli
from coneflat.apps.studio.paint import Region


@pytest.fixture
def hill(open_page, tmp_path):
    return open_page(shapes.write_obj(tmp_path / "hill.obj", *shapes.hill(16, 12)))


def painted(visit, layer):
    paint = visit.choices().get("paint", {})
    return set(Region.of_text(paint.get(layer, "")).vertices())


def refuses(visit, message):
    """Wait until the panel says so."""
    visit.wait(f"document.getElementById('refusal-text').textContent.includes({json.dumps(message)})")
    assert visit.page.locator("#refusal").is_visible()
    visit.rest()
    visit.troubles.clear()  # The browser tells of the refusal, too.


def test_a_brush_paints_on_both_sides(visit, studio, tmp_path):
    page = visit.page
    visit.settle()
    bare = visit.picture("model")
    vertices = visit.visible_vertices(9)
    turn = visit.run("coneflat.panes[0].camera.turn.join()")

    # A stroke on the model is one step, and its colour is seen.
    page.keyboard.press("p")
    (x, y), (to_x, to_y) = (visit.place_of(vertices[k]) for k in (3, 4))
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(to_x, to_y, steps=6)
    page.mouse.up()
    visit.settle()
    assert visit.run("coneflat.panes[0].camera.turn.join()") == turn
    no_cone = painted(visit, "no_cone")
    assert {vertices[3], vertices[4]} <= no_cone
    assert studio.session.state()["undo"] == 1
    page.mouse.move(1, 1)
    changed = np.abs(visit.picture("model") - bare).max(axis=2) > 40
    assert changed.mean() > 0.003
    # What is painted hangs together around the stroke.
    places = coneflat.read_mesh(tmp_path / "sample.obj").vertices
    ends = places[[vertices[3], vertices[4]]]
    radius = visit.run("studio.brush.radius / coneflat.panes[0].camera.scale * coneflat.model.head.radius")
    off = np.linalg.norm(places[sorted(no_cone)][:, None] - ends, axis=2).min(axis=1)
    assert off.max() < radius + np.linalg.norm(ends[1] - ends[0])

    # In the layout, by the keys alone, with a larger brush: of what is in the middle.
    page.locator("#layout").focus()
    page.keyboard.press("b")
    page.keyboard.press(".")
    assert visit.run("studio.brush.radius") == 35
    within = visit.run(
        "(() => { const pane = coneflat.panes[1], {model} = coneflat, near = [];"
        "model.arrays.point_vertex.forEach((v, p) => { const [x, y] = pane.camera.project(model.flatPlace(p));"
        "if (Math.hypot(x - pane.width / 2, y - pane.height / 2) <= 35) near.push(studio.numberOf(v)); });"
        "return near; })()"
    )
    page.keyboard.press("Enter")
    visit.settle()
    no_seam = painted(visit, "no_seam")
    assert set(within) == no_seam
    assert len(no_seam) > 20

    # Importance, and an eraser; everything is told to the command line by the project.
    page.keyboard.press("i")
    page.select_option("#brush-weight", "100")
    page.mouse.click(*visit.place_of(vertices[6]))
    visit.settle()
    assert vertices[6] in Region.of_text(visit.choices()["paint"]["importance"]["100.0"]).vertices()
    page.keyboard.press("e")
    page.mouse.click(*visit.place_of(vertices[3]))
    visit.settle()
    assert vertices[3] not in painted(visit, "no_cone")
    made = tmp_path / "made.npz"
    project = str(tmp_path / "sample_studio.json")
    assert CliRunner().invoke(cli, ["flatten", "--project", project, "-o", str(made)]).exit_code == 0
    with page.expect_download() as download:
        page.click("#save-npz")
    download.value.save_as(tmp_path / "saved.npz")
    saved, again = (coneflat.read_flattening(tmp_path / name) for name in ("saved.npz", "made.npz"))
    np.testing.assert_array_equal(saved.uv, again.uv)
    # Only what must be parted so that nothing overlaps may be cut there, which is told.
    cut = np.isin(saved.seams, sorted(painted(visit, "no_seam"))).all(axis=1).sum()
    told = [note for note in visit.run("coneflat.model.head.notes") if note.startswith("Cut all the same")]
    assert [note.split()[4] for note in told] == [str(cut)] * int(cut > 0)

    # Undone to the bare model, the colours too.
    page.keyboard.press("v")
    for _ in range(4):
        page.keyboard.press("u")
    visit.settle()
    assert "paint" not in visit.choices()
    page.mouse.move(1, 1)
    page.evaluate("coneflat.state.set({hovered: null, picked: null})")
    page.evaluate("document.activeElement.blur()")
    assert visit.run("coneflat.renderer.look.marks") is None
    assert (np.abs(visit.picture("model") - bare).max(axis=2) > 40).mean() < changed.mean() / 2


def test_a_drag_beside_the_model_turns_it(visit):
    page, box = visit.page, visit.box("model")
    visit.settle()
    page.keyboard.press("p")
    turn = visit.run("coneflat.panes[0].camera.turn.join()")
    page.mouse.move(box["x"] + 8, box["y"] + box["height"] - 8)
    page.mouse.down()
    page.mouse.move(box["x"] + 60, box["y"] + box["height"] - 30, steps=3)
    page.mouse.up()
    visit.settle()
    assert visit.run("coneflat.panes[0].camera.turn.join()") != turn
    assert "paint" not in visit.choices()


def test_four_corners_make_a_rectangle(hill, tmp_path):
    page = hill.page
    page.select_option("#boundary", "rectangle")
    hill.settle()
    assert "four corners" in page.inner_text("#corners-left")
    assert hill.run("studio.tools.mode") == "corner"
    assert hill.run("coneflat.model.head.sizes.boundary") > 0
    vertices = coneflat.read_mesh(tmp_path / "hill.obj").vertices
    low, high = vertices[:, :2].min(axis=0), vertices[:, :2].max(axis=0)
    corners = [
        int(np.argmin(np.linalg.norm(vertices[:, :2] - end, axis=1)))
        for end in (low, high, (low[0], high[1]), (high[0], low[1]))
    ]
    for vertex in corners:
        x, y = hill.place_of(vertex)
        middle = hill.place_of(len(vertices) // 2)
        # A little inside, where there is a triangle.
        page.mouse.click(x + 0.03 * (middle[0] - x), y + 0.03 * (middle[1] - y))
        hill.settle()
    assert hill.choices()["corners"] == sorted(corners)
    assert page.locator("#corners-left").is_hidden()
    assert hill.run("studio.news.trouble") is None
    uv = np.array(hill.run("Array.from(coneflat.model.arrays.uv)")).reshape(-1, 2)
    sides = uv.max(axis=0) - uv.min(axis=0)
    # The four corners are those of the box around the layout, which stands straight or not: by their distances.
    points = np.array(
        [
            uv[hill.run(f"studio.pointsOf(studio.verticesOf([{vertex}])[0])[0]")]
            for vertex in (corners[0], corners[2], corners[1], corners[3])
        ]
    )
    around = np.roll(points, -1, axis=0) - points
    assert np.abs(np.einsum("ij,ij->i", around, np.roll(around, -1, axis=0))).max() < 1e-3 * sides.max() ** 2
    # One is taken away in the layout.
    page.locator("#layout").focus()
    box = hill.box("layout")
    x, y = hill.run(
        f"studio.overlay.places(coneflat.panes[1], studio.verticesOf([{corners[0]}])[0])[0].slice(0, 2)"
    )
    page.mouse.click(box["x"] + x, box["y"] + y)
    hill.settle()
    assert hill.choices()["corners"] == sorted(corners[1:])
    assert "one more corner" in page.inner_text("#corners-left")


def test_there_are_no_corners_without_a_boundary(visit):
    visit.settle()
    visit.page.keyboard.press("o")
    visit.page.locator("#model").focus()
    visit.page.keyboard.press("Enter")
    refuses(visit, "no boundary to pick corners of")
    assert visit.page.locator("#tool-corner").is_hidden()
    visit.troubles.clear()


def test_the_curve_offers_numbers_of_cones(visit):
    page = visit.page
    visit.settle()
    page.keyboard.press("q")
    visit.wait("studio.panel.curve.found")
    found = visit.run("studio.panel.curve.found")
    assert np.all(np.diff(found["distortions"]) < 0)
    curve = coneflat.cone_curve(coneflat.sample_path())
    assert found["counts"] == curve.counts.tolist()
    assert "most is gained up to" in page.get_attribute("#curve", "aria-label")
    at = visit.run(f"studio.panel.curve.places().x({curve.knee})")
    box = page.locator("#curve").bounding_box()
    page.mouse.click(box["x"] + at, box["y"] + 40)
    visit.settle()
    assert visit.choices()["options"] == {"cone_count": curve.knee}
    assert len(visit.cones()) == curve.knee
    # It holds until what it depends on changes.
    page.locator(".cone .toggle").first.click()
    visit.settle()
    assert page.locator("#curve").is_hidden()
    assert page.locator("#curve-ask").is_enabled()


def test_sizes_are_shown_in_a_unit(hill, tmp_path):
    page = hill.page
    page.click("#sizes summary")
    result = coneflat.flatten(tmp_path / "hill.obj")
    mesh = coneflat.TriangleMesh(result.vertices, result.faces)
    a, b = result.vertices[mesh.edges[mesh.is_boundary_edge]].transpose(1, 0, 2)
    length = np.linalg.norm(b - a, axis=1).sum()
    shown = [page.inner_text(f"#size-list dd:nth-of-type({k})") for k in (1, 2, 3)]
    assert float(shown[2]) == pytest.approx(length, rel=1e-3)
    a, b, c = result.vertices[result.faces].transpose(1, 0, 2)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    assert float(shown[0]) == pytest.approx(area, rel=1e-3)
    page.select_option("#unit", "inch")
    page.select_option("#shown-in", "cm")
    hill.settle()
    assert page.inner_text("#size-list dd:nth-of-type(3)").endswith(" cm")
    assert float(page.inner_text("#size-list dd:nth-of-type(3)").split()[0]) == pytest.approx(
        2.54 * length, rel=1e-3
    )
    assert float(page.inner_text("#size-list dd:nth-of-type(1)").split()[0]) == pytest.approx(
        2.54**2 * area, rel=1e-3
    )
    assert hill.run("studio.layout") == 1


def test_a_picture_a_report_and_quads_are_saved(hill, tmp_path):
    page = hill.page
    for what, begins in (("png", b"\x89PNG"), ("json", b"{")):
        with page.expect_download() as download:
            page.click(f"#save-{what}")
        download.value.save_as(tmp_path / f"x.{what}")
        assert (tmp_path / f"x.{what}").read_bytes().startswith(begins)
    assert json.loads((tmp_path / "x.json").read_text())["flipped"] == 0
    page.fill("#quad-count", "300")
    with page.expect_download() as download:
        page.click("#save-quads")
    assert download.value.suggested_filename == "hill_quads.obj"
    download.value.save_as(tmp_path / "quads.obj")
    mesh = coneflat.read_mesh(tmp_path / "quads.obj")
    assert set(np.diff(mesh.offsets)) == {4}
    assert 100 < len(mesh.offsets) - 1 < 600
    page.fill("#quad-count", "0")
    page.click("#save-quads")
    refuses(hill, "from 1 to 1,000,000, not 0")


def test_controls_refuse_in_the_panel_and_keep_the_layout(hill):
    page, layout = hill.page, hill.run("studio.layout")
    for control, value, message in (
        ("#padding", "4000", "“Texels between charts” must be from 0 to a quarter"),
        ("#resolution", "0", "“Texels a side” must be from 1 to"),
        ("#cone-count", "-3", "“Number” cannot be negative"),
        ("#sharp", "500", "The sharp angle must be between 0 and pi"),
    ):
        if control == "#cone-count":
            page.select_option("#cones-by", "cone_count")
            hill.settle()
            layout = hill.run("studio.layout")
        page.fill(control, value)
        page.keyboard.press("Enter")
        refuses(hill, message)
        assert hill.run("studio.layout") == layout
    page.check("#own-seams")
    hill.settle()
    refuses(hill, "no UV coordinates")
    assert hill.run("studio.layout") == layout
    page.keyboard.press("Escape")
    page.click("#undo")
    hill.settle()
    assert page.locator("#own-seams").is_checked() is False


def test_paths_follow_sharp_edges(open_page, tmp_path):
    """On a box the way along its edges is as long as many others; a drawn one takes it."""
    opened = open_page(shapes.write_obj(tmp_path / "box.obj", *shapes.box(6, (1.0, 1.0, 1.0))))
    mesh = coneflat.read_mesh(tmp_path / "box.obj")
    corners = [v for v, p in enumerate(mesh.vertices.tolist()) if all(x in (0.0, 1.0) for x in p)]
    one, two = next(
        (a, b) for a in corners for b in corners
        if np.abs(mesh.vertices[a] - mesh.vertices[b]).sum() == 2
    )  # fmt: skip

    def sharp_share():
        path = opened.run(
            f"studio.graph().path(...studio.verticesOf([{one}, {two}])).map((v) => studio.numberOf(v))"
        )
        places = mesh.vertices[path]
        on_edge = ((places == 0) | (places == 1)).sum(axis=1) >= 2
        return on_edge.mean()

    assert sharp_share() == 1
    opened.page.keyboard.press("f")
    assert sharp_share() < 1


def test_what_is_to_be_known_of_cones_is_said(visit):
    page = visit.page
    visit.settle()
    # An angle that no cone has is refused; one that leaves nothing for the others is told of, in degrees.
    for vertex in visit.cones():
        visit.run(f"studio.setAngle({vertex}, 350)")
        visit.settle()
    cones = visit.cones()
    assert "must sum to 2 pi chi" in page.inner_text("#refusal-text")
    visit.troubles.clear()
    # The sample has a handle: whatever its cones are, they lack nothing in all.
    assert f"in all they are {10 * len(cones)}° too narrow for this surface" in page.inner_text("#angle-sum")
    field = page.locator(f'#cone-list .cone[data-vertex="{cones[0]}"] input')
    assert field.get_attribute("max") == "720"
    field.fill("3000")
    page.keyboard.press("Enter")
    refuses(visit, "positive angle of at most 720 degrees, not 3,000")
    field.fill("")
    page.keyboard.press("Enter")
    visit.settle()
    assert page.locator("#angle-sum").is_hidden()

    # A cone that is set where none are to be is told of while it is there.
    while visit.run("studio.news.undo"):
        page.keyboard.press("Escape")
        visit.run("studio.act({do: 'undo'})")
        visit.settle()
    (vertex, *_) = visit.visible_vertices(4)
    visit.run(f"studio.act({{do: 'paint', layer: 'no_cone', where: '{vertex}'}})")
    visit.settle()
    assert page.locator("#warnings").is_hidden()
    visit.run(f"studio.act({{do: 'add', vertex: {vertex}}})")
    visit.settle()
    assert f"as painted: vertex {vertex}." in page.inner_text("#warnings")
    visit.run(f"studio.act({{do: 'remove', vertex: {vertex}}})")
    visit.settle()
    assert page.locator("#warnings").is_hidden()


def test_the_curve_is_that_of_all_parts(open_page, tmp_path):
    ball, hill = shapes.sphere(2), shapes.hill(8, 8)
    opened = open_page(shapes.write_obj(tmp_path / "two.obj", *shapes.join(ball, (hill[0] + 9, hill[1]))))
    page = opened.page
    page.keyboard.press("q")
    opened.wait("studio.panel.curve.found")
    assert "for so many cones in each of its 2 parts" in page.inner_text("#curve-of")
    # Where each part has its own number, none is marked on the curve; where both have one, that is.
    assert opened.run("studio.panel.curve.current()") is None
    count = opened.run("studio.panel.curve.found.counts[1]")
    opened.run(f"studio.setCount({count})")
    opened.settle()
    assert opened.run("studio.panel.curve.current()[0]") == count
    assert page.locator("#curve").is_visible()
