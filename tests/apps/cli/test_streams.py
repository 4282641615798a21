"""Standard streams that are full or closed, and files that stay open."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from command import without_note_on_compilation

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n"
FULL = Path("/dev/full")


def run(folder, *words, stdout=subprocess.PIPE, stderr=subprocess.PIPE):
    """Run a command in its own process, in which open files and warnings are errors."""
    (folder / "a.obj").write_text(SQUARE)
    line = [sys.executable, "-X", "dev", "-W", "error", "-m", "coneflat", *words]
    done = subprocess.run(line, cwd=folder, stdout=stdout, stderr=stderr, text=True, check=False)
    if done.stderr is not None:
        done.stderr = without_note_on_compilation(done.stderr)
    return done


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["--help"], 0),
        ([], 2),
        pytest.param(["measure", "a.obj"], 0, marks=pytest.mark.slow),
        pytest.param(["blender", "-o", "b.zip"], 0, marks=pytest.mark.slow),
        pytest.param(["flatten", "a.obj", "-o", "-"], 0, marks=pytest.mark.slow),
        pytest.param(["flatten", "a.obj", "-o", "b.glb"], 0, marks=pytest.mark.slow),
    ],
)
def test_commands_close_their_files(tmp_path, words, code):
    done = run(tmp_path, *words)
    assert (done.returncode, "Warning" in done.stderr, "Traceback" in done.stderr) == (code, False, False)


@pytest.mark.skipif(not FULL.exists(), reason="there is no full device")
@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["--help"], 1),
        ([], 1),
        (["nonsense"], 2),
        pytest.param(["measure", "a.obj", "--json"], 1, marks=pytest.mark.slow),
        pytest.param(["measure", "a.obj"], 1, marks=pytest.mark.slow),
        pytest.param(["flatten", "a.obj", "-o", "-", "-q"], 1, marks=pytest.mark.slow),
    ],
)
def test_a_full_stdout_is_one_line_and_exit_code_1(tmp_path, words, code):
    with FULL.open("w") as full:
        done = run(tmp_path, *words, stdout=full)
    assert (done.returncode, done.stderr.count("\n")) == (code, 1)
    assert done.stderr.startswith("coneflat: error: ")
    full_word = os.strerror(28)
    assert (full_word in done.stderr) == (code == 1)


@pytest.mark.slow
@pytest.mark.skipif(not FULL.exists(), reason="there is no full device")
def test_a_full_stderr_does_not_stop_the_work(tmp_path):
    with FULL.open("w") as full:
        done = run(tmp_path, "flatten", "a.obj", "-o", "b.obj", "-v", stderr=full)
        assert (done.returncode, (tmp_path / "b.obj").exists()) == (0, True)
        assert run(tmp_path, "measure", "missing.obj", stderr=full).returncode == 2
