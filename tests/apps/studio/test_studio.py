"""The studio without its page: what is chosen, undone and kept."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

import coneflat
from coneflat.apps.cli.main import cli
from coneflat.apps.studio.choices import Choices, Cone
from coneflat.apps.studio.messages import command_line, python_lines
from coneflat.apps.studio.project import Project, file_hash, read_project
from coneflat.apps.studio.steps import History
from coneflat.errors import OptionError, ProjectError, StudioError

CONES = (3, 60, 200, 410, 500)


def some_choices():
    chosen = Choices().placed(CONES).with_angle(60, math.radians(270)).locked(200, True)
    return chosen.with_option("stretch", 0.25).cut((1, 2, 9)).with_uncut((7, 8))


class TestChoices:
    def test_editing_a_searched_cone_places_all_cones_by_hand(self):
        chosen = Choices().placed([9, 4]).added(7).moved(4, 5).removed(9)
        assert chosen.by_hand
        assert chosen.cones == (Cone(5), Cone(7))
        assert chosen.keywords() == {"cones": {5: None, 7: None}}

    def test_the_curvature_of_a_cone_is_a_full_turn_minus_its_angle(self):
        chosen = Choices().placed([4, 9]).with_angle(9, math.radians(270))
        assert chosen.keywords() == {"cones": {4: None, 9: pytest.approx(math.pi / 2)}}
        assert chosen.with_angle(9, None).keywords() == {"cones": {4: None, 9: None}}

    def test_a_search_keeps_locked_cones(self):
        chosen = Choices().placed([4, 9, 12]).locked(9, True).with_option("cone_count", 8)
        assert chosen.keywords() == {"cone_count": 8, "required_cones": [9]}
        # One of the two numbers is asked for.
        assert chosen.with_option("distortion", 0.1).keywords() == {"distortion": 0.1, "required_cones": [9]}
        assert chosen.locked(9, False).cones == ()

    def test_edges_of_paths_are_pairs(self):
        words = Choices().cut((4, 2, 9)).cut((2, 4)).with_uncut((7, 8)).keywords()
        assert words["seams"].tolist() == [[2, 4], [2, 9]]
        assert words["no_seams"].tolist() == [[7, 8]]

    def test_a_path_is_erased_by_any_of_its_edges(self):
        chosen = Choices().cut((4, 2, 9)).with_uncut((7, 8))
        assert chosen.erased(9, 2).cuts == ()
        assert chosen.erased(8, 7).uncut == ()
        with pytest.raises(StudioError, match="no path contains the edge 4-9"):
            chosen.erased(4, 9)

    @pytest.mark.parametrize(
        ("change", "kind", "message"),
        [
            (lambda c: c.added(4), StudioError, "vertex 4 is a cone already"),
            (lambda c: c.moved(4, 9), StudioError, "vertex 9 is a cone already"),
            (lambda c: c.moved(5, 6), StudioError, "vertex 5 is not a cone"),
            (lambda c: c.removed(5), StudioError, "vertex 5 is not a cone"),
            (lambda c: c.locked(5, True), StudioError, "vertex 5 is not a cone"),
            (
                lambda c: c.with_angle(4, -1.0),
                StudioError,
                "positive and at most 720 degrees, got -57.2",
            ),
            (lambda c: c.cut((4,)), StudioError, "a path must be two or more vertices"),
            (lambda c: c.cut((4, 4)), StudioError, "a path must be two or more vertices"),
            (lambda c: c.with_option("progress", print), OptionError, "unknown option 'progress'"),
            (lambda c: c.with_option("stretch", 2), OptionError, "stretch must be a number from 0 to 1"),
            (lambda c: c.with_option("boundary", [3]), OptionError, "unknown boundary"),
        ],
    )
    def test_invalid_choices_are_refused(self, change, kind, message):
        with pytest.raises(kind, match=message):
            change(Choices().placed([4, 9]))


class TestHistory:
    def test_undo_and_redo(self):
        steps = [Choices().with_option("stretch", k / 2000) for k in range(1000)]
        history = History(steps[0])
        for step in steps[1:]:
            assert history.change(step)
        for step in reversed(steps[:-1]):
            assert history.undo()
            assert history.now == step
        assert not history.undo()
        assert history.depth == (0, 999)
        for step in steps[1:]:
            assert history.redo()
            assert history.now == step
        assert not history.redo()

    def test_a_stroke_is_one_step(self):
        history, start = History(Choices()), Choices()
        for k in range(5):
            history.change(start.with_option("stretch", k / 10 + 0.1), "drag")
        history.change(start.with_option("stretch", 0.9), "another drag")
        assert history.depth == (2, 0)
        history.undo()
        assert history.now.options["stretch"] == 0.5
        history.undo()
        assert history.now == start


class TestProject:
    def test_a_saved_project_is_read_back(self, tmp_path, mesh):
        (tmp_path / "sub").mkdir()
        project = Project(tmp_path / "ball.obj", file_hash(tmp_path / "ball.obj"), some_choices())
        project.save(tmp_path / "sub" / "p.json")
        assert json.loads((tmp_path / "sub" / "p.json").read_text())["mesh"]["path"] == "../ball.obj"
        read_back = read_project(tmp_path / "sub" / "p.json")
        assert read_back == replace(project, mesh=read_back.mesh)
        assert read_back.mesh.resolve() == project.mesh.resolve()
        read_back.check_mesh()

    def test_another_mesh_is_noticed(self, tmp_path, mesh):
        project = Project(tmp_path / "ball.obj", file_hash(tmp_path / "ball.obj"), Choices())
        (tmp_path / "ball.obj").write_text("v 0 0 0\n")
        with pytest.raises(ProjectError, match="is not the mesh that the project was made with"):
            project.check_mesh()
        (tmp_path / "ball.obj").unlink()
        with pytest.raises(ProjectError, match="the project's mesh is missing"):
            project.check_mesh()

    @pytest.mark.parametrize(
        ("change", "message"),
        [
            (lambda p: "{", "it is not JSON"),
            (lambda p: "[" * 100_000, "it is not JSON"),
            (lambda p: "[]", "is not a project of coneflat"),
            (lambda p: {**p, "version": 2}, "a project of version 2; this coneflat reads version 1"),
            (lambda p: {**p, "mesh": None}, "missing or not valid"),
            (lambda p: {**p, "choices": {}}, "missing or not valid"),
            (lambda p: {**p, "choices": {**p["choices"], "options": {"stretch": 3}}}, "from 0 to 1"),
            (
                lambda p: {**p, "choices": {**p["choices"], "options": {"colour": "red"}}},
                "unknown option 'colour'",
            ),
            (
                lambda p: {**p, "choices": {**p["choices"], "cuts": [[1]]}},
                "a path must be two or more vertices",
            ),
            (lambda p: {**p, "choices": {**p["choices"], "cones": [{"vertex": "x"}]}}, "a number"),
        ],
    )
    def test_invalid_projects_are_refused_with_the_reason(self, tmp_path, mesh, change, message):
        path = tmp_path / "p.json"
        Project(tmp_path / "ball.obj", "0" * 64, Choices()).save(path)
        content = change(json.loads(path.read_text()))
        path.write_text(content if isinstance(content, str) else json.dumps(content))
        with pytest.raises(ProjectError, match=message):
            read_project(path)


class TestReplay:
    def test_the_command_line_means_what_is_chosen(self, tmp_path, mesh, monkeypatch):
        monkeypatch.chdir(tmp_path)
        chosen = Choices().placed(CONES).with_angle(60, math.radians(270)).with_option("charts", "one")
        words = command_line("ball.obj", "p.json", chosen).split()[1:]
        assert CliRunner().invoke(cli, [*words, "-o", "a.npz"]).exit_code == 0
        names: dict = {}
        exec(python_lines("ball.obj", chosen), names)
        by_command, by_python = coneflat.read_flattening(tmp_path / "a.npz"), names["result"]
        np.testing.assert_array_equal(by_command.uv, by_python.uv)
        assert dict(zip(by_command.cones.tolist(), by_command.curvatures, strict=True))[60] == pytest.approx(
            math.pi / 2
        )

    def test_drawn_paths_are_in_the_project(self):
        assert command_line("b.obj", "b p.json", Choices().cut((1, 2))) == (
            "coneflat flatten --project 'b p.json'"
        )
        assert "seams=[[1, 2]]" in python_lines("b.obj", Choices().cut((1, 2)))

    def test_a_project_has_its_own_options(self, tmp_path, mesh):
        path = tmp_path / "p.json"
        Project(tmp_path / "ball.obj", file_hash(tmp_path / "ball.obj"), Choices()).save(path)
        conflicts = {
            "--stretch 1": "--stretch",
            "x.obj": "MESH",
            "--paper": "--paper",
            "--strict": "--repair",
        }
        for words, conflict in conflicts.items():
            done = CliRunner().invoke(cli, ["flatten", "--project", str(path), *words.split()])
            assert done.exit_code == 2
            assert f"leave out {conflict}" in done.output
