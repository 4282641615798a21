"""From a mesh to quads: `coneflat.quads` and its command."""

from __future__ import annotations

import json

import numpy as np
import pytest
from click.testing import CliRunner
from grid_maps import RING, on_squares, polycube
from shapes import sphere, torus, write_obj

import coneflat
from coneflat import read_mesh
from coneflat.apps.cli.quads import quads as command
from coneflat.errors import GridError, OptionError
from coneflat.grid import IntegerGrid, measure_quads


@pytest.fixture(scope="module")
def ball():
    return sphere(3, bumps=0.2)


@pytest.fixture(scope="module")
def quads_of_ball(ball):
    return coneflat.quads(*ball, quads=600)


def test_a_ball(ball, quads_of_ball):
    mesh = quads_of_ball
    assert mesh.euler_characteristic == 2
    assert 400 < len(mesh.quads) < 900
    # Gauss-Bonnet of a quad mesh: what valences lack of 4 sums to 4 chi.
    assert (4 - mesh.valences).sum() == 8
    assert len(mesh.irregular) < 30
    assert (mesh.valences >= 3).all()
    # Quads cover the surface, and are oriented as it is.
    points = mesh.vertices[mesh.quads]
    volume = (np.cross(points[:, 0], points[:, 1]) * points[:, 2]).sum() / 6
    volume += (np.cross(points[:, 0], points[:, 2]) * points[:, 3]).sum() / 6
    corners = ball[0][ball[1]]
    assert volume == pytest.approx(
        (np.cross(corners[:, 0], corners[:, 1]) * corners[:, 2]).sum() / 6, rel=0.03
    )
    measures = measure_quads(mesh)
    assert measures.jacobian_min > 0
    assert measures.angle_mean < 10


def test_scale_does_not_matter(ball, quads_of_ball):
    # By a power of two nothing is rounded.
    other = coneflat.quads(ball[0] * 1024, ball[1], quads=600)
    np.testing.assert_array_equal(other.quads, quads_of_ball.quads)
    np.testing.assert_allclose(other.vertices, quads_of_ball.vertices * 1024, rtol=1e-12)


def test_size(ball):
    mesh = coneflat.quads(*torus(30, 16), size=0.2)
    assert mesh.euler_characteristic == 0
    assert measure_quads(mesh).edge_mean == pytest.approx(0.2, rel=0.25)


def test_a_grid_may_be_given():
    grid = on_squares(*polycube(RING), 4)
    unknown = dict.fromkeys(
        ("size", "move_rms", "move_max", "energy_before", "energy", "qc_before", "qc_mean"), 0.0
    )
    own = IntegerGrid(**vars(grid), **unknown, least_area=1.0, notes=("As given.",))
    mesh = coneflat.quads(own, smooth=0)
    assert len(mesh.quads) == 32 * 16
    assert mesh.notes == ("As given.",)
    with pytest.raises(OptionError, match="a grid has its"):
        coneflat.quads(own, quads=100)


def test_a_boundary_across_the_grid_is_told():
    vertices, faces = sphere(3, bumps=0.2)
    kept = vertices[faces].mean(axis=1)[:, 2] < 0.4
    mesh = coneflat.quads(vertices, faces[kept], quads=500)
    assert mesh.left_out > 0
    assert mesh.euler_characteristic == mesh.surface_euler == 1
    assert any(note.startswith(f"Left out {mesh.left_out} squares") for note in mesh.notes)


def test_command(tmp_path, ball):
    path = write_obj(tmp_path / "ball.obj", *ball)
    out, report = tmp_path / "quads.ply", tmp_path / "quads.json"
    run = CliRunner().invoke(
        command,
        [str(path), "-o", str(out), "--faces", "600", "--report", str(report)],
        catch_exceptions=False,
    )
    assert run.exit_code == 0, run.output
    told, mesh = json.loads(report.read_text()), read_mesh(out)
    assert (np.diff(mesh.offsets) == 4).all()
    assert told["quads"] == len(mesh.offsets) - 1
    assert told["vertices"] == len(mesh.vertices)
    assert f"{told['irregular']:,}" in run.output
    assert "Euler characteristic 2" in run.output


def test_command_refuses_before_the_work(tmp_path, ball):
    path = write_obj(tmp_path / "ball.obj", *ball)
    run = CliRunner().invoke(command, [str(path), "--faces", "600", "--size", "0.1"])
    assert run.exit_code == 2
    assert "leave one out" in run.output
    run = CliRunner().invoke(command, [str(path), "-o", str(tmp_path / "quads.stl")])
    assert "quads are written as .obj, .ply, .glb, .npz" in str(run.exception)
    run = CliRunner().invoke(command, [str(path), "-o", str(path)])
    assert "the input and the output" in str(run.exception)


def test_errors_are_of_the_package():
    assert issubclass(GridError, coneflat.ConeflatError)
