"""The studio of a mesh of which the page draws fewer triangles than it has: it is painted all the same."""
# ruff: noqa: F811  (fixtures that are imported)

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import shapes
from studio_browsing import open_page  # noqa: F401

import coneflat
from coneflat.apps.studio.child import Bench, with_whole
from coneflat.apps.studio.choices import Choices
from coneflat.apps.studio.paint import Region
from coneflat.apps.studio.project import hash_of
from coneflat.view.page.content import Model

SHOWN = 4000  # triangles, of 20,480


@pytest.fixture
def ball(tmp_path):
    """A mesh with a vertex that no face uses, so that vertices have other numbers than the page's."""
    vertices, faces = shapes.sphere(5)
    return shapes.write_obj(tmp_path / "ball.obj", np.concatenate([[[9.0, 9, 9]], vertices]), faces + 1)


@pytest.fixture
def thinned(open_page, ball):
    return open_page(ball, most_triangles=SHOWN)


def into_ball(places):
    """Return places as the page has them."""
    centred = places - (places.min(axis=0) + places.max(axis=0)) / 2
    return centred / np.linalg.norm(centred, axis=1).max()


def painted(visit, layer):
    return np.array(Region.of_text(visit.choices().get("paint", {}).get(layer, "")).vertices())


def shown_numbers(visit):
    return set(
        visit.run("Array.from(new Set(coneflat.model.arrays.point_vertex), (v) => studio.numberOf(v))")
    )


def test_a_brush_has_its_radius_on_the_whole_mesh(thinned, ball):
    page, mesh = thinned.page, coneflat.read_mesh(ball)
    assert thinned.run("coneflat.model.head.left_out") > 16_000
    shown = shown_numbers(thinned)
    assert len(shown) < 2500
    box = thinned.box("model")
    page.keyboard.press("p")
    assert page.locator("#refusal").is_hidden()
    for _ in range(4):
        page.keyboard.press(".")
    at = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.click(*at)
    thinned.settle()
    found = painted(thinned, "no_cone")
    assert len(found) > 2 * len(shown & set(found.tolist())) > 20
    # All vertices within its radius of where it was, and no others.
    middle = thinned.run(f"studio.tools.placeAt(coneflat.panes[0], {at[0] - box['x']}, {at[1] - box['y']})")
    radius = thinned.run("studio.brush.radius / coneflat.panes[0].camera.scale")
    far = np.linalg.norm(into_ball(mesh.vertices[1:]) - middle, axis=1)
    inside = np.flatnonzero(far <= radius) + 1
    at_its_rim = np.flatnonzero(np.abs(far - radius) < 1e-5) + 1
    assert set(np.setxor1d(found, inside).tolist()) <= set(at_its_rim.tolist())
    # It binds the search, and is seen.
    assert not set(thinned.studio.session.state()["found"]) & set(found.tolist())
    assert thinned.run("coneflat.renderer.look.marks") is not None


def test_in_the_layout_what_is_drawn_stands_for_what_is_around(thinned):
    page, box = thinned.page, thinned.box("layout")
    page.keyboard.press("b")
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    within = set(
        thinned.run(
            "(() => { const pane = coneflat.panes[1], {model} = coneflat, near = [];"
            "model.arrays.point_vertex.forEach((v, p) => { const [x, y] = pane.camera.project(model.flatPlace(p));"
            "const far = Math.hypot(x - pane.width / 2, y - pane.height / 2);"
            "if (far <= studio.brush.radius) near.push(studio.numberOf(v)); });"
            "return near; })()"
        )
    )
    shown = shown_numbers(thinned)
    thinned.settle()
    found = set(painted(thinned, "no_seam").tolist())
    assert within
    # Of those that are drawn, it paints the ones under it, and the one nearest to its middle.
    assert within <= found & shown
    assert len((found & shown) - within) <= 1
    assert len(found) > 2 * len(found & shown)


def test_paths_run_along_edges_of_the_whole_mesh(thinned, ball):
    page, mesh = thinned.page, coneflat.read_mesh(ball)
    (one, two), shown = thinned.visible_vertices(9)[2:7:4], shown_numbers(thinned)
    page.keyboard.press("x")
    page.mouse.click(*thinned.place_of(one))
    page.mouse.click(*thinned.place_of(two))
    thinned.settle()
    (path,) = thinned.choices()["cuts"]
    assert (path[0], path[-1]) == (one, two)
    edges = {
        tuple(edge)
        for edge in np.sort(coneflat.TriangleMesh(mesh.vertices, mesh.corners.reshape(-1, 3)).edges)
    }
    assert {tuple(sorted(pair)) for pair in pairwise(path)} <= edges
    assert not set(path) <= shown


def test_a_cone_stays_picked_as_the_layout_changes(thinned):
    page = thinned.page
    (vertex,) = thinned.visible_vertices(1)
    page.keyboard.press("a")
    page.mouse.click(*thinned.place_of(vertex))
    thinned.settle()
    assert thinned.run("studio.selectedNumber()") == vertex
    thinned.run(f"studio.setAngle({vertex}, 300)")
    thinned.settle()
    assert thinned.run("studio.selectedNumber()") == vertex


def test_the_whole_mesh_goes_beside_what_is_shown(ball):
    bench = Bench()
    job = {"mesh": str(ball), "sha256": hash_of(ball), "choices": Choices().as_plain()}

    def arrays(**more):
        head, body = bench.flatten({**job, **more}, lambda stage, fraction: None, lambda head, body: None)
        types = {"f4": np.float32, "u4": np.uint32, "i4": np.int32}
        return {
            each["name"]: np.frombuffer(body, types[each["type"]], each["count"], each["offset"])
            for each in head["head"]["arrays"]
            if each["type"] in types
        }

    assert "whole_faces" not in arrays()
    found, vertices, faces = arrays(most=SHOWN), *shapes.sphere(5)
    np.testing.assert_array_equal(found["whole_faces"].reshape(-1, 3), faces)
    assert found["whole_places"].reshape(-1, 3) == pytest.approx(into_ball(vertices), abs=1e-6)
    np.testing.assert_array_equal(found["whole_numbers"], np.arange(len(vertices)) + 1)
    model = Model.of(bench.result)
    head, _ = with_whole({"arrays": []}, b"", model, bench.result)
    assert [each["name"] for each in head["arrays"]] == ["whole_places", "whole_faces", "whole_numbers"]


def test_the_view_stays_as_the_layout_changes(thinned):
    page, box = thinned.page, thinned.box("model")
    page.mouse.move(box["x"] + 8, box["y"] + box["height"] - 8)
    page.mouse.down()
    page.mouse.move(box["x"] + 90, box["y"] + box["height"] - 60, steps=3)
    page.mouse.up()
    page.mouse.wheel(0, -200)
    view = "[coneflat.panes[0].camera.turn.join(), coneflat.panes[0].camera.zoom]"
    before, faces = thinned.run(view), thinned.run("coneflat.model.arrays.faces.length")
    thinned.run("studio.setCount(12)")
    thinned.settle()
    assert thinned.run("coneflat.model.arrays.faces.length") != faces
    assert thinned.run(view) == before
