"""Quads in the studio: computed on request, with progress, and shown before they are saved."""

from __future__ import annotations

import threading

import numpy as np
import pytest
import shapes

import coneflat
from coneflat.apps.studio.choices import Choices
from coneflat.apps.studio.requests import Cancelled
from coneflat.apps.studio.session import Session
from coneflat.errors import OptionError, StudioError


@pytest.fixture
def session(tmp_path):
    opened = Session(tmp_path)
    opened.open(shapes.write_obj(tmp_path / "hill.obj", *shapes.hill(16, 12)))
    assert opened.wait_until_idle(120)
    yield opened
    opened.close()


def test_quads_are_shown_and_saved_until_the_choices_change(session, tmp_path):
    assert session.state()["quads"] == 0
    with pytest.raises(StudioError, match="compute them first"):
        session.save_quads(".obj")
    running = []
    session.listen(lambda: running.append(session.state()["making"]))
    session.make_quads(300)
    kinds, fractions = zip(*((now["kind"], now["fraction"]) for now in running if now), strict=True)
    assert set(kinds) == {"quads"}
    assert list(fractions) == sorted(fractions)
    assert len(set(fractions)) > 3
    state = session.state()
    assert (state["quads"], state["making"]) == (1, None)
    assert b"irregular" in session.quads_page()

    expected = coneflat.quads(tmp_path / "hill.obj", quads=300)
    for ending in (".obj", ".ply", ".glb"):
        file = tmp_path / f"quads{ending}"
        file.write_bytes(session.save_quads(ending))
    saved = coneflat.read_mesh(tmp_path / "quads.obj")
    assert np.diff(saved.offsets).tolist() == [4] * len(expected.quads)
    np.testing.assert_allclose(saved.vertices, expected.vertices, atol=1e-6)
    with pytest.raises(StudioError, match="unknown format"):
        session.save_quads(".exe")

    session.act({"do": "set", "name": "stretch", "value": 0.5})
    assert session.state()["quads"] == 0
    with pytest.raises(StudioError, match="compute them first"):
        session.quads_page()


def test_a_number_of_quads_that_is_not_valid_is_refused(session):
    for count in (0, 2_000_000):
        with pytest.raises(StudioError, match="from 1 to 1,000,000"):
            session.make_quads(count)
    with pytest.raises(OptionError, match="must be a number"):
        session.make_quads("many")


def begin(session, function, *arguments):
    """Call a function in a thread; return a list that gets its error, the thread, and wait for its progress."""
    errors, started = [], threading.Event()
    session.listen(lambda: session.state()["making"] and started.set())

    def calling():
        try:
            function(*arguments)
        except StudioError as error:
            errors.append(error)

    thread = threading.Thread(target=calling, daemon=True)
    thread.start()
    assert started.wait(120)
    return errors, thread


@pytest.mark.parametrize("kind", ["quads", "curve"])
def test_the_user_cancels_quads_and_curves(session, kind):
    function, arguments = {"quads": (session.make_quads, (20_000,)), "curve": (session.curve, ())}[kind]
    errors, thread = begin(session, function, *arguments)
    session.cancel()
    thread.join(120)
    assert [type(error) for error in errors] == [Cancelled]
    state = session.state()
    assert (state["quads"], state["making"], state["trouble"]) == (0, None, None)
    session.make_quads(200)  # The worker continues.
    assert session.state()["quads"] == 1


def test_a_change_cancels_quads(session):
    errors, thread = begin(session, session.make_quads, 20_000)
    session.act({"do": "set", "name": "stretch", "value": 0.5})
    thread.join(120)
    assert "the choices have changed" in str(errors[0])


def test_a_cancelled_layout_leaves_the_last_one(tmp_path):
    session = Session(tmp_path)
    try:
        session.open(shapes.write_obj(tmp_path / "ball.obj", *shapes.sphere(4)))
        assert session.wait_until_idle(120)
        before = session.state()
        session.act({"do": "texture", "value": True})
        session.cancel()
        assert session.wait_until_idle(120)
        state = session.state()
        assert (state["layout"], state["stale"]) == (before["layout"], True)
        assert "cancelled" in state["trouble"]["text"]
        assert state["trouble"]["again"]
        session.act({"do": "undo"})
        assert session.wait_until_idle(120)
        assert (session.state()["stale"], session.state()["trouble"]) == (False, None)
        assert session.state()["choices"] == Choices().as_plain()
    finally:
        session.close()
