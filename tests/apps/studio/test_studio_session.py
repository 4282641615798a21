"""The studio's session, without a page: what is flattened, saved, told; and the command."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import time
from io import BytesIO
from pathlib import Path

import numpy as np
import psutil
import pytest
import shapes
from click.testing import CliRunner
from command import INTERRUPTIBLE

import coneflat
from coneflat.apps.cli.main import cli
from coneflat.apps.studio.choices import Choices
from coneflat.apps.studio.project import Project, file_hash, read_project
from coneflat.apps.studio.session import Session
from coneflat.apps.studio.worker import COMMAND, read_frame, write_frame
from coneflat.errors import OptionError, ProjectError, StudioError


def worker_process():
    """The id of the worker process."""
    (worker,) = (child for child in psutil.Process().children() if COMMAND[-1] in child.cmdline())
    return worker.pid


def settled(session):
    assert session.wait_until_idle(120)
    return session.state()


def uv_of(content):
    return np.load(BytesIO(content), allow_pickle=False)["uv"]


class TestSession:
    @pytest.mark.slow
    def test_the_layout_follows_the_choices(self, session):
        state = settled(session)
        assert state["trouble"] is None
        assert state["layout"] == 2  # The model alone was the first.
        cones = state["found"]
        session.act({"do": "angle", "vertex": cones[0], "degrees": 200})
        session.act({"do": "lock", "vertex": cones[1], "locked": True})
        state = settled(session)
        assert state["trouble"] is None
        assert sorted(state["found"]) == sorted(cones)
        head, _ = session.picture()
        angles = dict(zip(state["found"], head["cone_curvatures"], strict=True))
        assert 360 - math.degrees(angles[cones[0]]) == pytest.approx(200)
        session.act({"do": "set", "name": "cone_count", "value": len(cones) + 1})
        state = settled(session)
        assert cones[1] in state["found"]
        assert len(state["found"]) == len(cones) + 1

    @pytest.mark.slow
    def test_what_is_saved_is_what_the_command_makes(self, session, tmp_path):
        cones = settled(session)["found"]
        session.act({"do": "remove", "vertex": cones[0]})
        session.act({"do": "angle", "vertex": cones[1], "degrees": 120})
        graph = coneflat.TriangleMesh(*shapes.sphere(3)).edges
        apart = [edge for edge in graph.tolist() if not set(edge) & set(cones)][:1]
        session.act({"do": "keep", "path": apart[0]})
        saved = uv_of(session.export(".npz"))
        assert settled(session)["trouble"] is None
        done = CliRunner().invoke(
            cli, ["flatten", "--project", str(session.project_file), "-o", str(tmp_path / "again.npz")]
        )
        assert done.exit_code == 0, done.output
        np.testing.assert_array_equal(coneflat.read_flattening(tmp_path / "again.npz").uv, saved)

    @pytest.mark.slow
    def test_every_mesh_format_can_be_exported(self, session):
        begins = {".obj": b"v ", ".ply": b"ply", ".glb": b"glTF", ".npz": b"PK", ".svg": b"<svg"}
        for ending, begin in begins.items():
            assert session.export(ending).startswith(begin), ending

    @pytest.mark.slow
    def test_newer_changes_end_older_work(self, session):
        for step in range(1, 8):
            session.act({"do": "set", "name": "stretch", "value": step / 10})
        state = settled(session)
        # The first may have been flattened before the others came; what is between is given up.
        assert state["layout"] < 5
        assert state["choices"]["options"] == {"stretch": 0.7}
        assert coneflat.flatten(*shapes.sphere(3), stretch=0.7).uv == pytest.approx(
            uv_of(session.export(".npz"))
        )

    @pytest.mark.slow
    def test_a_failure_is_told_and_undone(self, session):
        cones = settled(session)["found"]
        for vertex in cones:
            session.act({"do": "angle", "vertex": vertex, "degrees": 350})
        state = settled(session)
        assert "must sum to 2 pi chi" in state["trouble"]["text"]
        assert state["layout"] >= 1  # which is still shown
        with pytest.raises(StudioError, match="the last change could not be flattened"):
            session.export(".obj")
        for _ in cones:
            session.act({"do": "undo"})
        assert settled(session)["trouble"] is None

    def test_senseless_actions_are_refused(self, session):
        before = session.state()["choices"]
        for action in (
            {}, {"do": "explode"}, {"do": ["add"]}, {"do": "add"}, {"do": "add", "vertex": "x"},
            {"do": "add", "vertex": 1.5}, {"do": "cut", "path": 3}, {"do": "cut", "path": ["a", "b"]},
            {"do": "erase", "edge": [1]}, {"do": "set", "name": "progress", "value": 1},
            {"do": "set", "name": "distortion", "value": "much"}, {"do": "angle", "vertex": 3, "degrees": "nan"},
            {"do": "add", "vertex": -1}, {"do": "corner", "vertex": -1}, {"do": "cut", "path": [0, -1]},
            {"do": "lock", "vertex": -1, "locked": True},
        ):  # fmt: skip
            with pytest.raises((StudioError, OptionError)):
                session.act(action)
            assert session.state()["choices"] == before

    @pytest.mark.slow
    def test_a_killed_process_is_told_of_and_started_again(self, session):
        settled(session)
        first = worker_process()
        session.act({"do": "set", "name": "stretch", "value": 0.5})
        os.kill(first, signal.SIGKILL)
        trouble = settled(session)["trouble"]
        assert "was ended by SIGKILL" in trouble["text"]
        assert "no choices are lost" in trouble["text"]
        session.act({"do": "again"})
        state = settled(session)
        assert state["trouble"] is None
        assert state["choices"]["options"] == {"stretch": 0.5}
        assert worker_process() != first

    def test_choices_are_stored_immediately(self, session, tmp_path):
        session.act({"do": "set", "name": "stretch", "value": 0.5})
        expected = session.state()["choices"]
        session.close()  # It writes nothing.
        again = Session(tmp_path)
        try:
            again.open(tmp_path / "ball.obj")
            assert again.state()["choices"] == expected
            again.open(session.project_file)
            assert again.state()["choices"] == expected
        finally:
            again.close()

    def test_links_lead_nowhere_else(self, session, tmp_path_factory, tmp_path):
        elsewhere = tmp_path_factory.mktemp("other")
        shapes.write_obj(elsewhere / "secret.obj", *shapes.sphere(1))
        (tmp_path / "link.obj").symlink_to(elsewhere / "secret.obj")
        with pytest.raises(StudioError, match="is outside the folder of the session"):
            session.open_named("link.obj")

    def test_a_dropped_project_names_no_mesh_elsewhere(self, session, tmp_path_factory, tmp_path):
        elsewhere = tmp_path_factory.mktemp("other")
        shapes.write_obj(elsewhere / "secret.obj", *shapes.sphere(1))
        Project(elsewhere / "secret.obj", file_hash(elsewhere / "secret.obj"), Choices()).save(
            tmp_path / "p.json"
        )
        with pytest.raises(ProjectError, match="is outside the folder of the session"):
            session.open_named("p.json")


def test_frames_come_whole_or_not_at_all():
    stream = BytesIO()
    write_frame(stream, {"a": 1}, b"body")
    write_frame(stream, {"b": "ä"})
    frame = stream.getvalue()
    stream.seek(0)
    assert read_frame(stream) == ({"a": 1}, b"body")
    assert read_frame(stream) == ({"b": "ä"}, b"")
    assert read_frame(stream) is None
    assert read_frame(BytesIO(frame[:19])) is None


@pytest.mark.slow
def test_the_command_prints_its_address_first_and_lives_on_this_machine(tmp_path, mesh):
    pytest.importorskip("uvicorn")
    httpx = pytest.importorskip("httpx2")
    command = [sys.executable, "-m", "coneflat", "studio", "ball.obj", "--no-open"]
    with subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, text=True, **INTERRUPTIBLE
    ) as process:
        try:
            address = process.stdout.readline().strip()
            base, token = address.split("/?token=")
            assert base.startswith("http://127.0.0.1:")
            assert len(token) >= 32
            assert "<title>coneflat</title>" in httpx.get(address).text
            assert httpx.get(f"{base}/").status_code == 403
            end = time.monotonic() + 120
            state = {"version": 0, "layout": 0}
            while state["layout"] < 2 and time.monotonic() < end:
                asked = f"{base}/state?after={state['version']}"
                state = httpx.get(asked, headers={"x-coneflat-token": token}, timeout=60).json()
            assert state["layout"] == 2
        finally:
            process.send_signal(signal.SIGINT)
            ending = process.stdout.read()
            code = process.wait(30)
    assert ending == f"Studio ended. Choices are in {tmp_path.resolve() / 'ball_studio.json'}.\n"
    assert code == 0
    assert read_project(Path(tmp_path) / "ball_studio.json").choices == Choices()
