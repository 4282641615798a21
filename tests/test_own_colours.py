"""Numbers of the user's own as colours: in pages, figures, the studio and Python."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
import shapes
from browsing import Visit
from click.testing import CliRunner

import coneflat
from coneflat.apps.cli.main import cli
from coneflat.apps.studio.session import Session
from coneflat.errors import MeshFileError, OptionError
from coneflat.view.own import own_quantity
from coneflat.view.page.content import content_of


def write_ply(path, vertices, faces, heat):
    head = ["ply", "format ascii 1.0", f"element vertex {len(vertices)}"]
    head += [f"property double {name}" for name in ("x", "y", "z", "heat")]
    head += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    rows = [
        " ".join(map(repr, [*point, value]))
        for point, value in zip(vertices.tolist(), heat.tolist(), strict=True)
    ]
    path.write_text("\n".join([*head, *rows, *(f"3 {a} {b} {c}" for a, b, c in faces.tolist())]) + "\n")
    return path


@pytest.fixture
def ball(tmp_path):
    """A mesh with heat at its vertices, of which some are of no face."""
    vertices, faces = shapes.sphere(2)
    vertices = np.concatenate([np.full((3, 3), 9.0), vertices])
    return write_ply(tmp_path / "ball.ply", vertices, faces + 3, np.append([1e9] * 3, vertices[3:, 2]))


class TestQuantity:
    def test_a_property_follows_its_vertices(self, ball):
        result = coneflat.flatten(ball)
        own = own_quantity(result, "heat")
        used = np.unique(result.faces)
        np.testing.assert_array_equal(own.values[used], result.vertices[used, 2])
        assert own.label == "heat"
        assert own.scale.high < 2  # Vertices of no face do not count.
        # Both signs: the middle of the scale is 0.
        assert own.scale.low == -own.scale.high

    def test_what_a_refinement_adds_has_none(self, tmp_path):
        vertices, faces = shapes.hill(10, 3)
        ramp = write_ply(tmp_path / "ramp.ply", vertices, faces, vertices[:, 0])
        result = coneflat.flatten(ramp, refine=True)
        own = own_quantity(result, "heat")
        is_new = result.vertex_origin < 0
        assert 0 < is_new.sum() < len(is_new)
        np.testing.assert_array_equal(own.values[~is_new], result.vertices[~is_new, 0])
        assert np.isnan(own.values[is_new]).all()

    def test_arrays_of_files(self, ball, tmp_path):
        result = coneflat.flatten(ball)
        middles = result.vertices[result.faces].mean(axis=1)
        np.save(tmp_path / "f.npy", middles[:, 0] ** 2)
        np.savez(tmp_path / "m.npz", one=np.arange(len(result.vertices)))
        own = own_quantity(result, str(tmp_path / "f.npy"))
        assert own.corners is None
        assert own.scale.low >= 0
        by_vertex = own_quantity(result, f"{tmp_path / 'm.npz'}:one")
        assert by_vertex.label == "one"
        np.testing.assert_array_equal(by_vertex.values, np.arange(len(result.vertices)))

    def test_the_scale_leaves_single_ones_aside(self, ball, tmp_path):
        result = coneflat.flatten(ball)
        values = np.linspace(1, 2, len(result.vertices))
        values[[5, 6]] = 1e6, np.inf
        np.save(tmp_path / "v.npy", values)
        own = own_quantity(result, str(tmp_path / "v.npy"))
        assert 1 <= own.scale.low < 1.1
        assert 1.9 < own.scale.high < 2.1
        assert np.isnan(own.values[6])
        np.save(tmp_path / "v.npy", np.full(len(result.vertices), 4))
        assert own_quantity(result, str(tmp_path / "v.npy")).scale.position(np.array([4.0])) == 0.5

    @pytest.mark.parametrize(
        ("values", "message"),
        [
            (np.arange(7), "has 7 numbers, which fits neither the 165 vertices nor the 320 triangles"),
            (np.zeros((165, 3)), "not of an array of shape"),
            (np.full(165, np.nan), "no finite number"),
            (np.array(["a"] * 165), "not of an array of shape"),
        ],
    )
    def test_what_fits_nothing(self, ball, tmp_path, values, message):
        np.save(tmp_path / "v.npy", values)
        with pytest.raises(OptionError, match=message):
            own_quantity(coneflat.flatten(ball), str(tmp_path / "v.npy"))

    def test_what_is_not_there(self, ball, tmp_path):
        result = coneflat.flatten(ball)
        np.savez(tmp_path / "m.npz", one=np.zeros(3))
        with pytest.raises(
            OptionError, match="no property 'cold' at its vertices to take colours from; it has heat"
        ):
            own_quantity(result, "cold")
        with pytest.raises(OptionError, match="has no array 'two': it has one"):
            own_quantity(result, f"{tmp_path / 'm.npz'}:two")
        with pytest.raises(MeshFileError, match="cannot read numbers from"):
            own_quantity(result, "nowhere.npy")


class TestCommands:
    def run(self, *words):
        return CliRunner().invoke(cli, [str(word) for word in words])

    def test_a_page(self, ball, tmp_path):
        page = tmp_path / "p.html"
        assert self.run("view", ball, "--color", "heat", "-o", page).exit_code == 0
        assert '"title":"heat"' in page.read_text()
        assert re.search(r'"show":"own"', page.read_text())
        coneflat.flatten(ball).view(page, color="heat", show="qc")
        assert re.search(r'"show":"qc"', page.read_text())
        assert self.run("view", ball, "-o", page).exit_code == 0
        assert '"own":null' in page.read_text()

    def test_an_array_of_a_result(self, ball, tmp_path):
        result = coneflat.flatten(ball)
        result.save(tmp_path / "r.npz")
        with np.load(tmp_path / "r.npz") as kept:
            np.savez(tmp_path / "more.npz", **kept, stress=np.arange(len(result.faces)))
        done = self.run("view", tmp_path / "more.npz", "--color", "stress", "-o", tmp_path / "p.html")
        assert done.exit_code == 0, done.output
        assert '"own":"faces"' in (tmp_path / "p.html").read_text()

    def test_figures(self, ball, tmp_path):
        pytest.importorskip("matplotlib")
        done = self.run("figure", ball, "--color", "heat", "-o", tmp_path / "f.svg", "--dpi", "50")
        assert done.exit_code == 0, done.output
        assert "<!-- heat -->" in (tmp_path / "f.svg").read_text()
        done = self.run("figure", ball, "--kind", "color", "-o", tmp_path / "f.svg")
        assert "--kind color needs --color" in done.output
        done = self.run("figure", ball, "--kind", "cones", "--color", "heat", "-o", tmp_path / "f.svg")
        assert "--kind cones takes no --color" in done.output
        done = self.run("figure", ball, "--color", "cold", "-o", tmp_path / "g.png")
        assert "no property 'cold'" in str(done.exception)
        assert not (tmp_path / "g.png").exists()

    def test_the_studio(self, ball, tmp_path):
        for color, said in (("heat", None), ("cold", "no property 'cold'")):
            session = Session(tmp_path, color)
            try:
                session.open(ball)
                assert session.wait_until_idle(120)
                head, _ = session.picture()
                assert head["own"] == (None if said else "vertices")
                trouble = session.state()["trouble"]
                assert trouble is None if said is None else said in trouble["text"]
            finally:
                session.close()


def test_they_are_shown_in_the_page(browser, ball, tmp_path):
    result = coneflat.flatten(ball)
    page = result.view(tmp_path / "page.html", color="heat")
    visit = Visit(browser, page)
    assert visit.state("show") == "own"
    assert visit.page.inner_text("#scale-title") == "heat"
    assert visit.page.locator("#show option").last.inner_text() == "heat"
    content = content_of(result, 10**6, own=own_quantity(result, "heat"))
    shown = np.array(visit.run("Array.from(coneflat.model.arrays.own)"))
    np.testing.assert_allclose(shown, content.own, rtol=1e-6)
    colours = visit.picture("model")
    visit.page.keyboard.press("8")
    assert visit.state("show") == "plain"
    assert (np.abs(visit.picture("model") - colours).max(axis=2) > 30).mean() > 0.1
    visit.page.keyboard.press("9")
    assert visit.state("show") == "own"
    box = visit.box("model")
    visit.run("coneflat.state.set({seams: false, cones: false})")
    visit.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    visit.rest()
    facts = visit.page.inner_text("#facts")
    assert "heat" in facts
    mark = visit.run("coneflat.state.get('hovered').index")
    corners = result.vertices[result.faces[mark], 2]
    said = [float(word) for word in re.search(r"heat ([-\d., ]+)", facts)[1].split(",")]
    np.testing.assert_allclose(said, corners, rtol=1e-3, atol=1e-4)
    visit.close()


def test_without_them_there_is_no_such_entry(viewed_page):
    text = viewed_page.read_text()
    head = json.loads(re.search(r"<script[^>]*application/json[^>]*>(.*?)</script>", text, re.S)[1])
    assert "own" not in head["scales"]


@pytest.mark.parametrize(
    "wrong", [{"color": {0: 1.0}}, {"color": 3}, {"show": np.zeros((2, 3))}, {"show": 7}]
)
def test_what_names_no_colours_is_refused(tmp_path, wrong):
    result = coneflat.flatten(*shapes.sphere(1))
    with pytest.raises(OptionError):
        result.view(tmp_path / "page.html", **wrong)
    assert not (tmp_path / "page.html").exists()
