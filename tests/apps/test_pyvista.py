"""The accessor of PyVista, with the real package."""

from __future__ import annotations

from importlib.metadata import entry_points

import numpy as np
import pytest

import coneflat

pyvista = pytest.importorskip("pyvista", minversion="0.48")


@pytest.fixture(autouse=True)
def accessor():
    """The module that PyVista imports by the entry point of an installed package."""
    from coneflat.apps import pyvista as accessor

    return accessor


@pytest.fixture(scope="module")
def ball():
    mesh = pyvista.Sphere(theta_resolution=20, phi_resolution=20)
    mesh["height"] = mesh.points[:, 2]
    return mesh


def test_the_entry_point_leads_to_the_accessor(accessor):
    points = [point for point in entry_points(group="pyvista.accessors") if point.name == "coneflat"]
    if not points:
        pytest.skip("an older version of the package is installed")
    assert points[0].load() is accessor
    assert "coneflat" in {accessor_entry.name for accessor_entry in pyvista.registered_accessors()}


def test_flatten_is_that_of_the_package(ball):
    mesh, result = ball.coneflat.flatten(), coneflat.flatten(ball)
    uv = np.asarray(mesh.active_texture_coordinates)
    faces = mesh.faces.reshape(-1, 4)[:, 1:]
    assert np.allclose(uv[faces], result.corner_uv, atol=1e-6)  # PyVista may store 32 bits
    assert np.allclose(mesh.points[faces], result.vertices[result.faces])
    assert np.allclose(mesh["height"], mesh.points[:, 2])
    assert mesh.field_data["charts"][0] == result.distortion.charts
    assert np.array_equal(mesh.cell_data["chart"], result.seam_data.face_chart)


def test_options_reach_the_functions(ball):
    assert ball.coneflat.flatten(cone_count=3, charts="one").field_data["charts"][0] == 1
    assert ball.coneflat.unwrap(max_energy=4.5).field_data["flipped"][0] == 0
    with pytest.raises(coneflat.ConeflatError):
        ball.coneflat.flatten(cone_count=-1)


def test_quads_are_four_sided(ball):
    mesh = ball.coneflat.quads(quads=100)
    assert set(mesh.faces[::5]) == {4}
    assert mesh.n_open_edges == 0


def test_written_surfaces_are_read_back(ball, tmp_path):
    mesh = ball.coneflat.flatten()
    mesh.save(tmp_path / "ball.ply")
    mesh.save(tmp_path / "ball.vtp")
    again = pyvista.read(tmp_path / "ball.vtp")
    assert np.array_equal(again.active_texture_coordinates, mesh.active_texture_coordinates)
    assert len(coneflat.read_mesh(tmp_path / "ball.ply").triangles) == mesh.n_cells


def test_data_of_points_and_cells_stay_where_they_are():
    """Also on polygons, after vertices and lines, which have cells before them."""
    box = pyvista.Cube(clean=True)
    mesh = pyvista.PolyData(box.points, faces=box.faces, lines=[2, 0, 6], verts=[1, 3])
    mesh.cell_data["middle"] = np.array([mesh.get_cell(i).center for i in range(mesh.n_cells)])
    mesh.cell_data["name"] = [f"cell {i}" for i in range(mesh.n_cells)]
    mesh.point_data["place"] = mesh.points
    for result in (mesh.coneflat.flatten(), mesh.coneflat.unwrap()):
        assert np.array_equal(result["place"], result.points)
        corners = result.points[result.faces.reshape(-1, 4)[:, 1:]]
        # Each triangle is in the square around the middle.
        inside = np.abs(corners - np.asarray(result["middle"])[:, None]).max(axis=2)
        assert inside.max() == pytest.approx(0.5)
        assert [str(name) for name in result["name"][:2]] == ["cell 2", "cell 2"]
        assert np.linalg.norm(np.asarray(result["middle"]), axis=1) == pytest.approx(0.5)
