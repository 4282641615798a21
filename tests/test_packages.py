"""Results as meshes of other packages: UVs survive, and what is missing is named."""

from __future__ import annotations

import sys
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
import shapes

import coneflat


@pytest.fixture(scope="module")
def result():
    return coneflat.flatten(*shapes.join(shapes.sphere(2), shapes.hill(6, 5)), charts="atlas")


def check(result, points, faces, uv, vertex):
    """The triangles are those of the result, at the same places of the model and of the plane."""
    np.testing.assert_array_equal(points[faces], result.vertices[result.faces])
    np.testing.assert_array_equal(uv[faces], result.corner_uv)
    np.testing.assert_array_equal(vertex[faces], result.faces)
    # Split at seams and nowhere else.
    assert len(points) == len(np.unique(result.uv_faces))


class TestTrimesh:
    def test_uvs_survive(self, result):
        trimesh = pytest.importorskip("trimesh")
        mesh = result.to_trimesh()
        assert isinstance(mesh, trimesh.Trimesh)
        check(result, mesh.vertices, mesh.faces, mesh.visual.uv, mesh.vertex_attributes["vertex"])
        np.testing.assert_array_equal(mesh.face_attributes["chart"], result.seam_data.face_chart)

    def test_through_a_file(self, result, tmp_path):
        trimesh = pytest.importorskip("trimesh")
        result.to_trimesh().export(tmp_path / "out.obj")
        again = trimesh.load(tmp_path / "out.obj", process=False)
        assert len(again.faces) == len(result.faces)
        measured = coneflat.measure_uv(tmp_path / "out.obj", weld=True)
        assert measured.distortion.qc_mean == pytest.approx(result.distortion.qc_mean, rel=1e-5)


class TestMeshio:
    def test_uvs_survive(self, result):
        meshio = pytest.importorskip("meshio")
        mesh = result.to_meshio()
        assert isinstance(mesh, meshio.Mesh)
        faces = mesh.cells_dict["triangle"]
        check(result, mesh.points, faces, mesh.point_data["obj:vt"], mesh.point_data["vertex"])
        np.testing.assert_array_equal(mesh.cell_data["chart"][0], result.seam_data.face_chart)

    @pytest.mark.parametrize("ending", [".obj", ".vtu"])
    def test_through_a_file(self, result, tmp_path, ending):
        meshio = pytest.importorskip("meshio")
        result.to_meshio().write(tmp_path / f"out{ending}")
        again = meshio.read(tmp_path / f"out{ending}")
        faces = again.cells_dict["triangle"]
        np.testing.assert_allclose(again.point_data["obj:vt"][faces], result.corner_uv, atol=1e-12)

    def test_it_goes_back_in(self, result):
        """Its seams are borders there."""
        pytest.importorskip("meshio")
        again = coneflat.flatten(result.to_meshio())
        assert len(again.faces) == len(result.faces)


class TestPyVista:
    def test_uvs_survive(self, result):
        pytest.importorskip("pyvista")
        mesh = result.to_pyvista()
        faces = mesh.faces.reshape(-1, 4)[:, 1:]
        check(result, mesh.points, faces, mesh.active_texture_coordinates, mesh.point_data["vertex"])

    def test_what_it_is_given(self, result, monkeypatch):
        """Points, padded faces and texture coordinates, by a module that only takes them."""
        fake = ModuleType("pyvista")
        fake.PolyData = lambda points, faces: SimpleNamespace(
            points=points, faces=faces, point_data={}, cell_data={}
        )
        monkeypatch.setitem(sys.modules, "pyvista", fake)
        mesh = result.to_pyvista()
        padded = mesh.faces.reshape(-1, 4)
        assert (padded[:, 0] == 3).all()
        check(result, mesh.points, padded[:, 1:], mesh.active_texture_coordinates, mesh.point_data["vertex"])
        np.testing.assert_array_equal(mesh.cell_data["chart"], result.seam_data.face_chart)
        again = coneflat.flatten(mesh)
        assert len(again.faces) == len(result.faces)


@pytest.mark.parametrize("module", ["trimesh", "pyvista", "meshio"])
def test_what_is_missing_is_named(result, monkeypatch, module):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(coneflat.errors.OptionError, match=f"pip install {module}") as caught:
        getattr(result, f"to_{module}")()
    assert "\n" not in str(caught.value)


class TestTriangles:
    def test_they_are_what_flatten_takes(self, tmp_path):
        """A cube of quads, which numbers in threes would make garbage of."""
        (tmp_path / "cube.obj").write_text(
            "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n"
            "f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n"
        )
        model = coneflat.read_mesh(tmp_path / "cube.obj")
        assert model.triangles.shape == (12, 3)
        assert model.triangles is model.triangles
        mesh = coneflat.check_mesh(model.vertices, model.triangles).mesh
        assert mesh.euler_characteristic == 2
        np.testing.assert_array_equal(coneflat.flatten(model).faces, model.triangles)

    def test_triangles_stay(self):
        model = coneflat.read_mesh(coneflat.sample_path())
        np.testing.assert_array_equal(model.triangles, coneflat.flatten(model).faces)
