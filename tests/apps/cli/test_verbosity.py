"""What the commands say of their work: all in the same way."""

from __future__ import annotations

import re

import pytest
import shapes
from click.testing import CliRunner

from coneflat.apps.cli.main import cli
from coneflat.apps.cli.run import Console, time_left

COMMANDS = {
    "flatten": ("flatten", "model.obj", "-o", "out.obj"),
    "view": ("view", "model.obj", "-o", "out.html"),
    "figure": ("figure", "model.obj", "-o", "out.png", "--dpi", "50"),
    "curve figure": ("figure", "model.obj", "--kind", "curve", "--most", "6", "-o", "out.png", "--dpi", "50"),
    "cones": ("cones", "model.obj", "-o", "out.txt"),
    "curve": ("cones", "model.obj", "--curve", "--most", "6", "--picture", "out.png"),
    "batch": ("batch", "model.obj", "--out", "out", "--jobs", "1"),
}
QUICK = ("view", "figure", "curve figure", "cones", "curve")
LINE = r" +\d+\.\d s +(\d+)%  \w+.*"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    shapes.write_obj(tmp_path / "model.obj", *shapes.sphere(2))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(words):
    done = CliRunner().invoke(cli, words, catch_exceptions=False)
    assert done.exit_code == 0, done.stderr
    return done


def needed(name):
    if "figure" in name or name in ("curve", "demo"):
        pytest.importorskip("matplotlib")


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_verbose_tells_each_step_and_where_the_time_went(folder, name):
    needed(name)
    done = run((*COMMANDS[name], "-v"))
    told = [re.fullmatch(LINE, line) for line in done.stderr.splitlines()]
    assert len(told) > (0 if name == "batch" else 2)
    assert all(told)
    percents = [int(match[1]) for match in told]
    assert percents == sorted(percents)
    assert re.search(r"^time +\d+\.\d+ s", done.stdout, re.MULTILINE)
    assert "wrote " in done.stdout


@pytest.mark.parametrize("name", QUICK)
def test_quiet_says_nothing(folder, name):
    needed(name)
    done = run((*COMMANDS[name], "-q"))
    assert (done.stdout, done.stderr) == ("", "")
    assert len(list(folder.iterdir())) == 2


def test_progress_lines_are_a_second_apart(capsys, monkeypatch):
    now = [0.0]
    monkeypatch.setattr("coneflat.apps.cli.run.time.perf_counter", lambda: now[0])
    with Console() as console:
        for now[0] in (0.0, 0.9, 1.9, 2.9, 3.1, 3.9, 4.3, 4.4):
            console.progress(f"step {now[0]}", now[0] / 6)
        console.say(["said"])
        for now[0] in (5.0, 5.5):
            console.progress(f"step {now[0]}", now[0] / 6)
    assert re.findall(r"step (\S+)", capsys.readouterr().err) == ["1.9", "3.1", "4.3", "5.5"]


@pytest.mark.parametrize(
    ("elapsed", "fraction", "text"),
    [
        (10, 0.5, "about 10 s left"),
        (12, 0.5, "about 10 s left"),
        (10, 0.99, "about 5 s left"),
        (57, 0.5, "about 1 min left"),
        (60, 0.25, "about 3 min left"),
        (1000, 0.1, "about 2 h left"),
        (1, 0.5, ""),  # too early to tell
        (10, 0.01, ""),
        (10, 0.0, ""),
        (10, 1.0, ""),
    ],
)
def test_the_rest_of_the_time_is_estimated(elapsed, fraction, text):
    assert time_left(elapsed, fraction) == text


def test_lines_of_progress_say_what_is_left(capsys, monkeypatch):
    now = [0.0]
    monkeypatch.setattr("coneflat.apps.cli.run.time.perf_counter", lambda: now[0])
    with Console() as console:
        for now[0] in (20.0, 30.0):
            console.progress("search: candidate 2", now[0] / 100)
    assert [line.partition("%")[2].strip() for line in capsys.readouterr().err.splitlines()] == [
        "search: candidate 2 (about 1 min left)",
        "search: candidate 2 (about 1 min left)",
    ]
