"""Whole figures, their files, and the command."""

from __future__ import annotations

import re
import sys
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
import shapes
from drawing import SVG, axes_of, count_dots, groups, pixels

import coneflat
from coneflat.errors import MeshFileError, OptionError, UnknownFormatError

pytest.importorskip("matplotlib")

from coneflat.apps.cli import figure as command
from coneflat.apps.cli import main as cli
from coneflat.view import KINDS, demo_figure, new_figure
from coneflat.view.figures import compose


@pytest.fixture(scope="module")
def result():
    return coneflat.flatten(*shapes.sphere(3), charts="atlas")


class TestFigures:
    @pytest.mark.parametrize("kind", KINDS[:5])
    @pytest.mark.parametrize("closed", [True, False])
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

    def test_several_eyes_are_several_views(self, result):
        one = coneflat.make_figure(result, "checker", dpi=50)
        three = coneflat.make_figure(result, "checker", dpi=50, eyes=["front", "back", (1, 2, 3)])
        assert (len(one.axes), len(three.axes)) == (1, 3)
        views = [axes.images[0].get_array() for axes in three.axes]
        assert not np.array_equal(views[0][: len(views[1])], views[1][: len(views[0])])

    def test_size_and_resolution_are_those_asked_for(self, result, tmp_path):
        image = pytest.importorskip("PIL.Image")
        figure = coneflat.make_figure(result, "quality", size=(6.0, 4.0), dpi=120)
        with image.open(coneflat.save_figure(figure, tmp_path / "quality.png")) as written:
            assert written.size == (720, 480)
            assert written.info["dpi"] == pytest.approx((120, 120), abs=0.1)
        # Pictures are as fine as the figure.
        picture = figure.axes[0].images[0].get_array()
        assert picture.shape[1] == pytest.approx(figure.axes[0].get_window_extent().width, abs=1)

    def test_colours_asked_for(self, result):
        figure = coneflat.make_figure(result, "curvature", dpi=50, colors="gray")
        array = np.asarray(figure.axes[0].images[0].get_array())[..., :3]
        np.testing.assert_allclose(array[..., 0], array[..., 2], atol=1e-6)

    @pytest.mark.parametrize("ending", ["png", "svg", "pdf", "PNG"])
    def test_files_are_of_their_kind_and_the_same_each_time(self, result, tmp_path, ending):
        paths = [
            coneflat.save_figure(coneflat.make_figure(result, "cones", dpi=50), tmp_path / f"{name}.{ending}")
            for name in ("one", "two")
        ]
        one, two = (path.read_bytes() for path in paths)
        assert one == two
        start = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}[ending.lower()]
        assert one.startswith(start)
        assert b"/Type3" not in one
        assert sorted(path.name for path in tmp_path.iterdir()) == sorted(path.name for path in paths)

    def test_lines_in_vector_files_are_lines(self, result, tmp_path):
        path = coneflat.save_figure(coneflat.make_figure(result, "cones", dpi=50), tmp_path / "cones.svg")
        found = groups(path)
        assert len(list(found["seams"].iter(f"{SVG}path"))) > 3
        assert count_dots(found["cones"]) + count_dots(found.get("hidden-cones")) == len(result.cones)
        # The shaded model is a picture.
        assert len(list(ElementTree.parse(path).iter(f"{SVG}image"))) == 1

    def test_the_demo_figure_has_a_legend_of_what_is_there(self):
        tube = shapes.tube()
        texts = [text.get_text() for text in demo_figure(tube, up="z").legends[0].get_texts()]
        assert texts == ["seam", "positive cone", "negative cone"]
        tube.cones, tube.curvatures = np.empty(0, dtype=int), np.empty(0)
        tube.seams = np.empty((0, 2), dtype=int)
        tube.distortion.qc[:] = np.nan
        assert not demo_figure(tube, up="z").legends

    @pytest.mark.parametrize(
        ("kind", "look", "message"),
        [
            ("magic", {}, "unknown kind of figure 'magic': choose from layout"),
            (np.eye(2), {}, "unknown kind of figure array"),
            ("curve", {}, "cone_curve"),
            ("cones", {"eyes": "above"}, "unknown eye 'above'"),
            ("cones", {"eyes": []}, "needs an eye"),
            ("cones", {"up": "w"}, "not 'w'"),
            ("cones", {"dpi": 0}, "between 10 and 2400"),
            ("cones", {"size": (50, 50)}, "225 million pixels"),
            ("cones", {"size": (-5, 5)}, "-5 by 5 inches"),
            ("quality", {"size": (2, 1)}, "no room"),
            ("quality", {"colors": "rainbows"}, "no colour map 'rainbows'"),
            ("checker", {"cells": -1}, "must be positive, not -1"),
        ],
    )
    def test_what_makes_no_sense(self, result, kind, look, message):
        with pytest.raises(OptionError, match=message):
            coneflat.make_figure(result, kind, **look)

    def test_quality_of_what_and_where(self, result):
        with pytest.raises(OptionError, match="unknown measure 'beauty'"):
            coneflat.draw_quality(result, axes_of(), measure="beauty")
        with pytest.raises(OptionError, match="on 'paper'"):
            coneflat.draw_quality(result, axes_of(), on="paper")

    def test_files_that_cannot_be_written(self, result, tmp_path):
        figure = new_figure(1, 1)
        with pytest.raises(UnknownFormatError, match=r"figures are written as \.png, \.svg, \.pdf"):
            coneflat.save_figure(figure, tmp_path / "x.bmp")
        with pytest.raises(MeshFileError, match="there is no folder"):
            coneflat.save_figure(figure, tmp_path / "none" / "x.png")

    def test_a_missing_matplotlib_is_named_with_its_remedy(self, result, monkeypatch):
        monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
        with pytest.raises(OptionError, match=r'pip install "coneflat\[figures\]"'):
            coneflat.make_figure(result, "layout")

    def test_no_window_system_is_touched(self):
        assert "matplotlib.pyplot" not in sys.modules

    def test_more_pixels_than_memory_holds_are_refused(self):
        compose.check_pixels((10.0, 10.0), 500.0)
        with pytest.raises(OptionError, match="31 million pixels"):
            compose.check_pixels((10.0, 10.0), 557.0)


class TestCommand:
    @pytest.fixture
    def run(self, tmp_path, monkeypatch, capsys):
        monkeypatch.chdir(tmp_path)
        shapes.write_obj(tmp_path / "ball.obj", *shapes.sphere(2))

        def call(*words):
            monkeypatch.setattr(sys, "argv", ["coneflat", "figure", *words])
            with pytest.raises(SystemExit) as stopped:
                cli.main()
            said = capsys.readouterr()
            return stopped.value.code, said.out, said.err

        return call

    def test_the_kinds_are_those_of_the_package(self):
        assert command.KINDS == KINDS

    @pytest.mark.parametrize("kind", KINDS)
    def test_of_a_mesh(self, run, tmp_path, kind):
        vertices = coneflat.read_mesh(tmp_path / "ball.obj").vertices
        np.save(tmp_path / "x.npy", vertices[:, 0])
        own = ["--color", "x.npy"] if kind == "color" else []
        code, out, _ = run("ball.obj", "--kind", kind, "--dpi", "50", *own)
        assert code == 0
        assert re.fullmatch(rf"wrote ball_{kind}\.png\ntime .*, draw \S+\n", out)
        assert (tmp_path / f"ball_{kind}.png").stat().st_size > 2000

    @pytest.mark.parametrize("kind", ["layout", "curve"])
    def test_of_a_result(self, run, tmp_path, kind):
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
            (("ball.obj", "-o", "x.bmp"), "'.bmp', which is no known format; figures are written as"),
            (("ball.obj", "-o", "none/x.png"), "there is no folder"),
            (("ball.obj", "--eye", "front"), "--kind layout takes no --eye: only checker"),
            (("ball.obj", "--kind", "curve", "--color-charts"), "takes no --color-charts"),
            (
                ("ball.obj", "--kind", "curve", "--again"),
                "only layout, checker, quality, color, cones, curvature do",
            ),
            (("ball.obj", "--kind", "cones", "--eye", "1,2"), "three numbers"),
            (("ball.obj", "--kind", "cones", "--eye", "1,x,2"), "'1,x,2' is no direction"),
            (("ball.obj", "--dpi", "9000"), "between 10 and 2400"),
            (("ball.obj", "--kind", "quality", "--colors", "no"), "no colour map 'no'"),
            (("uvless.npz",), "holds no UVs: 'uv' is missing"),
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

    def test_a_missing_matplotlib_is_said_before_the_work(self, run, monkeypatch):
        monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
        code, _, err = run("ball.obj")
        assert code == 2
        assert 'pip install "coneflat[figures]"' in err


@pytest.mark.parametrize("shown", [None, 3, np.eye(3), "layout"])
def test_what_is_no_result_has_no_figure(shown):
    with pytest.raises(OptionError, match="a figure shows what `coneflat.flatten` returns, not"):
        coneflat.make_figure(shown, "layout")
