"""Meshes that are not quite one: repaired, closed or refused, by all commands alike."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
import shapes
from click.testing import CliRunner

import coneflat
from coneflat import MeshFile, check_mesh, errors
from coneflat.apps.cli.main import cli
from coneflat.io.join import join_borders
from coneflat.io.read import read_joined

TAKE_MESHES = ("flatten", "batch", "cones", "view", "figure", "measure")


def mesh_file(vertices, faces):
    offsets = np.arange(0, faces.size + 1, 3)
    return MeshFile("x.obj", np.asarray(vertices, float), faces.reshape(-1).copy(), offsets)


def triangles(joined):
    return joined.mesh.vertices, joined.mesh.corners.reshape(-1, 3)


def soup(vertices, faces):
    """Return every triangle with vertices of its own."""
    return vertices[faces.ravel()], np.arange(faces.size).reshape(-1, 3)


def fin():
    """Return a ball with a triangle that stands out of an edge."""
    vertices, faces = shapes.sphere(1)
    return np.r_[vertices, [[2, 2, 2]]], np.r_[faces, [[0, 12, len(vertices)]]]


def run(*words):
    return CliRunner().invoke(cli, [str(word) for word in words])


class TestJoining:
    def test_the_borders_of_a_triangle_soup_are_joined(self):
        vertices, faces = shapes.sphere(2)
        joined = join_borders(mesh_file(*soup(vertices, faces)))
        assert joined.edges == 3 * len(faces) // 2
        assert joined.left == 0
        mesh = check_mesh(*triangles(joined)).mesh
        assert len(mesh.vertices) == len(vertices)
        assert not mesh.is_boundary_edge.any()

    def test_closed_or_distant_borders_are_not_joined(self):
        for vertices, faces in (shapes.sphere(1), shapes.hill(4, 3)):
            mesh = mesh_file(vertices, faces)
            assert join_borders(mesh).mesh is mesh

    def test_three_sides_at_one_place_are_left_open_with_a_hint(self):
        vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 1], [0, -1, -1]], dtype=float)
        book = soup(vertices, np.array([[0, 1, 2], [1, 0, 3], [1, 0, 4]]))
        joined = join_borders(mesh_file(*book))
        assert (joined.edges, joined.left) == (0, 3)
        assert "3 open edges at the same positions as others, left open; --weld" in joined.notes()[0]

    @pytest.mark.slow
    def test_joining_keeps_a_mesh_manifold(self):
        """Triangles between few places, and two parts of a ball with vertices of their own and a few holes."""
        random = np.random.default_rng(7)
        ball, faces = shapes.sphere(1)
        closed = 0
        for case in range(400):
            if case % 2:
                points = random.integers(0, 3, size=(random.integers(4, 30), 3)).astype(float)
                chosen = np.array(
                    [random.choice(len(points), 3, replace=False) for _ in range(random.integers(1, 9))]
                )
            else:
                side = ball[faces].mean(axis=1) @ random.normal(size=3) > random.normal() / 2
                points, chosen = shapes.join((ball, faces[side]), (ball, faces[~side]))
                chosen = chosen[random.random(len(faces)) < 0.99]
            try:
                before = check_mesh(points, chosen)
            except errors.MeshError:
                continue
            joined = join_borders(mesh_file(points, chosen))
            after = check_mesh(*triangles(joined))
            assert after.mesh.is_boundary_edge.sum() == before.mesh.is_boundary_edge.sum() - 2 * joined.edges
            closed += joined.edges > 0
        assert closed > 50

    def test_patches_of_a_file_become_one_chart(self, tmp_path, monkeypatch):
        """A ball in four pieces with borders of their own: the file's own making, and no seams of anybody."""
        monkeypatch.chdir(tmp_path)
        vertices, faces = shapes.sphere(2)
        piece = (vertices[faces].mean(axis=1)[:, :2] > 0) @ [1, 2]
        parts = [(vertices, faces[piece == k]) for k in range(4)]
        shapes.write_obj(tmp_path / "pieces.obj", *shapes.join(*parts))
        done = run("flatten", "pieces.obj", "-o", "a.obj", "--report", "a.json")
        assert done.exit_code == 0, done.output
        report = json.loads((tmp_path / "a.json").read_text())
        assert report["notes"][0].startswith("Closed ")
        assert "note: Closed " in done.stdout
        done = run("flatten", "pieces.obj", "-q", "-o", "b.obj", "--report", "b.json", "--no-weld")
        apart = json.loads((tmp_path / "b.json").read_text())
        assert apart["charts"] == 4 > report["charts"]
        assert apart["seam_length"] < report["seam_length"]

    def test_vertices_are_named_as_in_the_file(self, tmp_path, monkeypatch):
        """Also where another one is used for them."""
        monkeypatch.chdir(tmp_path)
        vertices, faces = soup(*shapes.sphere(1))
        path = shapes.write_obj(tmp_path / "soup.obj", vertices, faces)
        representative = read_joined(path).representative
        merged = np.flatnonzero(representative != np.arange(len(representative)))
        words = [word for v in merged[[5, 40, 80]] for word in ("--required-cones", v)]
        done = run("flatten", path, "-q", "-o", "a.obj", "--report", "a.json", *words)
        assert done.exit_code == 0, done.output
        report = json.loads((tmp_path / "a.json").read_text())
        assert set(representative[merged[[5, 40, 80]]].tolist()) <= set(report["cone_vertices"])
        vertex = int(merged[0])
        done = run("flatten", path, "--cones", f"{vertex},{int(representative[vertex])},7")
        assert "have the same position" in str(done.exception)


class TestRepair:
    @pytest.mark.parametrize(
        ("command", "arguments"),
        [
            ("flatten", ["-o", "out.obj"]),
            ("cones", ["-o", "out.txt"]),
            ("view", ["-o", "out.html"]),
            ("figure", ["-o", "out.png", "--dpi", "50"]),
            ("figure", ["--kind", "curve", "-o", "out.png", "--dpi", "50", "--most", "6"]),
        ],
    )
    def test_commands_repair_with_a_note_and_refuse_if_strict(
        self, tmp_path, monkeypatch, command, arguments
    ):
        if command == "figure":
            pytest.importorskip("matplotlib")
        monkeypatch.chdir(tmp_path)
        shapes.write_obj(tmp_path / "fin.obj", *fin())
        done = run(command, "fin.obj", *arguments)
        assert done.exit_code == 0, done.output
        if command in ("flatten", "view"):
            assert "note: Separated the faces at 1 edge with more than two." in done.stdout
        done = run(command, "fin.obj", "--strict", *arguments)
        assert isinstance(done.exception, errors.NonManifoldError)


def test_every_command_that_reads_meshes_takes_the_same_options():
    declared = []
    for name in TAKE_MESHES:
        options = {
            option: param
            for param in cli.commands[name].params
            for option in param.opts + param.secondary_opts
        }
        shared_options = [options.get(option) for option in ("--repair", "--strict", "--weld", "--no-weld")]
        assert all(shared_options), name
        declared.append([parameter.help for parameter in shared_options])
    assert all(parameter == declared[0] for parameter in declared)


class TestOwnUVs:
    @pytest.fixture
    def square(self, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        vertices, faces = shapes.hill(6, 5)
        return shapes.write_obj(tmp_path / "own.obj", vertices, faces, uv=0.5 * vertices[:, :2])

    @pytest.mark.parametrize(("command", "ending"), [("view", "html"), ("figure", "png")])
    def test_uvs_of_a_file_are_shown_with_a_note(self, square, command, ending):
        if command == "figure":
            pytest.importorskip("matplotlib")
        done = run(command, square, "-o", f"a.{ending}")
        assert "note: The UVs of own.obj are shown; --again" in done.stdout
        done = run(command, square, "-o", f"b.{ending}", "--again")
        assert done.exit_code == 0
        assert "are shown; --again" not in done.stdout

    @pytest.mark.slow
    def test_a_page_shows_the_map_for_a_texture_instead(self, square):
        done = run("view", square, "-o", "a.html", "--unwrap")
        assert done.exit_code == 0, done.output
        energy = coneflat.unwrap(square).distortion.energy
        assert re.search(rf"^energy +{energy:.4f} ", done.stdout, re.MULTILINE)
        assert "are shown; --again" not in done.stdout
        coneflat.unwrap(square).save("own.npz")
        assert run("view", "own.npz", "-o", "b.html").exit_code == 0
        done = run("view", "own.npz", "-o", "b.html", "--unwrap")
        assert done.exit_code == 2
        assert "--unwrap needs a mesh, and own.npz is a result" in done.output

    def test_uvs_of_a_page_are_those_of_the_file(self, square):
        from coneflat.apps.view.from_uv import own_flattening
        from coneflat.io.read import read_joined

        shown = own_flattening(read_joined(square))
        vertices, _ = shapes.hill(6, 5)
        np.testing.assert_array_equal(shown.corner_uv, 0.5 * vertices[shown.faces][..., :2])
        assert len(shown.seams) == 0
        assert shown.distortion.qc_mean == coneflat.measure_uv(square).distortion.qc_mean
        # Without seams the plane is flat inside.
        inside = np.ones(len(shown.vertices), dtype=bool)
        inside[coneflat.TriangleMesh(shown.vertices, shown.faces).is_boundary_vertex] = False
        assert np.abs(shown.curvature_residual[inside]).max() < 1e-12


def test_several_meshes_hint_at_batch():
    done = run("flatten", "a.obj", "b.obj", "c.obj")
    assert done.exit_code == 2
    assert "expected one mesh, got 3: `coneflat batch a.obj b.obj ..." in done.output


@pytest.mark.parametrize("command", ["view", "figure"])
def test_uvs_beyond_what_can_be_shown_are_refused_in_a_line(command, tmp_path):
    path = tmp_path / "far.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1e300 0\nvt 0 1e300\nf 1/1 2/2 3/3\n")
    output = tmp_path / ("out.html" if command == "view" else "out.png")
    done = run(command, path, "-o", output)
    assert isinstance(done.exception, errors.MeshFileError)
    assert "UVs of up to 1e+300 are too large to be shown" in str(done.exception)
    assert not output.exists()
