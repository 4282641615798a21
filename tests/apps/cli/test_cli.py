"""The command line."""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import threading
from unittest.mock import Mock

import numpy as np
import pytest
import shapes
from command import INTERRUPTIBLE
from command import command as run

import coneflat
from coneflat import errors, flatten, read_mesh
from coneflat.apps.cli.main import main

#: A line of progress, which comes by the clock.
PROGRESS = re.compile(r" *\d+\.\d s +\d+%  .*")


def said(text):
    """Return the lines that were printed, without those of progress."""
    return [line for line in text.splitlines() if not PROGRESS.fullmatch(line)]


@pytest.fixture
def model(tmp_path):
    return shapes.write_obj(tmp_path / "model.obj", *shapes.sphere(2))


def test_flatten_writes_mesh_report_and_table(model, tmp_path):
    done = run("flatten", model, "-o", "out.obj", "--report", "report.json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    # On a slow machine it says what it is doing, and nothing else.
    assert all(re.fullmatch(r" +\d+\.\d s +\d+%  \w+.*", line) for line in done.stderr.splitlines())
    for word in ("cones", "QC distortion", "seam length", "wrote out.obj", "wrote report.json", "layout"):
        assert word in done.stdout
    report = json.loads((tmp_path / "report.json").read_text())
    assert {"read", "write", "layout"} <= set(report["seconds"])
    assert report["flipped"] == 0
    lines = (tmp_path / "out.obj").read_text().splitlines()
    assert sum(line.startswith("vt ") for line in lines) > 162
    np.testing.assert_array_equal(read_mesh(tmp_path / "out.obj").vertices, read_mesh(model).vertices)


def test_the_time_row_has_all_that_a_command_takes(model, tmp_path):
    done = run("flatten", model, "-o", "out.obj", cwd=tmp_path)
    total, stages = re.search(r"^time +(\d+\.\d\d) s: (.*)$", done.stdout, re.MULTILINE).groups()
    seconds = {name: float(taken) for name, taken in (stage.split() for stage in stages.split(", "))}
    assert {"read", "check", "layout", "pack", "measure", "write", "other"} <= set(seconds)
    assert sum(seconds.values()) == pytest.approx(float(total), abs=0.005 * len(seconds) + 0.01)


@pytest.mark.parametrize("words", [[], ["batch"], ["flatten"]])
def test_help_is_a_command(words):
    done, expected = run("help", *words), run(*words, "--help")
    assert (done.returncode, done.stdout) == (0, expected.stdout)
    assert done.stdout.startswith("Usage: ")


@pytest.mark.parametrize(
    ("file", "advice"),
    [
        ("a.obj", "`coneflat flatten a.obj` or `coneflat unwrap a.obj` or `coneflat studio a.obj`"),
        ("A B.GLB", "`coneflat flatten 'A B.GLB'` or "),
        ("a.npz", "`coneflat view a.npz`"),
        ("a_studio.json", "`coneflat studio a_studio.json`"),
    ],
)
def test_a_file_without_a_command_gets_advice(file, advice):
    done = run(file)
    assert done.returncode == 2
    assert f"{file} is a file, not a command: use {advice}" in done.stderr


def test_paper_is_the_published_method(model, tmp_path):
    done = run("flatten", model, "--paper", "--report", "paper.json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    settings = json.loads((tmp_path / "paper.json").read_text())["settings"]
    assert settings["cones"] == "greedy"
    assert settings["method"] == "linear"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nothing.obj"], "nothing.obj"),
        (["model.obj", "-o", "x.fbx"], "'.fbx'"),
        (["model.obj", "-o", "missing/x.obj"], "missing"),
        (["model.obj", "--report", "missing/x.json"], "missing"),
        (["model.obj", "--texture", "checker"], "only .glb files contain a texture"),
        (["model.obj", "-o", "x.glb", "--texture", "none.png"], "none.png: there is no such file"),
        (["."], "coneflat batch"),
        (["model.obj", "-o", "x.glb", "--texture", "text.ply"], "text.ply is not a readable image"),
        (["model.obj", "-o", "model.obj"], "is both the input and the output"),
        (["model.obj", "-o", "z.obj", "--report", "model.obj"], "is both the input and the report"),
        (["model.obj", "-o", "z.obj", "--report", "./z.obj"], "is both the output and the report"),
        (["model.obj", "--distortion", "few"], "not a valid float"),
        (["model.obj", "--max-cones", "0"], "0 cones of at most 1.5 pi each cannot absorb"),
        (["model.obj", "--cones", "magic"], "magic"),
        (["model.obj", "--boundary", "1:pi,2"], "vertex 2 has none"),
        (["model.obj", "--cones", "1:pi", "--cones", "2:pi"], "sum to 6.283185 (2 pi)"),
        (["model.obj", "--cones", "1x"], "'1x' is not VERTEX"),
        (["model.obj", "--cones", "1", "--max-cones", "3"], "leave out --max-cones"),
        (["model.obj", "--paper", "--distortion", "1"], "leave out --distortion"),
        (["model.obj", "--magic"], "--magic"),
        (["model.obj", "--hide-seams", "much"], "'much' is not a number"),
        (["empty.obj"], "empty.obj"),
        (["text.ply"], "text.ply"),
        (["model.xyz"], ".xyz"),
        (
            ["model.fbx"],
            "'.fbx', which is not a known format (export glTF (.glb) from the program that made it);",
        ),
        (["model.blend"], "or map it there with the extension of `coneflat blender`)"),
        (["model.obj", "--sharp-angle", "40"], "got 40 radians; for 40 degrees write 40deg"),
        (["model.obj", "--quantise", "90"], "got 90; for 90 degrees write 90deg"),
        (["model.obj", "--min-cone-angle", "120"], "the smallest (120); for 120 degrees write 120deg"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(model, tmp_path, arguments, message):
    (tmp_path / "empty.obj").write_text("")
    (tmp_path / "text.ply").write_text("this is not a mesh")
    (tmp_path / "model.xyz").write_text("0 0 0")
    before = sorted(tmp_path.iterdir())
    done = run("flatten", *arguments, cwd=tmp_path)
    assert done.returncode == 2
    (line,) = said(done.stderr)
    assert line.startswith("coneflat: error: ")
    assert message in line
    assert done.stdout == ""
    assert sorted(tmp_path.iterdir()) == before


def test_cones_from_a_file(model, tmp_path):
    def flatten(text):
        (tmp_path / "cones.txt").write_text(text)
        return run("flatten", model, "--cones", "cones.txt", "--report", "report.json", cwd=tmp_path)

    done = flatten("# vertex curvature\n3 pi/2\n\n50, 270deg\n100 pi # the third\n120  1.0pi\n")
    assert done.returncode == 0, done.stderr
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["cone_vertices"] == [3, 50, 100, 120]
    np.testing.assert_allclose(report["cone_curvatures"], np.pi * np.array([0.5, 1.5, 1, 1]))
    for text, message in [
        ("3 pi/2\n50 2pi*0.5\n", "cones.txt, line 2: '50 2pi*0.5'"),
        ("3 pi/2\n50 pi\n", "sum to 4.712389 (1.5 pi)"),
        ("# nothing\n", "cones.txt contains no cones"),
    ]:
        done = flatten(text)
        assert done.returncode == 2
        assert message in done.stderr


@pytest.mark.skipif(os.name == "nt", reason="sh closes the streams")
@pytest.mark.parametrize(
    "closed", [*(pytest.param(closed, marks=pytest.mark.slow) for closed in (">&-", "2>&-")), "<&- >&- 2>&-"]
)
def test_closed_standard_streams_do_not_prevent_the_output(tmp_path, closed):
    shapes.write_obj(tmp_path / "in.obj", *shapes.sphere(2))
    command = f'"{sys.executable}" -m coneflat flatten in.obj -o out.obj {closed}'
    assert subprocess.run(command, shell=True, cwd=tmp_path, check=False).returncode == 0
    assert len(coneflat.measure_uv(tmp_path / "out.obj").mesh.faces) == 320


def test_what_libraries_print_is_not_part_of_the_output():
    code = """if True:
        import os, coneflat.apps.cli.main as command
        command.cli.main = lambda **_: os.write(1, b"a library's message") and print("ours")
        command.main()"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "ours\n"


def test_interrupts_in_compiled_functions_are_interrupts(monkeypatch, capsys):
    def interrupted(**_):
        raise SystemError("returned a result with an exception set") from KeyboardInterrupt()

    monkeypatch.setattr("coneflat.apps.cli.main.cli.main", interrupted)
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 130
    assert "interrupted" in capsys.readouterr().err


@pytest.mark.skipif(os.name == "nt", reason="Windows has other signals")
def test_a_command_that_hangs_after_a_signal_is_ended():
    code = """if True:
        import signal, time, coneflat.apps.cli.main as command
        def hang(**_):
            try:
                signal.raise_signal(signal.SIGTERM)
            finally:
                time.sleep(60)
        command.cli.main = hang
        command.main()"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=30, check=False, **INTERRUPTIBLE
    )
    assert done.returncode == 128 + signal.SIGTERM
    assert done.stderr == "coneflat: error: interrupted, and ended by force\n"


@pytest.mark.skipif(os.name == "nt", reason="Windows has other signals")
@pytest.mark.parametrize("error", [KeyboardInterrupt, SystemError, ValueError])
def test_a_signal_gives_its_exit_code_whatever_error_arrives(monkeypatch, capsys, error):
    def interrupted(**_):
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGTERM)
        raise error

    before = signal.signal(signal.SIGTERM, signal.SIG_DFL)
    monkeypatch.setattr("coneflat.apps.cli.main.cli.main", interrupted)
    monkeypatch.setattr("coneflat.apps.cli.main.start_new_thread", Mock())  # This process goes on.
    with pytest.raises(SystemExit) as ended:
        main()
    signal.signal(signal.SIGTERM, before)
    assert ended.value.code == 128 + signal.SIGTERM
    assert "interrupted" in capsys.readouterr().err


def test_messages_are_one_line(tmp_path):
    with pytest.raises(errors.MeshFileError) as error:
        coneflat.read_mesh(tmp_path / "two\nlines.obj")
    assert "\n" not in str(error.value)


@pytest.mark.skipif(os.name == "nt", reason="Windows has other signals")
@pytest.mark.parametrize(
    "name", ["SIGINT", *(pytest.param(name, marks=pytest.mark.slow) for name in ("SIGTERM", "SIGHUP"))]
)
@pytest.mark.parametrize("step", [pytest.param("cones", marks=pytest.mark.slow), "write"])
def test_interrupt_leaves_no_incomplete_file(tmp_path, step, name):
    shapes.write_obj(tmp_path / "big.obj", *shapes.sphere(4))
    # A file that is written waits for the signal before it gets its name.
    waiting = "import os, time; from coneflat.apps.cli.main import main; os.replace = lambda *_: time.sleep(60); main()"
    command = [sys.executable, "-c", waiting, "flatten", "-v", "big.obj", "-o", "out.obj"]
    with subprocess.Popen(
        command, cwd=tmp_path, stderr=subprocess.PIPE, text=True, **INTERRUPTIBLE
    ) as process:
        assert process.stderr is not None
        hanging = threading.Timer(60, process.kill)
        hanging.start()
        for line in process.stderr:
            if line.split()[-1:] == [step]:
                process.send_signal(getattr(signal, name))
                break
        said = process.stderr.read()
        hanging.cancel()
    assert process.returncode == 128 + getattr(signal, name)
    assert said.splitlines()[-1] == "coneflat: error: interrupted; no incomplete file was left"
    assert [path.name for path in tmp_path.iterdir()] == ["big.obj"]


@pytest.mark.slow
def test_demo(tmp_path):
    pytest.importorskip("matplotlib")
    done = run("demo", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "coneflat-demo"
    assert (folder / "sample.png").read_bytes()[:4] == b"\x89PNG"
    assert json.loads((folder / "sample.json").read_text())["flipped"] == 0
    assert "vt " in (folder / "sample.obj").read_text()
    assert str(folder.relative_to(tmp_path) / "sample.png") in done.stdout


def test_textures(model, tmp_path):
    done = run(
        "flatten", model, "-o", "out.npz", "--up=-y", "--padding", "8", "--resolution", "512", cwd=tmp_path
    )
    assert done.returncode == 0
    with np.load(tmp_path / "out.npz") as arrays:
        assert arrays["uv"].min() >= 8 / 512 - 1e-12
        assert arrays["uv"].max() <= 1 - 8 / 512 + 1e-12
    for words, message in (
        (("--up", "north"), "not a direction"),
        (("--up", ""), "not a direction"),
        (("--up", "0,0,0"), "not all 0"),
        (("--padding", "-1"), "padding must be"),
        (("--tiles", "0"), "tiles must be an integer from 1 to 1,000"),
        (("--resolution", "0"), "resolution must be an integer from 1"),
    ):
        done = run("flatten", model, "-q", *words, cwd=tmp_path)
        assert done.returncode == 2
        assert message in done.stderr
        assert len(said(done.stderr)) == 1


def test_marked_seams(tmp_path):
    shapes.write_obj(tmp_path / "box.obj", *shapes.box(2))
    done = run(
        "flatten", "box.obj", "-o", "six.obj", "--sharp-angle", "60deg", "--report", "r.json", cwd=tmp_path
    )
    assert done.returncode == 0
    assert json.loads((tmp_path / "r.json").read_text())["charts"] == 6
    (tmp_path / "pairs.txt").write_text("0 1  # an edge\n")
    assert run("flatten", "box.obj", "-q", "--seams", "pairs.txt", cwd=tmp_path).returncode == 0
    for text, message in (
        ("0 x\n", "line 1: '0 x' is not a pair"),
        ("# none\n", "contains no pairs"),
        ("0 25", "0-25"),
    ):
        (tmp_path / "pairs.txt").write_text(text)
        done = run("flatten", "box.obj", "-q", "--seams", "pairs.txt", cwd=tmp_path)
        assert done.returncode == 2
        assert message in done.stderr
    done = run("flatten", "box.obj", "-q", "--seams", "input", "--seams", "input", cwd=tmp_path)
    assert "--seams input is given twice" in done.stderr
    done = run("flatten", "box.obj", "-q", "--seams", "input", cwd=tmp_path)
    assert "no UV coordinates" in done.stderr


@pytest.mark.slow
def test_no_seams_takes_vertices_and_pairs(tmp_path):
    vertices, faces = shapes.sphere(3, bumps=0.4, seed=5)
    shapes.write_obj(tmp_path / "ball.obj", vertices, faces)
    seams = flatten(tmp_path / "ball.obj").seams
    (tmp_path / "pairs.txt").write_text("\n".join(f"{a} {b}" for a, b in seams[:4]) + "  # edges\n")
    (tmp_path / "some.txt").write_text("\n".join(str(v) for v in np.unique(seams[:4])))
    for values in ("pairs.txt", "some.txt", ",".join(str(v) for v in np.unique(seams[:4]))):
        done = run("flatten", "ball.obj", "-q", "-o", "out.npz", "--no-seams", values, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        cut_edges = np.load(tmp_path / "out.npz")["seams"]
        assert not {tuple(sorted(edge)) for edge in seams[:4].tolist()} & {
            tuple(sorted(edge)) for edge in cut_edges.tolist()
        }
    done = run("flatten", "ball.obj", "--no-seams", "3", "--no-seams", "pairs.txt", cwd=tmp_path)
    assert "--no-seams takes vertices or pairs of them, not both" in done.stderr
    done = run("flatten", "ball.obj", "--no-seams", "x", cwd=tmp_path)
    assert "--no-seams: 'x' is not a vertex, and there is no such file" in done.stderr
