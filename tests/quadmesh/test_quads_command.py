"""From a mesh to quads: `coneflat.quads`, its command, and what quads are used for."""

from __future__ import annotations

import json
from importlib import import_module

import numpy as np
import pytest
import shapes
from click.testing import CliRunner
from grid_maps import RING, on_squares, polycube, quad_areas
from shapes import sphere, write_obj

import coneflat
from coneflat import IntegerGrid, QuadMesh, measure_quads
from coneflat.apps.cli.quads_command import quads as command
from coneflat.errors import CoarseGridError, ConeflatError, OptionError


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


def test_quads_of_a_grid():
    grid = on_squares(*polycube(RING), 4)
    stored = IntegerGrid(**vars(grid), size=0.0, notes=("As given.",))
    mesh = coneflat.quads(stored, smooth=0)
    assert len(mesh.quads) == 32 * 16
    assert mesh.notes == ("As given.",)
    with pytest.raises(OptionError, match="a grid already has"):
        coneflat.quads(stored, quads=100)


@pytest.mark.parametrize("smooth", [-1, 1.5, None, "x"])
def test_rounds_of_smoothing_are_checked_before_the_work(smooth):
    for mesh in ("missing.obj", on_squares(*polycube(RING), 4)):
        with pytest.raises(OptionError, match="smooth must be"):
            coneflat.quads(mesh, smooth=smooth)


@pytest.mark.parametrize("options", [{"cones": "sparse"}, {"size": "curvature"}])
def test_the_mesh_is_read_and_checked_once(tmp_path, monkeypatch, ball, options):
    path, calls = write_obj(tmp_path / "ball.obj", *ball), []

    def counted(name, function):
        return lambda *arguments, **options: (calls.append(name), function(*arguments, **options))[1]

    for module, name in (
        ("io.packages", "triangulate"),
        ("io.packages", "read_mesh"),
        ("source.preparation", "check_mesh"),
    ):
        module = import_module(f"coneflat.{module}")
        monkeypatch.setattr(module, name, counted(name, getattr(module, name)))
    coneflat.quads(str(path), quads=300, **options)
    # The mesh that is flattened for aligned cones is another one.
    assert calls == ["read_mesh", "triangulate", "check_mesh", *["check_mesh"] * ("size" in options)]


def test_command_refuses_before_the_work(tmp_path, ball):
    path = write_obj(tmp_path / "ball.obj", *ball)
    done = run(path, "--faces", 600, "--size", 0.1)
    assert done.exit_code == 2
    assert "leave out one" in done.output
    for words, message in (
        (("-o", tmp_path / "quads.off"), "quads are written as .obj, .ply, .stl, .glb, .npz"),
        (("-o", path), "the input and the output"),
        (("--grid", tmp_path / "grid.ply"), "integer grids are written as .obj, .npz"),
        (("--grid", path), "the input and the grid"),
        (("--quads", -1), "quads must be an integer, 1 or more, got -1"),
        (("--smooth", -1), "smooth must be an integer, 0 or more"),
        (("--stretch", 2), "stretch must be a number from 0 to 1"),
    ):
        with pytest.raises(ConeflatError, match=message):
            run(path, *words)


def test_requirements_set_the_exit_code(tmp_path, ball):
    path = write_obj(tmp_path / "ball.obj", *ball)
    words = (path, "--quads", 300, "-o", tmp_path / "quads.obj")
    assert run(*words, "--require", "inverted=0,leaps=0,area_ratio>0.9").exit_code == 0
    done = run(*words, "--require", "quads<=10")
    assert done.exit_code == 3
    assert "requirement failed: quads is" in done.output
    assert "quads.obj is written anyway" in done.output
    with pytest.raises(OptionError, match="unknown measure 'flipped': choose from angle_max"):
        run(*words, "--require", "flipped=0")


def test_too_few_quads_end_the_command_with_an_error_and_the_number_to_use(tmp_path):
    cube = shapes.box(1, (1.0, 1.0, 1.0))
    cubes = shapes.join(*((cube[0] + [3.0 * i, 0, 0], cube[1]) for i in range(18)))
    path, output = write_obj(tmp_path / "cubes.obj", *cubes), tmp_path / "quads.obj"
    with pytest.raises(CoarseGridError, match="use at least"):  # the exit code of which is 2
        run(path, "--quads", 5, "-o", output)
    assert not output.exists()


def run(*words):
    return CliRunner().invoke(command, [str(word) for word in words], catch_exceptions=False)


def test_the_grid_is_written_and_made_into_the_same_quads(tmp_path, ball, quads_of_ball):
    path = write_obj(tmp_path / "ball.obj", *ball)
    npz, quads_of_grid = tmp_path / "grid.npz", tmp_path / "other.npz"
    quads_of_mesh = tmp_path / "both.npz"
    done = run(path, "--quads", 600, "--grid", npz, "--report", tmp_path / "grid.json")
    assert done.exit_code == 0, done.output
    # Without -o there is a grid alone.
    assert sorted(written.name for written in tmp_path.iterdir()) == ["ball.obj", "grid.json", "grid.npz"]
    told = json.loads((tmp_path / "grid.json").read_text())
    assert "quads" not in told
    assert told["grid"]["size"] == IntegerGrid.load(npz).size
    assert list(told["seconds"]) == ["read", "cones", "flatten", "grid", "write"]
    assert run(npz, "-o", quads_of_mesh, "--grid", quads_of_grid).exit_code == 0
    np.testing.assert_array_equal(IntegerGrid.load(quads_of_grid).turns, IntegerGrid.load(npz).turns)
    again = QuadMesh.load(quads_of_mesh)
    np.testing.assert_array_equal(again.quads, quads_of_ball.quads)
    np.testing.assert_array_equal(again.vertices, quads_of_ball.vertices)
    refused = run(npz, "--quads", 5)
    assert refused.exit_code == 2
    assert "is a grid: leave out --quads" in refused.output


@pytest.mark.slow
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
    sharp = run(path, "-o", out, "--quads", 600, "--cone-count", 4, "--min-cone-angle", "pi")
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
    nearest = [int(np.linalg.norm(vertices - corner, axis=1).argmin()) for corner in corners]
    words = ",".join(f"{vertex}:pi/2" for vertex in nearest)
    done = run(path, "-o", tmp_path / "q.npz", "--quads", 600, "--cones", words, "--smooth", 0)
    assert done.exit_code == 0, done.output
    mesh = QuadMesh.load(tmp_path / "q.npz")
    assert mesh.valences[mesh.irregular].tolist() == [3] * 8
    # They lie where they are asked for, to rounding: extraction has them at corners of triangles.
    apart = np.linalg.norm(mesh.vertices[mesh.irregular][:, None] - vertices[nearest], axis=2)
    assert (apart.min(axis=0) < 1e-12).all()
    refused = run(path, "--cones", words, "--max-cones", 9)
    assert "there is no search if the cones are given: leave out --max-cones" in refused.output
    for curvatures, reason in ((None, "not given"), (1.0, "is 1")):
        cones = nearest if curvatures is None else dict.fromkeys(nearest, curvatures)
        with pytest.raises(
            OptionError, match=f"multiples of pi/2; that of vertex {nearest[0]} is.*{reason.split()[-1]}"
        ):
            coneflat.quads(vertices, faces, cones=cones)


@pytest.mark.slow
def test_quads_are_more_alike_where_weights_are():
    vertices, faces = shapes.sphere(4, bumps=0.5)
    matters = vertices[:, 2] > np.quantile(vertices[:, 2], 0.7)

    def spread(weights):
        quads = coneflat.quads(vertices, faces, quads=2000, distortion=0.3, weights=weights)
        centres = quads.vertices[quads.quads].mean(axis=1)
        sizes = np.log(np.abs(quad_areas(quads))) / 2
        is_top = centres[:, 2] > np.quantile(vertices[:, 2], 0.7)
        return sizes[is_top].std()

    assert spread(np.where(matters, 100.0, 1.0)) < 0.9 * spread(None)


@pytest.mark.slow
def test_quads_are_flattened_again(tmp_path):
    path = coneflat.quads(*shapes.sphere(3), quads=800).save(tmp_path / "quads.obj")
    result = coneflat.flatten(path)
    assert result.distortion.flipped == 0
    assert result.distortion.qc_mean < 1.1
    again = coneflat.read_mesh(result.save(tmp_path / "flat.obj"))
    assert (np.diff(again.offsets) == 4).all()
    assert len(again.offsets) == len(coneflat.read_mesh(path).offsets)


@pytest.mark.slow
def test_the_command_tries_a_finer_grid_as_the_function_does(tmp_path):
    """Around each hole of a surface with three handles there are too few squares."""
    vertices, faces = shapes.genus(3)
    path = tmp_path / "holes.obj"
    rows = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    path.write_text("\n".join([*rows, *(f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist())]))
    words = ("--quads", 10, "--cones", "sparse", "--distortion", 0.2)
    done = run(path, *words, "-o", tmp_path / "quads.npz", "--grid", tmp_path / "grid.npz")
    assert done.exit_code == 0, done.output
    assert "More quads than requested" in done.output
    mesh = coneflat.quads(coneflat.read_mesh(path), quads=10, cones="sparse", distortion=0.2)
    np.testing.assert_array_equal(QuadMesh.load(tmp_path / "quads.npz").quads, mesh.quads)
    # The grid that is written is that of the quads.
    assert IntegerGrid.load(tmp_path / "grid.npz").size == mesh.grid.size
