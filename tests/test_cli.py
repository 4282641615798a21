"""The command line, in processes of its own."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import threading

import numpy as np
import pytest
import shapes

from coneflat import errors, read_mesh
from coneflat.apps.cli.values import parse_angle, parse_curvature, read_vertex_map

#: A line of progress, which comes by the clock.
PROGRESS = re.compile(r" *\d+\.\d s +\d+%  .*")


def said(text):
    """Return the lines that were printed, without those of progress."""
    return [line for line in text.splitlines() if not PROGRESS.fullmatch(line)]


def run(*arguments, cwd, **options):
    command = [sys.executable, "-m", "coneflat", *map(str, arguments)]
    return subprocess.run(
        command, cwd=cwd, capture_output=True, text=True, timeout=120, check=False, **options
    )


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


def test_quiet_prints_nothing(model, tmp_path):
    done = run("flatten", model, "-q", cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert (tmp_path / "model_uv.obj").exists()


@pytest.mark.parametrize("ending", ["ply", "glb", "npz"])
def test_other_formats(model, tmp_path, ending):
    assert run("flatten", model, "-q", "-o", f"out.{ending}", cwd=tmp_path).returncode == 0
    assert (tmp_path / f"out.{ending}").stat().st_size > 1000


def test_glb_with_a_texture(model, tmp_path):
    pytest.importorskip("PIL")
    done = run("flatten", model, "-q", "-o", "out.glb", "--texture", "checker", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert b"baseColorTexture" in (tmp_path / "out.glb").read_bytes()


def test_paper_is_the_published_method(model, tmp_path):
    done = run("flatten", model, "--paper", "--report", "paper.json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    settings = json.loads((tmp_path / "paper.json").read_text())["settings"]
    assert settings["cones"] == "greedy"
    assert settings["method"] == "linear"
    assert settings["epsilon"] == 1.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nothing.obj"], "nothing.obj"),
        (["model.obj", "-o", "x.fbx"], "'.fbx'"),
        (["model.obj", "-o", "missing/x.obj"], "missing"),
        (["model.obj", "--report", "missing/x.json"], "missing"),
        (["model.obj", "--texture", "checker"], "only .glb files carry a texture"),
        (["model.obj", "-o", "x.glb", "--texture", "none.png"], "none.png: there is no such file"),
        (["."], "coneflat batch"),
        (["model.obj", "-o", "x.glb", "--texture", "text.ply"], "text.ply is not a readable image"),
        (["model.obj", "-o", "model.obj"], "is the input and the output"),
        (["model.obj", "-o", "z.obj", "--report", "model.obj"], "is the input and the report"),
        (["model.obj", "-o", "z.obj", "--report", "./z.obj"], "is the output and the report"),
        (["model.obj", "--cones", "greedy", "--epsilon", "0"], "epsilon must be a positive number"),
        (["model.obj", "--epsilon", "few"], "not a valid float"),
        (["model.obj", "--max-cones", "0"], "0 cones of at most 1.5 pi each cannot carry"),
        (["model.obj", "--cones", "magic"], "magic"),
        (["model.obj", "--boundary", "1:pi,2"], "vertex 2 has none"),
        (["model.obj", "--cones", "1:pi", "--cones", "2:pi"], "sum to 6.283185 (2 pi)"),
        (["model.obj", "--cones", "1x"], "'1x' is not VERTEX"),
        (["model.obj", "--cones", "1", "--max-cones", "3"], "leave out --max-cones"),
        (["model.obj", "--paper", "--epsilon", "1"], "leave out --epsilon"),
        (["model.obj", "--magic"], "--magic"),
        (["model.obj", "--cone", "1"], "--cone is now --cones"),
        (["model.obj", "--cones-file", "a"], "--cones-file is now --cones"),
        (["model.obj", "--corner", "1"], "--corner is now --boundary"),
        (["model.obj", "--forbid", "1"], "--forbid is now --forbidden-cones"),
        (["model.obj", "--only", "1"], "--only is now --allowed-cones"),
        (["model.obj", "--keep-seams"], "--keep-seams is now --seams input"),
        (["model.obj", "--require", "3"], "--required-cones 3"),
        (["model.obj", "--at-cones", "scale"], "there is no option --at-cones any more"),
        (["model.obj", "--lengths", "mean"], "there is no option --lengths any more"),
        (["model.obj", "--hide-seams", "much"], "'much' is no strength"),
        (["empty.obj"], "empty.obj"),
        (["text.ply"], "text.ply"),
        (["model.xyz"], ".xyz"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(model, tmp_path, arguments, message):
    (tmp_path / "empty.obj").write_text("")
    (tmp_path / "text.ply").write_text("this is no mesh")
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
        ("# nothing\n", "cones.txt holds no cones"),
    ]:
        done = flatten(text)
        assert done.returncode == 2
        assert message in done.stderr


@pytest.mark.parametrize(
    ("text", "value"),
    [("1.5", 1.5), ("pi", np.pi), ("-pi/2", -np.pi / 2), ("0.5pi", np.pi / 2), ("3pi/2", 1.5 * np.pi),
     ("90deg", np.pi / 2), ("1e-1", 0.1), ("π", np.pi), ("-.25 pi", -np.pi / 4), ("2 * pi", 2 * np.pi)],
)  # fmt: skip
def test_curvatures_as_people_write_them(text, value):
    assert parse_curvature(text, "here") == pytest.approx(value)


@pytest.mark.parametrize("text", ["", "x", "pi/0", "1..2", "pipi", "-", "deg", "nan", "1 2"])
def test_what_is_no_curvature(text):
    with pytest.raises(errors.OptionError, match="here"):
        parse_curvature(text, "here")


def test_what_is_no_angle_is_said_once():
    with pytest.raises(errors.OptionError, match="^'40dog' is no angle; write"):
        parse_angle("40dog")


def test_cones_named_twice():
    with pytest.raises(errors.OptionError, match="vertex 4 is given as a cone twice"):
        read_vertex_map("--cones", "cone", ["4", "4:pi"])


def test_nonmanifold_is_refused_and_repaired(tmp_path):
    vertices, faces = shapes.sphere(1)
    shapes.write_obj(
        tmp_path / "fin.obj", np.r_[vertices, [[2, 2, 2]]], np.r_[faces, [[0, 12, len(vertices)]]]
    )
    done = run("flatten", "fin.obj", "--strict", cwd=tmp_path)
    assert done.returncode == 2
    assert "1 edge with more than two faces (vertex pairs 0-12); pass repair=True" in done.stderr
    assert "leave out --strict" in done.stderr
    done = run("flatten", "fin.obj", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "Separated the faces at 1 edge" in done.stdout


@pytest.mark.skipif(os.name == "nt", reason="Windows has other signals")
@pytest.mark.parametrize("step", ["read", "cones", "metric", "pack", "write"])
def test_interrupt_leaves_nothing_half_written(tmp_path, step):
    shapes.write_obj(tmp_path / "big.obj", *shapes.sphere(6))
    command = [sys.executable, "-m", "coneflat", "flatten", "-v", "big.obj", "-o", "out.obj"]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        hanging = threading.Timer(60, process.kill)
        hanging.start()
        for line in process.stderr:
            if line.split()[-1:] == [step]:
                process.send_signal(signal.SIGINT)
                break
        said = process.stderr.read()
        hanging.cancel()
    assert process.returncode == 130
    assert said.splitlines()[-1] == "coneflat: error: interrupted; nothing was left half-written"
    assert [path.name for path in tmp_path.iterdir()] == ["big.obj"]


def test_demo(tmp_path):
    pytest.importorskip("matplotlib")
    done = run("demo", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "coneflat-demo"
    assert (folder / "sample.png").read_bytes()[:4] == b"\x89PNG"
    assert json.loads((folder / "sample.json").read_text())["flipped"] == 0
    assert "vt " in (folder / "sample.obj").read_text()
    assert str(folder.relative_to(tmp_path) / "sample.png") in done.stdout


def test_help_lists_the_commands(tmp_path):
    done = run("--help", cwd=tmp_path)
    assert done.returncode == 0
    assert "flatten" in done.stdout
    assert "demo" in done.stdout
    assert "coneflat, version" in run("--version", cwd=tmp_path).stdout
    assert run(cwd=tmp_path).returncode == 2


def test_textures(model, tmp_path):
    done = run(
        "flatten", model, "-o", "out.npz", "--up=-y", "--padding", "8", "--resolution", "512", cwd=tmp_path
    )
    assert done.returncode == 0
    with np.load(tmp_path / "out.npz") as arrays:
        assert arrays["uv"].min() >= 8 / 512 - 1e-12
        assert arrays["uv"].max() <= 1 - 8 / 512 + 1e-12
    for words, message in (
        (("--up", "north"), "no direction"),
        (("--up", "0,0,0"), "not all 0"),
        (("--padding", "-1"), "padding must be"),
        (("--tiles", "0"), "tiles must be from 1"),
        (("--resolution", "0"), "resolution must be from 1"),
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
        ("# none\n", "holds no pairs"),
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


@pytest.mark.parametrize(
    ("ending", "charts"), [("obj", "atlas"), ("glb", "atlas"), ("ply", "atlas"), ("npz", "atlas")]
)
def test_what_is_to_be_textured_becomes_an_atlas(model, tmp_path, ending, charts):
    for extra, expected in (((), charts), (("--charts", "one"), "one"), (("--paper",), "one")):
        done = run(
            "flatten", model, "-q", "-o", f"out.{ending}", "--report", "out.json", *extra, cwd=tmp_path
        )
        assert done.returncode == 0
        assert json.loads((tmp_path / "out.json").read_text())["settings"]["charts"] == expected
