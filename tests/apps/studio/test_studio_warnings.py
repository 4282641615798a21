"""What the studio says of cones set by hand, and in which words."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

import coneflat
from coneflat.apps.studio.choices import DECLARED, Choices
from coneflat.apps.studio.messages import CONTROLS, misplaced_warning, notes_on_controls, page_message
from coneflat.apps.studio.page import studio_page
from coneflat.apps.studio.paint import Region
from coneflat.base.defaults import MAX_CONE_ANGLE
from coneflat.errors import OptionError, StudioError
from coneflat.options import read_options
from coneflat.textures.options import UnwrapOptions

SOURCES = Path(coneflat.__file__).parent


def settled(session):
    assert session.wait_until_idle(60)
    return session.state()


class TestPlaces:
    def test_misplaced_cones_are_counted_in_the_warning(self):
        painted = Choices().painted("no_cone", Region("3-9 20"))
        assert misplaced_warning(painted) == ()
        assert misplaced_warning(painted.added(10)) == ()
        (warning,) = misplaced_warning(painted.added(9))
        assert warning.startswith(
            "1 cone set by hand or locked lies in regions painted as “No cones”: vertex 9."
        )
        (two,) = misplaced_warning(painted.added(20).added(10).added(3))
        assert "2 cones set by hand or locked lie in regions painted as “No cones”: vertices 3, 20." in two

    @pytest.mark.slow
    def test_misplaced_cones_are_warned_of_at_once_and_noted(self, session):
        cones = settled(session)["found"]
        session.act({"do": "paint", "layer": "no_cone", "where": f"{cones[0]}"})
        state = settled(session)
        assert cones[0] not in state["found"]
        assert state["warnings"] == []
        session.act({"do": "add", "vertex": cones[0]})
        assert f"vertex {cones[0]}." in session.state()["warnings"][0]
        state = settled(session)
        assert cones[0] in state["found"]
        head, _ = session.picture()
        assert state["warnings"][0] in head["notes"]
        session.act({"do": "remove", "vertex": cones[0]})
        assert session.state()["warnings"] == []


class TestAngles:
    def test_typed_angles_are_positive_and_at_most_the_largest_of_a_search(self):
        chosen = Choices().placed([4, 9]).with_angle(9, math.radians(720))
        assert chosen.cones[1].angle == MAX_CONE_ANGLE
        for angle in (0.0, math.radians(721), math.radians(3000), math.inf, math.nan):
            with pytest.raises(StudioError, match="positive and at most 720 degrees, got"):
                chosen.with_angle(4, angle)
            with pytest.raises(StudioError, match="positive and at most 720 degrees, got"):
                chosen.added(5, angle)
        plain = chosen.as_plain()
        plain["cones"][1]["angle"] = math.radians(3000)
        with pytest.raises(StudioError, match="got 3,000"):
            Choices.from_plain(plain)

    @pytest.mark.slow
    def test_typed_angles_that_force_others_out_of_bounds_give_a_warning(self, session):
        """Of a ball's 720 degrees, three cones of 220 take 420; what is left leaves one more an angle below 90."""
        settled(session)
        session.act({"do": "set", "name": "cone_count", "value": 4})
        narrow, *remaining = settled(session)["found"]
        for vertex in remaining:
            session.act({"do": "angle", "vertex": vertex, "degrees": 150})
        state = settled(session)
        # 720 - 3 * 210 = 90 is its curvature, 270 its angle.
        assert (state["trouble"], state["warnings"]) == (None, [])
        for vertex in remaining:
            session.act({"do": "angle", "vertex": vertex, "degrees": 220})
        state = settled(session)
        # 720 - 3 * 140 = 300.
        (warning,) = state["warnings"]
        assert warning.startswith(
            f"With the typed angles, 1 cone cannot have an angle from 90 to 720 degrees: vertex {narrow} 60."
        )
        assert state["trouble"] is None


class TestWords:
    def test_controls_are_those_of_the_page(self):
        page = studio_page(()).replace("\\u00b0", "°")
        for name, control in CONTROLS.items():
            assert name in DECLARED
            assert control in page

    @pytest.mark.parametrize(
        ("message", "said"),
        [
            ("other cones (--distortion, --cone-count)", "other cones (“Distortion”, “Number”)"),
            ("remesh them, or run with --repair", "remesh them, or run with “Repair the mesh”"),
            ("cone_count must be an integer", "“Number” must be an integer"),
            ("padding must be 0 and up", "“Texels between charts” must be 0 and up"),
            ("the padding must be 0", "the padding must be 0"),
            ("boundary 'straight' needs the search", "“Boundary” 'straight' needs the search"),
            ("the greedy search (--cones greedy)", "the greedy search (--cones greedy of coneflat flatten)"),
        ],
    )
    def test_options_are_named_as_the_page_has_them(self, message, said):
        assert page_message(message) == said

    @pytest.mark.parametrize(
        ("options", "excluded"),
        [
            ({"resolution": 512}, {"texel_density": 2.0}),
            ({"max_energy": 4.3}, {"area": 0.1}),
            ({"seams": "none"}, {"max_energy": 4.3}),
            ({"seams": "none"}, {"area": 0.1}),
        ],
    )
    def test_options_that_exclude_each_other_are_named_as_the_page_has_them(self, options, excluded):
        with pytest.raises(OptionError) as caught:
            read_options({**options, **excluded}, UnwrapOptions)
        said = page_message(str(caught.value))
        assert said.endswith(" cannot be combined: leave out one of them")
        for name in (*options, *excluded):
            assert f"“{CONTROLS[name]}”" in said
            assert name not in said.split()

    def test_no_flag_that_has_a_control_is_left(self):
        """In none of the messages of the package."""
        flags = set()
        for source in SOURCES.rglob("*.py"):
            if "apps" not in source.relative_to(SOURCES).parts:
                flags |= set(re.findall(r"--[a-z][a-z-]+", source.read_text()))
        assert {"--repair", "--distortion"} <= flags
        for flag in flags:
            name = flag[2:].replace("-", "_")
            assert page_message(f"try {flag}.") == (
                f"try “{CONTROLS[name]}”." if name in CONTROLS else f"try {flag} of coneflat flatten."
            )


def test_notes_on_numbers_are_found_by_their_option():
    count = (
        "200 cones instead of the 500 asked for: searches place 200 at most, in addition to required ones."
    )
    charts = "The texture has 1 chart instead of 2: no further cut divides one."
    assert notes_on_controls(["Another note.", count, charts]) == {"cone_count": count, "charts": charts}
