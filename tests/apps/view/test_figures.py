"""Whole figures, their files, and the command."""

from __future__ import annotations

import re
import sys

import numpy as np
import pytest
import shapes
from command import command
from figure_contents import groups, pixels

import coneflat
from coneflat.errors import OptionError

pytest.importorskip("matplotlib")

from coneflat.apps.cli import figure_commands
from coneflat.apps.view.figures.kinds import KINDS
from coneflat.apps.view.figures.uv_layout import chart_paths


@pytest.fixture(scope="module")
def result():
    return coneflat.flatten(*shapes.sphere(3), charts="atlas")


class TestFigures:
    @pytest.mark.parametrize("kind", KINDS[:5])
    @pytest.mark.parametrize("closed", [True, False])
    @pytest.mark.slow
    def test_every_kind_fills_its_panels(self, result, kind, closed):
        shown = result if closed else shapes.tube()
        figure = coneflat.make_figure(shown, kind, dpi=60, up="z", title="A $title_ of {its} own")
        image = pixels(figure)
        for axes in figure.axes:
            box = axes.get_window_extent()
            part = image[len(image) - int(box.y1) : len(image) - int(box.y0), int(box.x0) : int(box.x1)]
            assert 0.03 < (part < 250).any(axis=2).mean() < 0.99, axes
        # Nothing is cut off by the figure's border.
        assert (image[:2] > 250).all()
        assert (image[:, :2] > 250).all()
        assert (image[:, -2:] > 250).all()

    @pytest.mark.slow
    def test_size_and_resolution_are_those_asked_for(self, result, tmp_path):
        image = pytest.importorskip("PIL.Image")
        figure = coneflat.make_figure(result, "quality", size=(6.0, 4.0), dpi=120)
        with image.open(coneflat.save_figure(figure, tmp_path / "quality.png")) as written:
            assert written.size == (720, 480)
            assert written.info["dpi"] == pytest.approx((120, 120), abs=0.1)
        # Pictures are as fine as the figure.
        picture = figure.axes[0].images[0].get_array()
        assert picture.shape[1] == pytest.approx(figure.axes[0].get_window_extent().width, abs=1)

    @pytest.mark.slow
    @pytest.mark.parametrize("ending", ["png", "svg", "pdf", "PNG"])
    def test_files_are_of_their_kind_and_the_same_each_time(self, result, tmp_path, ending):
        paths = [
            coneflat.save_figure(coneflat.make_figure(result, "cones", dpi=50), tmp_path / f"{name}.{ending}")
            for name in ("one", "two")
        ]
        first, second = (path.read_bytes() for path in paths)
        assert first == second
        start = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}[ending.lower()]
        assert first.startswith(start)
        assert b"/Type3" not in first
        assert sorted(path.name for path in tmp_path.iterdir()) == sorted(path.name for path in paths)

    @pytest.mark.parametrize(
        ("kind", "look", "message"),
        [
            ("magic", {}, "unknown kind of figure 'magic': choose from layout"),
            (np.eye(2), {}, "unknown kind of figure array"),
            ("curve", {}, "cone_curve"),
            ("cones", {"eyes": "above"}, "unknown eye 'above'"),
            ("cones", {"eyes": []}, "at least one direction"),
            ("cones", {"up": "w"}, "got 'w'"),
            ("cones", {"dpi": 0}, "between 10 and 2400"),
            ("cones", {"size": (50, 50)}, "225 million pixels"),
            ("cones", {"size": (-5, 5)}, "-5 by 5 inches"),
            ("quality", {"size": (2, 1)}, "too small for the pictures"),
            ("quality", {"colors": "rainbows"}, "no colour map 'rainbows'"),
            ("checker", {"cells": -1}, "must be positive, got -1"),
        ],
    )
    def test_invalid_looks_are_refused(self, result, kind, look, message):
        with pytest.raises(OptionError, match=message):
            coneflat.make_figure(result, kind, **look)

    def test_a_missing_matplotlib_is_named_with_its_remedy(self, result, monkeypatch):
        monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
        with pytest.raises(OptionError, match=r'pip install "coneflat\[figures\]"'):
            coneflat.make_figure(result, "layout")


class TestCommand:
    @pytest.fixture
    def run(self, tmp_path):
        shapes.write_obj(tmp_path / "ball.obj", *shapes.sphere(2))

        def call(*words):
            done = command("figure", *words, cwd=tmp_path)
            return done.returncode, done.stdout, done.stderr

        return call

    def test_the_kinds_are_those_of_the_package(self):
        assert figure_commands.KINDS == KINDS

    @pytest.mark.slow
    @pytest.mark.parametrize("kind", KINDS)
    def test_figure_of_a_mesh(self, run, tmp_path, kind):
        vertices = coneflat.read_mesh(tmp_path / "ball.obj").vertices
        np.save(tmp_path / "x.npy", vertices[:, 0])
        color = ["--color", "x.npy"] if kind == "color" else []
        code, out, _ = run("ball.obj", "--kind", kind, "--dpi", "50", *color)
        assert code == 0
        assert re.fullmatch(rf"wrote ball_{kind}\.png\ntime .*, draw \S+, other \S+\n", out)
        assert (tmp_path / f"ball_{kind}.png").stat().st_size > 2000

    @pytest.mark.parametrize("kind", ["layout", "curve"])
    def test_figure_of_a_result(self, run, tmp_path, kind):
        coneflat.flatten(tmp_path / "ball.obj", cone_count=5).save(tmp_path / "ball.npz")
        assert run("ball.npz", "--kind", kind, "-o", "out.svg", "-q") == (0, "", "")
        assert len(list(groups(tmp_path / "out.svg"))) > 3

    def test_views_and_looks(self, run, tmp_path):
        image = pytest.importorskip("PIL.Image")
        look = ("--up", "z", "--size", "5", "3", "--dpi", "40", "--eye", "1,2,0.5", "--eye", "back")
        assert run("ball.obj", "--kind", "checker", "-o", "a.png", *look)[0] == 0
        with image.open(tmp_path / "a.png") as written:
            assert written.size == (200, 120)

    @pytest.mark.parametrize(
        ("words", "message"),
        [
            (("none.obj",), "none.obj: there is no such file"),
            (("ball.obj", "--kind", "magic"), "'magic' is not one of 'layout'"),
            (("ball.obj", "-o", "x.bmp"), "'.bmp', which is not a known format; figures are written as"),
            (("ball.obj", "-o", "none/x.png"), "there is no folder"),
            (("ball.obj", "--eye", "front"), "--eye has no effect with --kind layout, only with checker"),
            (
                ("ball.obj", "--kind", "curve", "--color-charts"),
                "--color-charts has no effect with --kind curve",
            ),
            (
                ("ball.obj", "--kind", "curve", "--again"),
                "only with layout, checker, quality, color, cones, curvature",
            ),
            (("ball.obj", "--kind", "cones", "--eye", "1,2"), "three numbers"),
            (("ball.obj", "--kind", "cones", "--eye", "1,x,2"), "'1,x,2' is not a direction"),
            (("ball.obj", "--dpi", "9000"), "between 10 and 2400"),
            (("ball.obj", "--kind", "quality", "--colors", "no"), "no colour map 'no'"),
            (("uvless.npz",), "holds no result of coneflat with UVs: 'uv' is missing"),
            (("broken.obj", "--strict"), "1 edge with more than two faces"),
        ],
    )
    def test_bad_input_is_one_line(self, run, tmp_path, words, message):
        np.savez(tmp_path / "uvless.npz", vertices=np.zeros((3, 3)), faces=np.array([[0, 1, 2]]))
        text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 1 1 1\nf 1 2 3\nf 2 1 4\nf 1 2 5\n"
        (tmp_path / "broken.obj").write_text(text)
        before = sorted(tmp_path.iterdir())
        code, out, err = run(*words)
        assert (code, out) == (2, "")
        assert err.startswith("coneflat: error: ")
        assert err.count("\n") == 1
        assert message in err
        assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize("shown", [None, 3, np.eye(3), "layout"])
def test_figures_need_a_result(shown):
    with pytest.raises(OptionError, match="expected a result of `coneflat.flatten`, got"):
        coneflat.make_figure(shown, "layout")


def test_outlines_that_touch_themselves_enclose_the_triangles():
    """A square of 4 by 4 cells without two that share a corner."""
    places = np.array([[x, y] for y in range(5) for x in range(5)], dtype=float)
    cells = [5 * y + x for y in range(4) for x in range(4) if (x, y) not in ((0, 0), (1, 1))]
    faces = np.array([side for at in cells for side in ([at, at + 1, at + 6], [at, at + 6, at + 5])])
    loops = [loop.T for path in chart_paths(places, faces) for loop in path.to_polygons()]
    assert sum((x[:-1] @ y[1:] - x[1:] @ y[:-1]) / 2 for x, y in loops) == len(cells)
