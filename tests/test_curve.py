from __future__ import annotations

import numpy as np
import pytest
import shapes
from click.testing import CliRunner

import coneflat
from coneflat.apps.cli.main import cli
from coneflat.curves import whole_curve
from coneflat.errors import OptionError
from coneflat.options import Options


def test_the_curve_decreases_and_flatten_attains_it():
    vertices, faces = shapes.genus(1)
    curve = coneflat.cone_curve(vertices, faces, most=10)
    assert (np.diff(curve.counts) > 0).all()
    assert (np.diff(curve.distortions) < 0).all()
    assert curve.counts[-1] <= 10
    assert curve.counts[0] <= curve.knee <= curve.counts[-1]
    chosen = curve.sets[-1]
    result = coneflat.flatten(
        vertices, faces, cones=dict(zip(chosen.vertices, chosen.curvatures, strict=True))
    )
    assert result.solve.area_distortion_linear == pytest.approx(chosen.distortion, rel=1e-3)


def test_a_search_for_one_number_is_not_much_better():
    vertices, faces = shapes.sphere(3)
    curve = coneflat.cone_curve(vertices, faces, most=8)
    for cones in curve.sets:
        alone = coneflat.find_cones(vertices, faces, cone_count=len(cones.vertices))
        assert cones.distortion <= alone.distortion * 1.1


def test_cones_are_those_of_flatten():
    vertices, faces = shapes.sphere(3)
    cones = coneflat.find_cones(vertices, faces, distortion=0.1)
    np.testing.assert_array_equal(coneflat.flatten(vertices, faces, distortion=0.1).cones, cones.vertices)
    assert cones.distortion <= 0.1


@pytest.mark.parametrize("limit", [0, 2.5, True, "5", np.arange(3), float("nan"), None])
def test_invalid_numbers_are_errors(limit):
    with pytest.raises(OptionError, match="most must be an? (integer|number)"):
        coneflat.cone_curve(*shapes.sphere(2), most=limit)


def test_too_few_cones_are_an_error():
    with pytest.raises(OptionError, match="up to 2 cones"):
        coneflat.cone_curve(*shapes.sphere(2), most=2)


@pytest.fixture
def model(tmp_path):
    vertices, faces = shapes.sphere(3)
    return shapes.write_obj(tmp_path / "ball.obj", vertices * [1, 1, 1.5], faces)


def test_the_command_writes_cones_that_flatten_reads(model, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(cli, ["cones", str(model), "--distortion", "0.1", "-o", "ball.cones"])
    assert done.exit_code == 0, done.output
    assert "area distortion 0.0" in done.output
    again = CliRunner().invoke(cli, ["flatten", str(model), "--cones", "ball.cones", "-q"])
    assert again.exit_code == 0, again.output


def test_the_command_draws_the_curve(model, tmp_path, monkeypatch):
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(cli, ["cones", str(model), "--curve", "--most", "6"])
    assert done.exit_code == 0, done.output
    assert "knee" in done.output
    assert (tmp_path / "ball_cones.png").read_bytes().startswith(b"\x89PNG")


class TestWhole:
    """The curve of all parts of a mesh together."""

    def test_one_component_has_the_curve_of_the_component(self):
        mesh = shapes.sphere(2)
        mesh_curve, component_curve = whole_curve(mesh, Options(), 6), coneflat.cone_curve(*mesh, most=6)
        assert mesh_curve.parts == 1
        np.testing.assert_array_equal(mesh_curve.counts, component_curve.counts)
        np.testing.assert_allclose(mesh_curve.distortions, component_curve.distortions, rtol=1e-12)
        assert mesh_curve.knee == component_curve.knee

    def test_components_combine_by_area(self):
        """A ball beside a hill, which needs no cones: at each number those of both count, by area."""
        ball, hill = shapes.sphere(3), shapes.hill(10, 8)
        vertices, faces = shapes.join((3 * ball[0] * [1, 1, 1.4], ball[1]), (hill[0] + 20, hill[1]))
        mesh_curve = whole_curve((vertices, faces), Options(), 9)
        assert mesh_curve.parts == 2
        assert (np.diff(mesh_curve.distortions) < 0).all()
        alone = [
            coneflat.cone_curve(*component, most=9)
            for component in ((3 * ball[0] * [1, 1, 1.4], ball[1]), hill)
        ]
        # A closed surface has no cones fewer than carry its curvature, whatever the other part could do with.
        assert mesh_curve.counts[0] == max(curve.counts[0] for curve in alone)
        assert set(mesh_curve.counts.tolist()) <= set(alone[0].counts.tolist()) | set(
            alone[1].counts.tolist()
        )
        for count in mesh_curve.counts[[0, -1]].tolist():
            result = coneflat.flatten(vertices, faces, cone_count=count)
            at = mesh_curve.distortions[mesh_curve.counts.tolist().index(count)]
            assert result.solve.area_distortion_linear == pytest.approx(at, rel=0.1)

    def test_regions_between_seams_are_parts(self):
        """A ball that is cut along its equator is two disks, which need no cones."""
        vertices, faces = shapes.sphere(3)
        mesh = coneflat.TriangleMesh(vertices, faces)
        low = vertices[:, 2] < -0.01
        rim = mesh.edges[~low[mesh.edges].any(axis=1)]
        below = np.isin(np.arange(len(vertices)), faces[low[faces].any(axis=1)]) & ~low
        seams = rim[below[rim].all(axis=1)]
        mesh_curve = whole_curve((vertices, faces), Options(seams=seams), 6)
        assert mesh_curve.parts == 2
        assert mesh_curve.counts[0] == 0
