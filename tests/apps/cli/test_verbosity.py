"""What the commands say of their work: all in the same way."""

from __future__ import annotations

import contextlib
import os
import re
import subprocess
import sys

import pytest
import shapes
from click.testing import CliRunner

from coneflat.apps.cli import run as command_run
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


NOTE = "Merged 12 vertices at the same positions; of vertices that differ in colour the first one is used."
ROWS = [
    ("overlap", "none", "no two triangles overlap"),
    ("cones", "17 (-0.109 to +1.003 pi)", "singular vertices and their curvatures"),
]


@pytest.mark.parametrize("width", [24, 40, 80, 120])
def test_notes_and_tables_fit_the_terminal_without_broken_words(monkeypatch, capsys, width):
    monkeypatch.setattr(command_run, "_terminal_width", lambda: width)
    console = Console("-v")
    console.notes([NOTE])
    notes = capsys.readouterr().out.splitlines()
    assert " ".join(line.strip() for line in notes) == f"note: {NOTE}"
    console.table(ROWS)
    table = [re.sub(r"\x1b\[\d*m", "", line) for line in capsys.readouterr().out.splitlines()]
    assert " ".join(" ".join(table).split()) == " ".join(" ".join(row) for row in ROWS)
    lines = notes + (table if width >= 40 else [])  # Names and values are not broken.
    assert all(len(line) <= width for line in lines)


def test_a_narrow_table_has_blocks_and_a_wide_one_columns(monkeypatch, capsys):
    tables = []
    for width in (60, 100):
        monkeypatch.setattr(command_run, "_terminal_width", lambda width=width: width)
        Console("-v").table(ROWS)
        tables.append(re.sub(r"\x1b\[\d*m", "", capsys.readouterr().out).splitlines())
    assert tables[0][:2] == ["overlap  none", "    no two triangles overlap"]
    assert len(tables[1]) == len(ROWS)


def test_notes_are_single_lines_for_programs(capsys):
    Console("-v").notes([NOTE])
    assert capsys.readouterr().out == f"note: {NOTE}\n"


@pytest.mark.skipif(sys.platform == "win32", reason="there are no pseudo-terminals")
def test_a_terminal_gets_no_traceback_at_the_end(folder):
    """In a terminal, with a library that takes stdout for itself while a bar is shown."""
    import pty

    words = [sys.executable, "-m", "coneflat", *COMMANDS["flatten"]]
    parent, child = pty.openpty()
    process = subprocess.Popen(words, stdin=child, stdout=child, stderr=child)
    os.close(child)
    content = b""
    with contextlib.suppress(OSError):  # The end of the process ends the terminal.
        while part := os.read(parent, 4096):
            content += part
    os.close(parent)
    assert process.wait() == 0
    assert b"wrote out.obj" in content
    assert b"Traceback" not in content
