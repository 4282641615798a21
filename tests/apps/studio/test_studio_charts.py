"""Charts that are moved, pinned and packed in the studio."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import coneflat
from coneflat.apps.cli.main import cli
from coneflat.apps.studio.choices import Choices
from coneflat.apps.studio.messages import command_line, python_lines
from coneflat.apps.studio.pins import Pin, Pins, places_of_charts
from coneflat.apps.studio.project import read_project
from coneflat.apps.studio.session import Session
from coneflat.errors import OptionError, StudioError
from coneflat.mesh import label_faces

QUARTER = 1j, 0.9 + 0.1j


@pytest.fixture(scope="module")
def unpinned():
    return coneflat.unwrap(coneflat.sample_path(), charts=5)


@pytest.fixture
def session(tmp_path):
    mesh = tmp_path / "sample.obj"
    mesh.write_bytes(Path(coneflat.sample_path()).read_bytes())
    opened = Session(tmp_path)
    opened.open(mesh)
    for action in ({"do": "texture", "value": True}, {"do": "set", "name": "charts", "value": 5}):
        opened.act(action)
    assert opened.wait_until_idle(120)
    yield opened
    opened.close()


def uv_of(session, tmp_path):
    file = tmp_path / "out.npz"
    file.write_bytes(session.export(".npz"))
    return coneflat.read_flattening(file)


def first_faces(result):
    """Return the chart of each triangle, and the first triangle of each chart."""
    _, chart = label_faces(result.uv_faces, len(result.uv))
    return chart, np.unique(chart, return_index=True)[1].tolist()


class TestPins:
    def test_a_chart_has_one_pin_for_a_triangle(self):
        pins = Pins().with_pin(Pin(7)).with_pin(Pin(3, 1j)).with_pin(Pin(7, -1, 0.5j))
        assert pins.pins == (Pin(3, 1j), Pin(7, -1, 0.5j))
        assert pins.without(7).pins == (Pin(3, 1j),)
        assert Pins.from_plain(json.loads(json.dumps(pins.as_plain()))) == pins

    def test_pins_of_one_chart_are_left_out_with_a_note(self, unpinned):
        chart, first = first_faces(unpinned)
        face, neighbour = np.flatnonzero(chart == chart[first[0]])[:2].tolist()
        pins = Pins((Pin(face), Pin(neighbour, 1j), Pin(10**8)), is_packed=True)
        changed = pins.applied(unpinned)
        assert "2 pins left out" in changed.notes[-1]
        assert changed.distortion.overlapping_pairs == 0

    def test_the_places_of_charts_are_those_of_the_pins(self, unpinned):
        _, first = first_faces(unpinned)
        pins = Pins((Pin(first[1], *QUARTER),), is_packed=True)
        changed = pins.applied(unpinned)
        places = list(places_of_charts(unpinned, changed, pins, np.arange(len(unpinned.faces))))
        assert len(places) == len(first)
        assert [place[1:6] for place in places if place[6]] == [pins.pins[0].as_plain()]
        old, moved = (
            np.ascontiguousarray(layout.corner_uv).view(np.complex128)[..., 0]
            for layout in (unpinned, changed)
        )
        for index, _, a, b, u, v, _ in places:
            np.testing.assert_allclose(complex(a, b) * old[index] + complex(u, v), moved[index], atol=1e-9)

    @pytest.mark.parametrize(
        "place", [3, [1, 2], [-1, 1, 0, 0, 0], [0, 0, 0, 0, 0], [0, "x", 0, 0, 0], [0, float("nan"), 0, 0, 0]]
    )
    def test_senseless_places_are_refused(self, session, place):
        before = session.state()["choices"]
        with pytest.raises((StudioError, OptionError)):
            session.act({"do": "pin", "place": place})
        assert session.state()["choices"] == before

    def test_the_code_gives_the_same_layout(self, unpinned):
        _, first = first_faces(unpinned)
        pins = Pins((Pin(first[0], *QUARTER),), is_packed=True)
        chosen = Choices(for_texture=True, pins=pins).with_option("charts", 5)
        assert command_line("x.obj", "x_studio.json", chosen) == "coneflat unwrap --project x_studio.json"
        names: dict = {}
        exec(python_lines(str(coneflat.sample_path()), chosen), names)
        np.testing.assert_array_equal(names["result"].uv, pins.applied(unpinned).uv)
        assert "repack" not in python_lines("x.obj", chosen.with_texture(False))


class TestSession:
    def test_charts_are_moved_and_the_others_packed(self, session, unpinned, tmp_path):
        _, first = first_faces(unpinned)
        session.act({"do": "pin", "place": [first[0], 0, 1, 0.9, 0.1]})
        session.act({"do": "pack", "value": True})
        assert session.wait_until_idle(120)
        state = session.state()
        assert state["trouble"] is None
        packed = uv_of(session, tmp_path)
        expected = coneflat.repack(unpinned, moves={first[0]: QUARTER})
        np.testing.assert_array_equal(packed.uv, expected.uv)
        assert packed.distortion.overlapping_pairs == 0

        # It is saved as everything else, and undone and redone.
        assert read_project(session.project_file).choices.pins == Pins((Pin(first[0], *QUARTER),), True)
        done = CliRunner().invoke(
            cli, ["unwrap", "--project", str(session.project_file), "-o", str(tmp_path / "again.npz")]
        )
        assert done.exit_code == 0, done.output
        np.testing.assert_array_equal(coneflat.read_flattening(tmp_path / "again.npz").uv, packed.uv)
        for _ in range(2):
            session.act({"do": "undo"})
        assert session.wait_until_idle(120)
        np.testing.assert_array_equal(uv_of(session, tmp_path).uv, unpinned.uv)
        for _ in range(2):
            session.act({"do": "redo"})
        assert session.wait_until_idle(120)
        np.testing.assert_array_equal(uv_of(session, tmp_path).uv, packed.uv)

        # Pins are those of maps for textures, and are freed.
        session.act({"do": "texture", "value": False})
        assert session.wait_until_idle(120)
        assert session.state()["trouble"] is None
        session.act({"do": "texture", "value": True})
        session.act({"do": "unpin all"})
        assert session.wait_until_idle(120)
        np.testing.assert_array_equal(uv_of(session, tmp_path).uv, unpinned.uv)

    def test_pins_of_another_mesh_are_left_out_with_a_note(self, session, unpinned, tmp_path):
        session.act({"do": "pin", "place": [0, 1, 0, 0, 0]})
        session.close()
        (tmp_path / "sample.obj").write_text(Path(coneflat.sample_path()).read_text() + "\nv 9 9 9\n")
        again = Session(tmp_path)
        try:
            again.open(tmp_path / "sample.obj")
            assert again.state()["choices"].get("charts") is None
            assert any("1 pinned chart" in note for note in again.state()["warnings"])
        finally:
            again.close()

    def test_textures_that_cannot_be_repacked_are_named(self, session):
        session.act({"do": "pin", "place": [0, 1, 0, 0, 0]})
        session.act({"do": "set", "name": "tiles", "value": 2})
        assert session.wait_until_idle(120)
        assert "cannot be moved with tiles 2" in session.state()["trouble"]["text"]
