"""Target sizes of quads, and components with searches of their own."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from click.testing import CliRunner

import coneflat
from coneflat.apps.cli.quads_command import quads as command
from coneflat.errors import GridError, MeshFileError, OptionError
from coneflat.mesh.connectivity import TriangleMesh
from coneflat.quadmesh import policies
from coneflat.quadmesh.alignment import has_area
from coneflat.quadmesh.features import split_around
from coneflat.quadmesh.no_grid import NoGrid
from coneflat.quadmesh.sizes import _scales_of_curvature, extended


def edges_and_places(mesh):
    """Return (p,) the mean side of each quad, and (p, 3) its centre."""
    corners = mesh.vertices[mesh.quads]
    return np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean(axis=1), corners.mean(axis=1)


@pytest.fixture(scope="module")
def ball():
    return shapes.sphere(3, bumps=0.2)


@pytest.fixture(scope="module")
def graded(ball):
    """Quads of a ball that are to be four times as large at the top as at the bottom."""
    return coneflat.quads(*ball, quads=1500, size=2.0 ** ball[0][:, 2])


@pytest.mark.slow
def test_quads_have_the_requested_sizes(ball, graded):
    sides, places = edges_and_places(graded)
    asked, reached = places[:, 2] * np.log(2), np.log(sides)
    assert np.corrcoef(asked, reached)[0, 1] > 0.85
    even = edges_and_places(coneflat.quads(*ball, quads=1500))[0]
    low, high = np.quantile(reached - asked, [0.05, 0.95])
    # As even, relative to the requested sizes, as quads are without them.
    assert high - low < 1.3 * np.subtract(*np.quantile(np.log(even), [0.95, 0.05]))
    assert 1200 < len(graded.quads) < 1800
    assert "have a correlation of 0.9" in " ".join(graded.notes)


@pytest.mark.slow
def test_sizes_count_up_to_a_factor(ball, graded):
    again = coneflat.quads(*ball, quads=1500, size=256 * 2.0 ** ball[0][:, 2])
    np.testing.assert_array_equal(again.quads, graded.quads)
    np.testing.assert_allclose(again.vertices, graded.vertices, atol=1e-6)


@pytest.mark.slow
def test_quads_are_smaller_where_the_surface_bends():
    vertices, faces = shapes.sphere(3)

    def ratio(size):
        sides, places = edges_and_places(coneflat.quads(vertices * [1, 1, 3], faces, quads=1000, size=size))
        return sides[np.abs(places[:, 2]) > 2.5].mean() / sides[np.abs(places[:, 2]) < 0.5].mean()

    # The curvature is 3 at the tips, and 1 around the middle.
    assert ratio("curvature") < 0.9 * ratio(None)


def test_sizes_are_inverse_to_the_root_of_the_curvature():
    vertices, faces = shapes.sphere(4, bumps=0.0)
    # Two balls of radius 1 and 3 / 2.
    mesh = TriangleMesh(
        np.concatenate([vertices, 1.5 * vertices + [9, 0, 0]]), np.concatenate([faces, faces + len(vertices)])
    )
    scales = _scales_of_curvature(mesh)
    small, large = np.median(scales[: len(vertices)]), np.median(scales[len(vertices) :])
    assert small - large == pytest.approx(np.log(1.5) / 2, rel=0.1)


def test_new_vertices_get_the_mean_of_their_neighbours():
    mesh = TriangleMesh(np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0]]), np.array([[0, 1, 2]]))
    finer = split_around(mesh, mesh.faces)
    assert (len(finer.faces), len(finer.vertices)) == (4, 6)
    values = extended(np.array([1.0, 2.0, 6.0]), finer)
    np.testing.assert_allclose(values[:3], [1, 2, 6])
    for value, point in zip(values[3:], finer.vertices[3:], strict=True):
        neighbours = [
            {0: 1, 1: 2, 2: 6}[v] for v in range(3) if np.linalg.norm(point - finer.vertices[v]) < 1.5
        ]
        assert value == pytest.approx(np.mean(neighbours))


@pytest.mark.parametrize(
    ("size", "message"),
    [
        (np.ones(3), "sizes must be 642 numbers, one for each vertex"),
        (np.zeros(642), "sizes must be nonnegative and not all 0"),
        (np.arange(642.0), "sizes must be positive"),
        (np.full(642, np.nan), "sizes must be finite"),
        ("density", "no vertex property 'density' for sizes"),
    ],
)
def test_sizes_that_are_none(ball, size, message):
    with pytest.raises(OptionError, match=message):
        coneflat.quads(*ball, quads=100, size=size)


@pytest.mark.parametrize("options", [{"cone_count": 8}, {"cones": "sparse"}])
def test_sizes_need_cones_that_may_be_chosen(ball, options):
    with pytest.raises(OptionError, match="sizes cannot be combined"):
        coneflat.quads(*ball, quads=100, size="curvature", **options)


@pytest.mark.slow
def test_the_command_reads_sizes(tmp_path, ball, graded):
    (tmp_path / "ball.obj").write_text(
        "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in ball[0].tolist())
        + "".join(f"f {a} {b} {c}\n" for a, b, c in (ball[1] + 1).tolist())
    )
    np.save(tmp_path / "sizes.npy", 2.0 ** ball[0][:, 2])
    words = [
        tmp_path / "ball.obj",
        "-o",
        tmp_path / "q.npz",
        "--quads",
        1500,
        "--size",
        tmp_path / "sizes.npy",
    ]
    done = CliRunner().invoke(command, [str(word) for word in words], catch_exceptions=False)
    assert done.exit_code == 0
    np.testing.assert_array_equal(coneflat.QuadMesh.load(tmp_path / "q.npz").quads, graded.quads)
    with pytest.raises(MeshFileError, match="no such file"):
        CliRunner().invoke(command, [*map(str, words[:-1]), "none.txt"], catch_exceptions=False)


@pytest.fixture(scope="module")
def two_balls(ball):
    vertices, faces = ball
    return np.concatenate([vertices, 3 * vertices + [10, 0, 0]]), np.concatenate(
        [faces, faces + len(vertices)]
    )


@pytest.mark.slow
def test_components_have_squares_of_the_same_size(two_balls):
    grid = coneflat.integer_grid(*two_balls, quads=1000)
    mesh = coneflat.quads(grid)
    sides, places = edges_and_places(mesh)
    is_small = places[:, 0] < 3
    assert sides[is_small].mean() == pytest.approx(sides[~is_small].mean(), rel=0.1)
    assert mesh.euler_characteristic == 4
    np.testing.assert_array_equal(np.unique(grid.faces), np.arange(len(grid.vertices)))


@pytest.mark.slow
def test_sizes_hold_between_components(two_balls):
    sizes = np.repeat([1.0, 2.0], len(two_balls[0]) // 2)
    sides, places = edges_and_places(coneflat.quads(*two_balls, quads=1000, size=sizes))
    is_small = places[:, 0] < 3
    assert sides[~is_small].mean() == pytest.approx(2 * sides[is_small].mean(), rel=0.1)


@pytest.mark.slow
def test_a_coarse_mesh_without_a_grid_is_refined(monkeypatch):
    aligned_map = policies.aligned_map

    def fail_at_first(request, price_factor, flattening_of):
        if price_factor == 1:
            return NoGrid(GridError("none"))
        return aligned_map(request, price_factor, flattening_of)

    monkeypatch.setattr(policies, "aligned_map", fail_at_first)
    vertices, faces = shapes.torus()
    grid = coneflat.integer_grid(vertices, faces, quads=500)
    assert len(grid.faces) >= 4 * len(faces)
    assert not any("Cones are not chosen" in note for note in grid.notes)
    assert coneflat.quads(grid).euler_characteristic == 0


@pytest.mark.slow
def test_triangles_around_flipped_ones_are_split(monkeypatch):
    vertices, faces = shapes.torus()

    def first_is_flipped(result):
        is_flat = has_area(result)
        is_flat[0] &= len(result.faces) > len(faces)
        return is_flat

    monkeypatch.setattr("coneflat.quadmesh.aligned_cones.has_area", first_is_flipped)
    grid = coneflat.integer_grid(vertices, faces, quads=500)
    # The neighbours of a triangle become four, and those of the neighbours two or more.
    assert len(faces) + 3 * 13 <= len(grid.faces) <= len(faces) + 100
    assert not any("Cones are not chosen" in note for note in grid.notes)
