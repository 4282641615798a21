"""What is painted in the studio, and what else it has learned to choose: without its page."""

from __future__ import annotations

import random
from io import BytesIO

import numpy as np
import pytest
import shapes
from click.testing import CliRunner

import coneflat
from coneflat.apps.cli.main import cli
from coneflat.apps.studio.choices import Choices
from coneflat.apps.studio.paint import Paint, Region
from coneflat.apps.studio.project import read_project
from coneflat.apps.studio.session import Session
from coneflat.errors import OptionError, StudioError


def region(vertices):
    return Region.of_vertices(sorted(vertices))


@pytest.fixture
def session(tmp_path):
    shapes.write_obj(tmp_path / "ball.obj", *shapes.sphere(3))
    opened = Session(tmp_path)
    opened.open(tmp_path / "ball.obj")
    assert opened.wait_until_idle(120)
    yield opened
    opened.close()


def settled(session):
    assert session.wait_until_idle(120)
    state = session.state()
    assert state["trouble"] is None
    return state


def replayed(session, tmp_path):
    """Return what the session saves, and what the command makes of its project."""
    saved = np.load(BytesIO(session.export(".npz")), allow_pickle=False)["uv"]
    out = tmp_path / "again.npz"
    done = CliRunner().invoke(cli, ["flatten", "--project", str(session.project_file), "-o", str(out)])
    assert done.exit_code == 0, done.output
    return saved, coneflat.read_flattening(out)


class TestRegion:
    def test_regions_combine_like_sets(self):
        rng = random.Random(0)
        for _ in range(60):
            first, second = (
                {v for v in range(40) if rng.random() < share} for share in (rng.random(), rng.random())
            )
            a, b = region(first), region(second)
            assert a.joined(b) == region(first | second)
            assert a.without(b) == region(first - second)
            assert a.vertices() == sorted(first)
            assert Region.of_text(a.text) == a

    def test_the_text_of_a_region_lists_ranges(self):
        assert Region.of_text("7 3-5 6 9-9").text == "3-7 9"
        assert region(range(100_000)).text == "0-99999"

    @pytest.mark.parametrize("text", ["5-3", "a", "-1", "1--2", "1.5", "3,4", 7, None])
    def test_invalid_texts_of_regions_are_refused(self, text):
        with pytest.raises(StudioError, match="a region must be a text such as 3-17 20"):
            Region.of_text(text)

    def test_too_large_a_region_is_not_counted_out(self):
        with pytest.raises(StudioError, match="are above the limit of 20,000,000"):
            Region.of_text("0-999999999999")


class TestPaint:
    def test_the_last_stroke_counts(self):
        paint = (
            Paint()
            .with_stroke("importance", region(range(10)), 10)
            .with_stroke("importance", region([3, 4]), 100)
        )
        assert paint.weights() == {**dict.fromkeys([0, 1, 2, 5, 6, 7, 8, 9], 10.0), 3: 100.0, 4: 100.0}
        assert paint.with_stroke("importance", region(range(10)), 1) == Paint()
        paint = paint.with_stroke("no_cone", region([1, 2]), None).with_stroke(
            "no_seam", region([2, 3]), None
        )
        bare = paint.with_stroke("erase", region([2]), None)
        assert (bare.no_cone, bare.no_seam) == (region([1]), region([3]))
        assert 2 not in bare.weights()

    @pytest.mark.parametrize(
        ("layer", "weight", "message"),
        [
            ("glue", None, "unknown layer 'glue'"),
            ("importance", 0, "an importance must be above 0"),
            ("importance", "much", "an importance must be a number, got 'much'"),
            ("importance", 1e9, "at most 1,000,000"),
            ("importance", None, "an importance must be a number"),
        ],
    )
    def test_invalid_strokes_are_refused(self, layer, weight, message):
        with pytest.raises((StudioError, OptionError), match=message):
            Paint().with_stroke(layer, region([1]), weight)

    def test_paint_becomes_options_of_flatten(self):
        chosen = Choices().painted("no_cone", region([1, 2])).painted("no_seam", region([5, 6]))
        chosen = chosen.painted("importance", region([8]), 10)
        words = chosen.keywords()
        assert words.pop("no_seams").tolist() == [5, 6]
        assert words == {"forbidden_cones": [1, 2], "weights": {8: 10.0}}
        assert chosen.with_uncut((7, 8)).keywords()["no_seams"].tolist() == [5, 6, 7, 8]
        # Cones that were put somewhere by hand are there on purpose.
        by_hand = chosen.placed([1, 9])
        assert "forbidden_cones" not in by_hand.keywords()
        assert by_hand.with_angle(9, 1.0).keywords()["weights"] == {8: 10.0}
        assert "weights" not in by_hand.with_angle(9, 1.0).with_angle(1, 1.0).keywords()


@pytest.mark.slow
class TestStories:
    def test_painted_places_are_heeded_and_replayed(self, session, tmp_path):
        result = coneflat.flatten(*shapes.sphere(3))
        top = result.cones[np.argmax(result.vertices[result.cones, 2])]
        is_painted = np.linalg.norm(result.vertices - result.vertices[top], axis=1) < 0.5
        assert is_painted[session.state()["found"]].any()
        session.act({"do": "paint", "layer": "no_cone", "where": region(np.flatnonzero(is_painted)).text})
        state = settled(session)
        assert not is_painted[state["found"]].any()
        low = result.vertices[:, 2] < -0.6
        session.act({"do": "paint", "layer": "no_seam", "where": region(np.flatnonzero(low)).text})
        session.act({"do": "paint", "layer": "importance", "where": "0-40", "weight": 100})
        assert settled(session)["layout"] > state["layout"]
        saved, again = replayed(session, tmp_path)
        np.testing.assert_array_equal(again.uv, saved)
        assert not low[again.seams].all(axis=1).any()
        # Undone stroke by stroke, and kept at every step.
        for left in (2, 1, 0):
            session.act({"do": "undo"})
            assert len(read_project(session.project_file).choices.as_plain().get("paint", {})) == left
        assert settled(session)["found"] == result.cones.tolist()
        session.act({"do": "redo"})
        session.act({"do": "paint", "layer": "erase", "where": "0-641"})
        assert settled(session)["choices"].get("paint") is None

    def test_corners_of_a_rectangle(self, tmp_path):
        vertices, faces = shapes.hill(10, 8)
        shapes.write_obj(tmp_path / "hill.obj", vertices, faces)
        session = Session(tmp_path)
        try:
            session.open(tmp_path / "hill.obj")
            settled(session)
            session.act({"do": "set", "name": "boundary", "value": "rectangle"})
            # While corners lack the boundary is free.
            assert "boundary" not in Choices.from_plain(settled(session)["choices"]).keywords()
            width = np.ptp(vertices[:, :2], axis=0)
            ends = vertices[:, :2].min(axis=0) + width * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])[:, None]
            corners = [int(np.argmin(np.linalg.norm(vertices[:, :2] - end, axis=1))) for end in ends[:, 0]]
            for vertex in corners:
                session.act({"do": "corner", "vertex": vertex})
            with pytest.raises(StudioError, match="a rectangle has 4 corners"):
                session.act({"do": "corner", "vertex": 3})
            settled(session)
            saved, again = replayed(session, tmp_path)
            np.testing.assert_array_equal(again.uv, saved)
            angles = np.zeros(len(vertices))
            corner = coneflat.geometry.corner_angles(
                coneflat.geometry.edge_lengths(again.uv @ np.eye(2, 3), again.uv_faces)
            )
            np.add.at(angles, again.faces.ravel(), corner.ravel())
            np.testing.assert_allclose(angles[corners], np.pi / 2, atol=1e-6)
            assert ["--boundary", ",".join(map(str, sorted(corners)))] == session.state()["command"].split()[
                3:5
            ]
            session.act({"do": "corner", "vertex": corners[0]})
            assert len(settled(session)["choices"]["corners"]) == 3
        finally:
            session.close()

    def test_units_are_kept_and_flatten_nothing(self, session):
        before = settled(session)
        session.act({"do": "units", "of_file": "mm", "shown": "cm"})
        state = session.state()
        assert state["busy"] is None
        assert (state["layout"], state["choices"]["units"]) == (before["layout"], ["mm", "cm"])
        assert read_project(session.project_file).choices.units == ("mm", "cm")
        session.act({"do": "undo"})
        assert session.state()["busy"] is None
        assert "units" not in session.state()["choices"]
        with pytest.raises(StudioError, match="unknown unit 'furlong'"):
            session.act({"do": "units", "of_file": "furlong", "shown": ""})
        with pytest.raises(StudioError, match="set the unit of the file"):
            session.act({"do": "units", "of_file": "", "shown": "cm"})
