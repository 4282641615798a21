"""Numbers of the user's own as colours: in pages, figures, the studio and Python."""

from __future__ import annotations

import re

import numpy as np
import pytest
import shapes
from click.testing import CliRunner

import coneflat
from coneflat.apps.cli.main import cli
from coneflat.apps.view.quantity import own_quantity
from coneflat.errors import MeshFileError, OptionError


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
        quantity = own_quantity(result, "heat")
        vertices_of_faces = np.unique(result.faces)
        np.testing.assert_array_equal(
            quantity.values[vertices_of_faces], result.vertices[vertices_of_faces, 2]
        )
        assert quantity.label == "heat"
        assert quantity.scale.high < 2  # Vertices of no face do not count.
        # Both signs: the middle of the scale is 0.
        assert quantity.scale.low == -quantity.scale.high

    def test_arrays_of_files(self, ball, tmp_path):
        result = coneflat.flatten(ball)
        middles = result.vertices[result.faces].mean(axis=1)
        np.save(tmp_path / "f.npy", middles[:, 0] ** 2)
        np.savez(tmp_path / "m.npz", one=np.arange(len(result.vertices)))
        quantity = own_quantity(result, str(tmp_path / "f.npy"))
        assert quantity.corners is None
        assert quantity.scale.low >= 0
        by_vertex = own_quantity(result, f"{tmp_path / 'm.npz'}:one")
        assert by_vertex.label == "one"
        np.testing.assert_array_equal(by_vertex.values, np.arange(len(result.vertices)))

    @pytest.mark.parametrize(
        ("values", "message"),
        [
            (np.arange(7), "has 7 numbers, but there are 165 vertices and 320 triangles"),
            (np.zeros((165, 3)), "got an array of shape"),
            (np.full(165, np.nan), "no finite number"),
            (np.array(["a"] * 165), "got an array of shape"),
        ],
    )
    def test_arrays_of_wrong_length_are_refused(self, ball, tmp_path, values, message):
        np.save(tmp_path / "v.npy", values)
        with pytest.raises(OptionError, match=message):
            own_quantity(coneflat.flatten(ball), str(tmp_path / "v.npy"))

    def test_missing_properties_and_files_are_named(self, ball, tmp_path):
        result = coneflat.flatten(ball)
        np.savez(tmp_path / "m.npz", one=np.zeros(3))
        with pytest.raises(OptionError, match="no vertex property 'cold'; it has heat"):
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

    def test_figures(self, ball, tmp_path):
        pytest.importorskip("matplotlib")
        done = self.run("figure", ball, "--color", "heat", "-o", tmp_path / "f.svg", "--dpi", "50")
        assert done.exit_code == 0, done.output
        assert "<!-- heat -->" in (tmp_path / "f.svg").read_text()
        done = self.run("figure", ball, "--kind", "color", "-o", tmp_path / "f.svg")
        assert "--kind color needs --color" in done.output
        done = self.run("figure", ball, "--kind", "cones", "--color", "heat", "-o", tmp_path / "f.svg")
        assert "--color has no effect with --kind cones" in done.output
        done = self.run("figure", ball, "--color", "cold", "-o", tmp_path / "g.png")
        assert "no vertex property 'cold'" in str(done.exception)
        assert not (tmp_path / "g.png").exists()
