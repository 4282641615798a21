"""Files of integer grids: UVs from which all else follows."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
import shapes
from grid_maps import RING, on_squares, polycube

import coneflat
from coneflat import IntegerGrid
from coneflat.errors import GridError, MeshFileError, UnknownFormatError
from coneflat.quadmesh.extract import extract_quads
from coneflat.quadmesh.integer_map import grid_of_corners

MAPS = {
    "sphere": lambda: coneflat.integer_grid(*shapes.sphere(3, bumps=0.2), quads=300),
    "torus": lambda: coneflat.integer_grid(*shapes.torus(), quads=300),
    "free border": lambda: coneflat.integer_grid(*shapes.hill(), quads=300),
    "straight border": lambda: coneflat.integer_grid(*shapes.hill(), quads=300, boundary="straight"),
}


@pytest.fixture(scope="module", params=MAPS)
def grid(request):
    return MAPS[request.param]()


def sorted_cones(grid):
    """The grid with its cones, and the corners of its boundary, in the order of vertices."""
    cone_order, corner_order = np.argsort(grid.cones), np.argsort(grid.corners)
    return replace(
        grid,
        cones=grid.cones[cone_order],
        quarters=grid.quarters[cone_order],
        corners=grid.corners[corner_order],
        corner_quarters=grid.corner_quarters[corner_order],
    )


def assert_same(grid, other_grid):
    """All fields, bit for bit."""
    for field in fields(grid):
        if field.name == "seconds":
            continue
        np.testing.assert_array_equal(getattr(grid, field.name), getattr(other_grid, field.name), field.name)


def test_saved_grids_are_restored(grid, tmp_path):
    again = IntegerGrid.load(grid.save(tmp_path / "grid.npz"))
    assert_same(grid, again)
    quads, quads_again = extract_quads(grid), extract_quads(again)
    np.testing.assert_array_equal(quads.vertices, quads_again.vertices)
    np.testing.assert_array_equal(quads.quads, quads_again.quads)


@pytest.mark.parametrize("ending", [".obj", ".OBJ"])
def test_an_obj_has_the_coordinates_as_uvs(grid, tmp_path, ending):
    read = coneflat.read_mesh(grid.save(tmp_path / f"grid{ending}"))
    np.testing.assert_array_equal(read.vertices, grid.vertices)
    np.testing.assert_array_equal(read.triangles, grid.faces)
    np.testing.assert_array_equal(read.uv[read.texture].reshape(-1, 3, 2), grid.corner_grid)


def test_motions_and_cones_follow_from_the_corners_alone(grid):
    again = grid_of_corners(grid.vertices, grid.faces, grid.corner_grid)
    expected = sorted_cones(grid)
    for name in ("turns", "shifts", "cones", "quarters", "corners", "corner_quarters"):
        np.testing.assert_array_equal(getattr(expected, name), getattr(again, name))
    assert again.size == pytest.approx(grid.size, rel=0.1)


def test_known_motions_are_found():
    # Squares in charts that are turned and moved at random, with motions found one edge at a time.
    ring = on_squares(*polycube(RING), 4, inside=5, along=2, seed=7)
    again = grid_of_corners(ring.vertices, ring.faces, ring.corner_grid)
    for name in ("turns", "shifts", "cones", "quarters"):
        np.testing.assert_array_equal(getattr(ring, name), getattr(again, name))
    assert len(np.unique(again.turns)) == 4
    # A square's side is a quarter of a cube's.
    assert again.size == pytest.approx(1 / 4)


@pytest.fixture(scope="module")
def ring():
    ring = on_squares(*polycube(RING), 2, inside=3, along=1, seed=1)
    return grid_of_corners(ring.vertices, ring.faces, ring.corner_grid)


class TestWhatIsNone:
    @pytest.mark.parametrize(
        ("name", "value", "message"),
        [
            ("corners", None, "holds no integer grid: 'corners' is missing"),
            ("faces", 10**6, "'faces' has indices outside"),
            ("corner_grid", np.inf, "not finite"),
            ("report", "", "not a readable NPZ file"),
        ],
    )
    def test_archives(self, ring, tmp_path, name, value, message):
        with np.load(ring.save(tmp_path / "grid.npz")) as archive:
            arrays = dict(archive)
        if value is None:
            del arrays[name]
        elif value == "":
            arrays[name] = np.array("{}")
        else:
            arrays[name] = np.full_like(arrays[name], value)
        np.savez(tmp_path / "bad.npz", **arrays)
        with pytest.raises(MeshFileError, match=message) as caught:
            IntegerGrid.load(tmp_path / "bad.npz")
        assert "\n" not in str(caught.value)

    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("change", "message"),
        [
            (
                lambda a: {"corner_quarters": a["corner_quarters"] + 1},
                "corners are listed twice, are not on grid points",
            ),
            (lambda a: {"corners": np.zeros_like(a["corners"])}, "corners are listed twice"),
            (lambda a: {"corners": a["faces"][5][:1], "corner_quarters": [2]}, "corners are listed twice"),
            (
                lambda a: {"features": [[0, len(a["vertices"]) - 1]]},
                "sharp edges are not edges on grid lines",
            ),
            (lambda a: {"features": a["faces"][:, :2]}, "sharp edges are not edges on grid lines"),
        ],
    )
    def test_corners_and_sharp_edges_that_are_not_those_of_the_map(self, tmp_path, change, message):
        grid = MAPS["straight border"]()
        with np.load(grid.save(tmp_path / "grid.npz")) as archive:
            arrays = dict(archive)
        assert len(arrays["corners"]) == 4
        np.savez(tmp_path / "bad.npz", **{**arrays, **change(arrays)})
        with pytest.raises(MeshFileError, match=f"holds no integer grid: its {message}"):
            IntegerGrid.load(tmp_path / "bad.npz")

    def test_maps_that_do_not_fit(self, ring):
        places = ring.corner_grid.copy()
        with pytest.raises(GridError, match="flipped or without area"):
            grid_of_corners(ring.vertices, ring.faces, places[..., ::-1])
        places[5] += 0.25
        with pytest.raises(GridError, match="differ by 0.[23]"):
            grid_of_corners(ring.vertices, ring.faces, places)

    def test_endings(self, ring, tmp_path):
        with pytest.raises(UnknownFormatError, match=r"integer grids are written as \.obj, \.npz"):
            ring.save(tmp_path / "grid.glb")
        with pytest.raises(UnknownFormatError, match="integer grids are read from"):
            IntegerGrid.load(tmp_path / "grid.ply")


def test_sharp_edges_are_kept(tmp_path):
    grid = coneflat.integer_grid(*shapes.box(4, (1.0, 1.0, 1.0)), quads=96, sharp_angle=1.0)
    again = IntegerGrid.load(grid.save(tmp_path / "box.npz"))
    assert len(grid.features) >= 12 * 4
    np.testing.assert_array_equal(again.features, grid.features)
