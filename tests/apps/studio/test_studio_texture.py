"""Maps for textures in the studio: choices, replay from projects, and cancellation."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from click.testing import CliRunner

import coneflat
from coneflat.apps.cli.main import cli
from coneflat.apps.studio.child import JobRunner
from coneflat.apps.studio.choices import DECLARED, PLAIN_OPTIONS, Choices
from coneflat.apps.studio.messages import CONTROLS, command_line, python_lines, with_warnings
from coneflat.apps.studio.outputs import curve_options
from coneflat.apps.studio.paint import Region
from coneflat.apps.studio.project import Project, file_hash, read_project
from coneflat.base import cancel_with
from coneflat.errors import OptionError, StudioError
from coneflat.options import declarations
from coneflat.textures.options import MAX_ENERGY, UnwrapOptions

CONES = (3, 60, 200, 410, 500)
#: Options of `coneflat flatten` and `coneflat unwrap` that the studio does not set, by the reason.
NOT_IN_THE_STUDIO = {
    "they are placed, drawn or painted": (
        "cones",
        "required_cones",
        "forbidden_cones",
        "weights",
        "no_seams",
    ),
    "no seams are painted instead": ("seam_weights",),
    "the page opens, saves and shows": (
        "mesh",
        "output",
        "format",
        "texture",
        "uv_set",
        "report",
        "project",
        "required",
    ),
    "the studio asks before it repairs, and reports in the page": ("weld", "verbosity"),
    "they are for comparisons with the published method": ("method", "paper"),
    "the default gives the same digits on every machine": ("threads",),
    "a lightmap has blocks": ("block_size",),
}


def both_kinds():
    """Return choices with settings of both kinds of maps, for a texture."""
    chosen = Choices().placed(CONES).locked(200, True).cut((1, 2)).with_uncut((7, 8))
    for name, value in {"max_energy": 4.05, "stretch": 0.25, "boundary": "disk", "padding": 4}.items():
        chosen = chosen.with_option(name, value)
    return chosen.painted("no_cone", Region.of_text("3")).painted("importance", Region.of_text("9"), 10)


class TestChoices:
    def test_each_kind_of_map_has_its_own_options(self):
        conformal, texture = both_kinds().keywords(), both_kinds().with_texture(True).keywords()
        assert set(texture) == {"max_energy", "padding", "seams", "no_seams"}
        assert set(texture) <= set(declarations(UnwrapOptions))
        assert set(conformal) == {"cones", "stretch", "boundary", "padding", "seams", "no_seams", "weights"}
        assert both_kinds().with_texture(True).with_texture(False) == both_kinds()

    def test_the_default_bound_is_that_of_the_function(self):
        assert DECLARED["max_energy"].default == MAX_ENERGY
        assert Choices().with_option("max_energy", MAX_ENERGY) == Choices()

    def test_a_texel_density_replaces_the_resolution(self):
        chosen = Choices().with_texture(True).with_option("resolution", 2048).with_option("texel_density", 50)
        assert chosen.keywords() == {"texel_density": 50.0}
        assert chosen.with_texture(False).keywords() == {}
        assert chosen.with_option("resolution", 512).keywords() == {"resolution": 512}
        assert chosen.with_option("texel_density", None).keywords() == {}

    def test_every_option_of_the_commands_is_set_or_left_out_for_a_reason(self):
        options = {param.name for name in ("flatten", "unwrap") for param in cli.commands[name].params}
        options -= {name for names in NOT_IN_THE_STUDIO.values() for name in names}
        assert options == set(PLAIN_OPTIONS)

    def test_every_option_has_a_label(self):
        assert set(PLAIN_OPTIONS) <= set(CONTROLS)

    def test_further_options_come_back_from_a_command_line(self):
        chosen = Choices().with_texture(True)
        values = {
            "area": 0.2,
            "stack": "mirrored",
            "charts": 3,
            "seams": "none",
            "up": [0, 0, -1],
            "tiles": 2,
        }
        for name, value in values.items():
            chosen = chosen.with_option(name, value)
        assert Choices.from_plain(json.loads(json.dumps(chosen.with_option("area", None).as_plain())))
        with pytest.raises(OptionError, match="seams none and area cannot be combined"):
            chosen.keywords()
        chosen = chosen.with_option("seams", None)
        line = command_line("ball.obj", "project.json", chosen)
        expected = "--area 0.2 --stack mirrored --charts 3 --up 0.0,0.0,-1.0 --tiles 2"
        assert line == f"coneflat unwrap ball.obj {expected}"
        assert cli.commands["unwrap"].make_context("unwrap", line.split()[2:]).params["up"] == (0, 0, -1)
        assert chosen.with_texture(False).keywords() == {"up": (0, 0, -1), "tiles": 2}
        assert chosen.with_option("max_energy", 4.2).keywords()["max_energy"] == 4.2

    def test_drawn_seams_may_be_all(self):
        chosen = Choices().with_texture(True).cut((1, 2)).with_option("seams", "none")
        word, pairs = chosen.keywords()["seams"]
        assert (word, pairs.tolist()) == ("none", [[1, 2]])
        assert chosen.with_texture(False).keywords()["seams"].tolist() == [[1, 2]]

    def test_cones_placed_by_hand_have_no_search(self):
        chosen = Choices().with_option("max_cones", 8).with_option("quantise", math.pi / 2).placed([3, 60])
        assert set(chosen.keywords()) == {"cones"}

    @pytest.mark.parametrize("value", [4, 3.9, -1, "much", math.nan])
    def test_a_bound_that_cannot_be_met_is_refused(self, value):
        with pytest.raises(OptionError, match="max_energy must be"):
            Choices().with_texture(True).with_option("max_energy", value).keywords()

    @pytest.mark.parametrize(
        "change",
        [
            lambda chosen: chosen.placed([7]),
            lambda chosen: chosen.added(7),
            lambda chosen: chosen.locked(7, True),
        ],
    )
    def test_maps_for_textures_have_no_cones_to_edit(self, change):
        with pytest.raises(StudioError, match="a map for a texture has no cones to edit"):
            change(Choices().with_texture(True))

    def test_a_number_of_cones_belongs_to_a_conformal_map(self):
        assert not Choices().with_texture(True).with_option("cone_count", 8).for_texture
        assert set(curve_options(both_kinds().with_texture(True))) == set(curve_options(both_kinds()))

    def test_choices_are_read_back_from_json(self):
        chosen = both_kinds().with_texture(True)
        assert Choices.from_plain(json.loads(json.dumps(chosen.as_plain()))) == chosen
        assert "for_texture" not in both_kinds().as_plain()

    def test_warnings_on_cones_are_those_of_conformal_maps(self, mesh):
        narrow = both_kinds().with_angle(60, 0.8 * math.pi)
        result = coneflat.flatten(mesh, cones={3: 1.6 * math.pi, 60: 1.2 * math.pi, 410: 1.2 * math.pi})
        assert len(with_warnings(result, narrow).notes) == len(result.notes) + 2
        assert with_warnings(result, narrow.with_texture(True)).notes == result.notes


class TestReplay:
    def test_the_command_line_means_what_is_chosen(self, tmp_path, mesh, monkeypatch):
        monkeypatch.chdir(tmp_path)
        chosen = Choices().with_texture(True).with_option("max_energy", 4.3).with_option("stretch", 1)
        line = command_line("ball.obj", "p.json", chosen)
        assert line == "coneflat unwrap ball.obj --max-energy 4.3"
        assert CliRunner().invoke(cli, [*line.split()[1:], "-o", "a.npz"]).exit_code == 0
        names: dict = {}
        exec(python_lines("ball.obj", chosen), names)
        np.testing.assert_array_equal(coneflat.read_flattening(tmp_path / "a.npz").uv, names["result"].uv)

    def test_drawn_paths_are_in_the_project(self):
        chosen = Choices().with_texture(True).cut((1, 2))
        assert command_line("b.obj", "p.json", chosen) == "coneflat unwrap --project p.json"

    @pytest.mark.slow
    @pytest.mark.parametrize("for_texture", [False, True])
    def test_a_project_has_both_maps(self, tmp_path, mesh, for_texture):
        chosen = Choices().with_option("max_energy", 4.3).with_option("distortion", 0.3)
        path = tmp_path / "p.json"
        Project(mesh, file_hash(mesh), chosen.with_texture(for_texture)).save(path)
        expected = {
            "flatten": coneflat.flatten(mesh, distortion=0.3),
            "unwrap": coneflat.unwrap(mesh, max_energy=4.3),
        }
        for command, result in expected.items():
            output = tmp_path / f"{command}.npz"
            done = CliRunner().invoke(cli, [command, "--project", str(path), "-o", str(output)])
            assert done.exit_code == 0, done.output
            np.testing.assert_array_equal(coneflat.read_flattening(output).uv, result.uv)

    def test_a_project_has_its_own_options(self, tmp_path, mesh):
        path = tmp_path / "p.json"
        Project(mesh, file_hash(mesh), Choices()).save(path)
        for words, conflict in {
            "--max-energy 4.2": "--max-energy",
            "x.obj": "MESH",
            "--weld": "--weld",
        }.items():
            done = CliRunner().invoke(cli, ["unwrap", "--project", str(path), *words.split()])
            assert done.exit_code == 2
            assert f"leave out {conflict}" in done.output
        done = CliRunner().invoke(cli, ["unwrap"])
        assert done.exit_code == 2
        assert "Missing argument 'MESH'" in done.output


class TestSession:
    @pytest.mark.slow
    def test_the_kind_of_map_is_a_step(self, session, mesh):
        assert session.wait_until_idle(120)
        first = session.picture()[0]["title"]
        session.act({"do": "texture", "value": True})
        session.act({"do": "set", "name": "max_energy", "value": 4.3})
        assert session.wait_until_idle(120)
        assert session.state()["trouble"] is None
        (tmp_npz := mesh.with_suffix(".npz")).write_bytes(session.export(".npz"))
        exported = coneflat.read_flattening(tmp_npz)
        np.testing.assert_array_equal(exported.uv, coneflat.unwrap(mesh, max_energy=4.3).uv)
        assert read_project(session.project_file).choices.for_texture
        for _ in range(2):
            session.act({"do": "undo"})
        assert session.wait_until_idle(120)
        assert session.picture()[0]["title"] == first
        assert not read_project(session.project_file).choices.for_texture

    @pytest.mark.slow
    def test_actions_that_need_cones_and_invalid_values_are_refused(self, session):
        session.act({"do": "texture", "value": True})
        with pytest.raises(StudioError, match="has no cones to edit"):
            session.act({"do": "add", "vertex": 5})
        with pytest.raises(OptionError, match="max_energy must be above 4"):
            session.act({"do": "set", "name": "max_energy", "value": 4})
        with pytest.raises(StudioError, match="is not valid"):
            session.act({"do": "texture"})
        assert session.wait_until_idle(120)
        assert session.state()["trouble"] is None

    def test_a_change_cancels_the_search(self, mesh):
        class Changed(Exception):
            pass

        calls = 0

        def check():
            nonlocal calls
            calls += 1
            if calls == 15:
                raise Changed

        job = {"mesh": str(mesh), "sha256": "", "choices": Choices().with_texture(True).as_plain()}
        with pytest.raises(Changed), cancel_with(check):
            JobRunner().flatten(job, lambda stage, fraction: None, lambda head, body: None)
        assert calls == 15
