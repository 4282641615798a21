"""From a mesh to quads: `coneflat.quads` and its command."""

from __future__ import annotations

import inspect
import json

import numpy as np
import pytest
from click.testing import CliRunner
from grid_maps import RING, on_squares, polycube
from shapes import hill, sphere, torus, write_obj

import coneflat
from coneflat import QuadMesh, read_mesh
from coneflat.apps.cli.quads import quads as command
from coneflat.errors import ConeflatError, GridError, OptionError
from coneflat.grid import IntegerGrid, measure_quads
from coneflat.grid.integer_grid import OPTIONS
from coneflat.options import Options, QuadOptions, declarations


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
    mesh = coneflat.quads(vertices, faces[kept], quads=500, boundary="free")
    assert mesh.left_out > 0
    assert mesh.euler_characteristic == mesh.surface_euler == 1
    assert any(note.startswith(f"Left out {mesh.left_out} squares") for note in mesh.notes)


def test_command(tmp_path, ball):
    path = write_obj(tmp_path / "ball.obj", *ball)
    out, report = tmp_path / "quads.ply", tmp_path / "quads.json"
    done = run(path, "-o", out, "--faces", 600, "--report", report)
    assert done.exit_code == 0, done.output
    told, mesh = json.loads(report.read_text()), read_mesh(out)
    assert (np.diff(mesh.offsets) == 4).all()
    assert told["quads"] == len(mesh.offsets) - 1
    assert told["vertices"] == len(mesh.vertices)
    assert f"{told['irregular']:,}" in done.output
    assert "Euler characteristic 2" in done.output


def test_command_refuses_before_the_work(tmp_path, ball):
    path = write_obj(tmp_path / "ball.obj", *ball)
    done = run(path, "--faces", 600, "--size", 0.1)
    assert done.exit_code == 2
    assert "give one" in done.output
    for words, message in (
        (("-o", tmp_path / "quads.stl"), "quads are written as .obj, .ply, .glb, .npz"),
        (("-o", path), "the input and the output"),
        (("--grid", tmp_path / "grid.ply"), "integer grids are written as .obj, .npz"),
        (("--grid", path), "the input and the grid"),
        (("--smooth", -1), "smooth cannot be negative"),
        (("--stretch", 2), "stretch must be a number from 0 to 1"),
    ):
        with pytest.raises(ConeflatError, match=message):
            run(path, *words)


def run(*words):
    return CliRunner().invoke(command, [str(word) for word in words], catch_exceptions=False)


def test_the_grid_is_written_and_made_into_the_same_quads(tmp_path, ball, quads_of_ball):
    path = write_obj(tmp_path / "ball.obj", *ball)
    npz, obj = tmp_path / "grid.npz", tmp_path / "grid.obj"
    both = tmp_path / "both.npz"
    done = run(path, "--quads", 600, "--grid", npz, "--report", tmp_path / "grid.json")
    assert done.exit_code == 0, done.output
    # Without -o there is a grid alone.
    assert sorted(each.name for each in tmp_path.iterdir()) == ["ball.obj", "grid.json", "grid.npz"]
    told = json.loads((tmp_path / "grid.json").read_text())
    assert "quads" not in told
    assert told["grid"]["size"] == IntegerGrid.load(npz).size
    assert list(told["seconds"]) == ["read", "flatten", "grid", "write"]
    assert run(npz, "-o", both, "--grid", obj).exit_code == 0
    np.testing.assert_array_equal(IntegerGrid.load(obj).turns, IntegerGrid.load(npz).turns)
    again = QuadMesh.load(both)
    np.testing.assert_array_equal(again.quads, quads_of_ball.quads)
    np.testing.assert_array_equal(again.vertices, quads_of_ball.vertices)
    refused = run(npz, "--quads", 5)
    assert refused.exit_code == 2
    assert "is a grid: leave out --quads" in refused.output


def test_repairs_are_told(tmp_path):
    # A face the other way round, and a vertex of no face.
    vertices, faces = sphere(3)
    turned = faces.copy()
    turned[5] = turned[5, ::-1]
    path = write_obj(tmp_path / "ball.obj", np.concatenate([vertices, [[9.0, 9, 9]]]), turned)
    done = run(path, "-o", tmp_path / "q.npz", "--quads", 300)
    assert "note: Turned 1 face to agree with the rest." in done.output
    assert "note: Left out 1 vertex without a face." in done.output
    assert "Turned 1 face to agree with the rest." in QuadMesh.load(tmp_path / "q.npz").notes


def test_squares_left_out_are_told_of_files_that_are_joined(tmp_path):
    # Two halves of a cap, each with vertices of its own along the line where they meet.
    vertices, faces = sphere(3, bumps=0.2)
    middles = vertices[faces].mean(axis=1)
    faces = faces[middles[:, 2] < 0.4]
    half = vertices[faces].mean(axis=1)[:, 0] < 0
    both = np.concatenate([faces[half], faces[~half] + len(vertices)])
    path = write_obj(tmp_path / "cap.obj", np.concatenate([vertices, vertices]), both)
    done = run(path, "-o", tmp_path / "q.npz", "--quads", 500, "--boundary", "free")
    assert "note: Closed" in done.output
    assert f"note: Left out {QuadMesh.load(tmp_path / 'q.npz').left_out} squares" in done.output


def test_the_report_has_all_measures(tmp_path, ball, quads_of_ball):
    path = write_obj(tmp_path / "ball.obj", *ball)
    done = run(path, "-o", tmp_path / "q.glb", "--quads", 600, "--report", tmp_path / "q.json")
    told = json.loads((tmp_path / "q.json").read_text())
    measures = json.loads(json.dumps(measure_quads(quads_of_ball).report()))
    assert {name: told[name] for name in measures} == measures
    assert told["euler_characteristic"] == told["surface_euler"] == 2
    assert told["hausdorff"] == max(told["to_surface"], told["from_surface"]) > 0
    stages = ["read", "flatten", "grid", "extract", "smooth", "measure", "write"]
    assert list(told["seconds"]) == stages
    assert all(seconds >= 0 for seconds in told["seconds"].values())
    assert "as the surface" in done.output


def test_options_of_the_search(tmp_path, ball):
    path = write_obj(tmp_path / "ball.obj", *ball)
    out = tmp_path / "q.npz"
    few = run(path, "-o", out, "--quads", 600, "--cone-count", 8, "--required-cones", "7,300", "--smooth", 0)
    assert few.exit_code == 0, few.output
    mesh = QuadMesh.load(out)
    # Eight cones of three quads each, two of them where they are asked for.
    assert mesh.valences[mesh.irregular].tolist() == [3] * 8
    places = mesh.vertices[mesh.irregular]
    for vertex in (7, 300):
        assert np.linalg.norm(places - ball[0][vertex], axis=1).min() < 1e-12
    sharp = run(
        path, "-o", out, "--quads", 600, "--cone-count", 4, "--min-cone-angle", "pi", "--positive-only"
    )
    assert sharp.exit_code == 0, sharp.output
    mesh = QuadMesh.load(out)
    assert mesh.valences[mesh.irregular].tolist() == [2] * 4
    refused = run(path, "--cone-count", 8, "--max-cones", 9)
    assert refused.exit_code == 2
    assert "leave out --max-cones" in refused.output


def test_cones_that_are_given(tmp_path):
    vertices, faces = sphere(3)
    path = write_obj(tmp_path / "ball.obj", vertices, faces)
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / np.sqrt(3)
    near = [int(np.linalg.norm(vertices - corner, axis=1).argmin()) for corner in corners]
    words = ",".join(f"{vertex}:pi/2" for vertex in near)
    done = run(path, "-o", tmp_path / "q.npz", "--quads", 600, "--cones", words, "--smooth", 0)
    assert done.exit_code == 0, done.output
    mesh = QuadMesh.load(tmp_path / "q.npz")
    assert mesh.valences[mesh.irregular].tolist() == [3] * 8
    # They lie where they are asked for, to rounding: extraction has them at corners of triangles.
    apart = np.linalg.norm(mesh.vertices[mesh.irregular][:, None] - vertices[near], axis=2)
    assert (apart.min(axis=0) < 1e-12).all()
    refused = run(path, "--cones", words, "--max-cones", 9)
    assert "with cones given there is nothing to search: leave out --max-cones" in refused.output
    for curvatures, what in ((None, "not given"), (1.0, "is 1")):
        cones = near if curvatures is None else dict.fromkeys(near, curvatures)
        with pytest.raises(
            OptionError, match=f"multiples of pi/2; that of vertex {near[0]} is.*{what.split()[-1]}"
        ):
            coneflat.quads(vertices, faces, cones=cones)


def test_a_straight_boundary_loses_nothing(tmp_path):
    path = write_obj(tmp_path / "hill.obj", *hill())
    done = run(path, "-o", tmp_path / "q.npz", "--quads", 300, "--boundary", "straight")
    assert done.exit_code == 0, done.output
    mesh = QuadMesh.load(tmp_path / "q.npz")
    assert mesh.left_out == 0
    # Along the boundary: one quad at corners, two elsewhere.
    corners = mesh.valences[mesh.is_boundary_vertex] == 2
    assert corners.sum() == 4


def test_defaults_are_those_that_are_declared():
    declared = {name: each.default for name, (each, _) in declarations(QuadOptions).items()}
    for function, names in (
        (coneflat.quads, ("quads", "size", "coarsest", "stretch", "smooth", "sharp_angle")),
        (coneflat.integer_grid, ("coarsest", "stretch", "sharp_angle")),
    ):
        parameters = inspect.signature(function).parameters
        for name in names:
            assert parameters[name].default == declared[name]
    assert OPTIONS["min_cone_angle"] == declared["min_cone_angle"]
    assert OPTIONS["max_cone_angle"] == declared["max_cone_angle"]
    # What is not of the grid's own is an option of a flattening.
    own = {"quads", "size", "coarsest", "stretch", "smooth"}
    assert set(declared) - own <= set(declarations(Options))


def test_errors_are_of_the_package():
    assert issubclass(GridError, coneflat.ConeflatError)
