"""Projects that several programs open or change, and projects of meshes that have changed."""

from __future__ import annotations

import json
import signal
import subprocess
import sys

import pytest
import shapes

from coneflat.apps.studio.lock import lock_path
from coneflat.apps.studio.project import read_project
from coneflat.apps.studio.session import Session
from coneflat.errors import ProjectError

#: A studio in another process, which prints a line when the mesh is open.
OTHER_STUDIO = """
import sys, time
from pathlib import Path
from coneflat.apps.studio.session import Session
session = Session(Path(sys.argv[1]).parent, address="http://elsewhere/?token=t")
session.open(Path(sys.argv[1]))
print("open", flush=True)
time.sleep(600)
"""


def add_cone(session, vertex):
    session.act({"do": "hand"})
    session.act({"do": "add", "vertex": vertex})


class TestLock:
    def test_a_second_studio_is_told_of_the_first(self, tmp_path, mesh):
        first, second = Session(tmp_path, address="http://here/?token=secret"), Session(tmp_path)
        try:
            first.open(mesh)
            add_cone(first, 7)
            with pytest.raises(ProjectError, match=r"open in another studio: http://here/\?token=secret"):
                second.open(mesh)
            with pytest.raises(ProjectError, match="open in another studio"):
                second.open(first.project_file)
            assert [cone.vertex for cone in read_project(first.project_file).choices.cones] == [7]
            first.close()
            second.open(mesh)
            assert [cone["vertex"] for cone in second.state()["choices"]["cones"]] == [7]
        finally:
            first.close()
            second.close()
        assert not lock_path(second.project_file).exists()

    def test_the_lock_follows_the_mesh_that_is_open(self, session, tmp_path):
        project = session.project_file
        session.open(shapes.write_obj(tmp_path / "other.obj", *shapes.sphere(1)))
        session.open(tmp_path / "other.obj")
        second = Session(tmp_path)
        try:
            with pytest.raises(ProjectError, match="is open in another studio"):
                second.open(tmp_path / "other.obj")
            second.open(project)
            # A mesh that cannot be opened changes no lock.
            (tmp_path / "bad.json").write_text("{}")
            with pytest.raises(ProjectError, match="is not a project"):
                second.open(tmp_path / "bad.json")
            with pytest.raises(ProjectError, match="is open in another studio"):
                session.open(project)
        finally:
            second.close()
        assert {path.name for path in tmp_path.glob(".*.lock")} == {".other_studio.json.lock"}

    @pytest.mark.skipif(sys.platform == "win32", reason="processes end without cleaning up on POSIX alone")
    def test_the_lock_of_a_killed_process_is_free(self, tmp_path, mesh):
        with subprocess.Popen(
            [sys.executable, "-c", OTHER_STUDIO, str(mesh)], stdout=subprocess.PIPE, text=True
        ) as process:
            session = Session(tmp_path)
            try:
                assert process.stdout.readline() == "open\n"
                with pytest.raises(ProjectError, match="http://elsewhere/"):
                    session.open(mesh)
                process.send_signal(signal.SIGKILL)
                process.wait(60)
                path = lock_path(tmp_path / "ball_studio.json")
                assert json.loads(path.read_text())["address"] == "http://elsewhere/?token=t"
                session.open(mesh)
            finally:
                process.kill()
                session.close()
        assert not path.exists()

    def test_a_file_of_a_machine_that_was_restarted_locks_nothing(self, tmp_path, mesh):
        lock_path(tmp_path / "ball_studio.json").write_text('{"address": "http://old/", "machine": "m"}')
        session = Session(tmp_path)
        try:
            session.open(mesh)
        finally:
            session.close()


class TestRevision:
    def test_a_project_that_another_program_has_changed_is_not_overwritten(self, session, tmp_path):
        add_cone(session, 7)
        file = session.project_file
        text = file.read_text().replace("7", "8")
        file.write_text(text)
        session.act({"do": "texture", "value": True})
        assert file.read_text() == text
        assert session.project_file.name == "ball_studio-2.json"
        assert [cone.vertex for cone in read_project(session.project_file).choices.cones] == [7]
        state = session.state()
        assert state["project"] == "ball_studio-2.json"
        assert "Another program has changed ball_studio.json" in state["warnings"][0]
        # The next step is saved there, too, and there is no third file.
        session.act({"do": "undo"})
        assert not read_project(session.project_file).choices.for_texture
        assert sorted(path.name for path in tmp_path.glob("*.json")) == [
            "ball_studio-2.json",
            "ball_studio.json",
        ]

    def test_a_removed_project_is_written_again(self, session):
        session.project_file.unlink()
        add_cone(session, 7)
        assert [cone.vertex for cone in read_project(session.project_file).choices.cones] == [7]
