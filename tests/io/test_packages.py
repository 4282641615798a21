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

    def test_its_exports_have_uvs(self, result, tmp_path):
        pytest.importorskip("trimesh")
        result.to_trimesh().export(tmp_path / "out.glb")
        assert len(coneflat.read_mesh(tmp_path / "out.glb").uv) == len(result.uv)


class TestMeshio:
    def test_uvs_survive(self, result):
        meshio = pytest.importorskip("meshio")
        mesh = result.to_meshio()
        assert isinstance(mesh, meshio.Mesh)
        faces = mesh.cells_dict["triangle"]
        check(result, mesh.points, faces, mesh.point_data["obj:vt"], mesh.point_data["vertex"])
        np.testing.assert_array_equal(mesh.cell_data["chart"][0], result.seam_data.face_chart)


class TestPyVista:
    def test_the_arguments_that_it_gets(self, result, monkeypatch):
        """Points, padded faces and texture coordinates, by a module that only takes them."""
        fake = ModuleType("pyvista")
        fake.PolyData = lambda points, faces: SimpleNamespace(
            points=points, faces=faces, point_data={}, cell_data={}
        )
        monkeypatch.setitem(sys.modules, "pyvista", fake)
        mesh = result.to_pyvista()
        padded = mesh.faces.reshape(-1, 4)
        assert (padded[:, 0] == 3).all()
        uv = result.uv[result.uv_faces].astype(np.float32)
        assert np.array_equal(mesh.active_texture_coordinates[padded[:, 1:]], uv)
        assert np.array_equal(mesh.points[padded[:, 1:]], result.vertices[result.faces])
        assert np.array_equal(mesh.point_data["vertex"][padded[:, 1:]], result.faces)
        np.testing.assert_array_equal(mesh.cell_data["chart"], result.seam_data.face_chart)
        again = coneflat.flatten(mesh)
        assert len(again.faces) == len(result.faces)

    def test_uvs_survive(self, result):
        pyvista = pytest.importorskip("pyvista")
        mesh = result.to_pyvista()
        assert isinstance(mesh, pyvista.PolyData)
        faces = mesh.faces.reshape(-1, 4)[:, 1:]
        assert np.array_equal(mesh.points[faces], result.vertices[result.faces])
        assert np.array_equal(mesh.active_texture_coordinates[faces], result.corner_uv.astype(np.float32))
        assert np.array_equal(mesh.point_data["vertex"][faces], result.faces)
        assert len(coneflat.flatten(mesh).faces) == len(result.faces)


@pytest.mark.parametrize("module", ["trimesh", "pyvista", "meshio"])
def test_missing_packages_are_named(result, monkeypatch, module):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(coneflat.errors.OptionError, match=f"pip install {module}") as caught:
        getattr(result, f"to_{module}")()
    assert "\n" not in str(caught.value)
