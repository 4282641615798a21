"""The studio with meshes that need a repair, and with settings that have no layout."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from test_studio_session import settled

import coneflat
from coneflat.apps.studio.session import Session

pytestmark = pytest.mark.slow


@pytest.fixture
def open_mesh(tmp_path):
    opened = Session(tmp_path)

    def opening(vertices, faces, name="mesh.obj"):
        opened.open(shapes.write_obj(tmp_path / name, vertices, faces))
        return opened, settled(opened)

    yield opening
    opened.close()


def with_a_fin():
    """A ball with a third triangle at the edge 0-1 of its first triangle."""
    vertices, faces = shapes.sphere(1)
    a, b = faces[0, :2]
    return np.concatenate([vertices, [2 * vertices[a]]]), np.concatenate([faces, [[a, b, len(vertices)]]])


def two_balls_that_touch():
    vertices, faces = shapes.sphere(1)
    top = int(vertices[:, 2].argmax())
    copies = np.arange(len(vertices)) + len(vertices)
    copies[top] = top
    low = vertices * [1, 1, -1] + [0, 0, 2 * vertices[top, 2]]
    return np.concatenate([vertices, low]), np.concatenate([faces, copies[faces][:, ::-1]])


def moebius(count=24):
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    side = np.array([-0.3, 0.3])[:, None]
    radius = 1 + side * np.cos(angle / 2)
    places = np.stack([radius * np.cos(angle), radius * np.sin(angle), side * np.sin(angle / 2)], axis=-1)
    low, high = np.arange(count), np.arange(count) + count
    next_low, next_high = np.roll(low, -1), np.roll(high, -1)
    next_low[-1], next_high[-1] = high[0], low[0]
    faces = np.concatenate([np.stack([low, next_low, high], 1), np.stack([next_low, next_high, high], 1)])
    return places.reshape(-1, 3), faces


def with_a_degenerate_face():
    vertices, faces = shapes.sphere(1)
    return vertices, np.concatenate([faces, [[3, 3, 4]]])


BROKEN = {
    "fin": (with_a_fin, "1 edge with more than two faces"),
    "touching": (two_balls_that_touch, "1 vertex where surfaces touch in a single point"),
    "moebius": (moebius, "the surface is not orientable"),
    "degenerate": (with_a_degenerate_face, "1 face with the same vertex twice"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_mesh_that_needs_repair_is_repaired_with_a_note_and_an_undo(open_mesh, name):
    make, wrong = BROKEN[name]
    session, state = open_mesh(*make())
    assert (state["trouble"], state["bare"], state["undo"]) == (None, False, 1)
    assert state["choices"]["options"] == {"repair": True}
    warning, *notes = state["warnings"]
    assert notes == session.picture()[0]["notes"]
    assert warning.startswith(f"The mesh was repaired: {wrong}")
    assert "repair=True" not in warning
    bad = session.picture()[0]["bad"]
    assert bool(bad) == (name != "degenerate")
    # Undone, it is not repaired again, and what was shown is out of date.
    session.act({"do": "undo"})
    state = settled(session)
    assert wrong in state["trouble"]["text"]
    assert (state["trouble"]["repair"], state["stale"], state["redo"]) == (True, True, 1)


def test_the_bad_places_are_edges_and_vertices_of_the_input(open_mesh):
    vertices, faces = with_a_fin()
    session, _ = open_mesh(vertices, faces, "fin.obj")
    assert session.picture()[0]["bad"] == [sorted(faces[0, :2].tolist())]
    vertices, faces = two_balls_that_touch()
    session, _ = open_mesh(vertices, faces, "balls.obj")
    assert session.picture()[0]["bad"] == [[int(shapes.sphere(1)[0][:, 2].argmax())]]


def test_a_mesh_without_a_layout_is_drawn_alone(open_mesh, tmp_path):
    vertices, faces = with_a_fin()
    vertices[5] = np.nan
    session, state = open_mesh(vertices, faces, "holes.obj")
    assert state["trouble"] is not None
    assert (state["bare"], state["stale"], state["found"]) == (True, False, [])
    head, _ = session.picture()
    assert head["title"] == "No layout"
    assert 0 < head["triangles"] < len(faces)


def test_a_sphere_without_cones_is_drawn_when_it_is_opened_again(open_mesh, tmp_path):
    session, state = open_mesh(*shapes.sphere(1))
    for vertex in state["found"]:
        session.act({"do": "remove", "vertex": vertex})
    state = settled(session)
    assert state["stale"]
    session.close()
    again = Session(tmp_path)
    try:
        again.open(tmp_path / "mesh.obj")
        state = settled(again)
        assert (state["bare"], state["undo"], state["trouble"]["again"]) == (True, 0, False)
        again.act({"do": "set", "name": "distortion", "value": 0.2})
        state = settled(again)
        assert (state["bare"], state["stale"], state["trouble"]) == (False, False, None)
        assert again.picture()[0]["triangles"] == len(shapes.sphere(1)[1])
    finally:
        again.close()


def test_a_repaired_layout_is_that_of_the_library(open_mesh):
    vertices, faces = with_a_fin()
    session, _ = open_mesh(vertices, faces)
    result = coneflat.flatten(vertices, faces, repair=True)
    assert session.picture()[0]["triangles"] == len(result.faces)
