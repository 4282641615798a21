"""Files of quads: what they hold, and what is read back from them."""

from __future__ import annotations

import re
import sys
from dataclasses import fields, replace

import numpy as np
import pytest
import shapes
from grid_maps import L_SHAPE, on_squares, polycube

import coneflat
from coneflat import QuadMesh, read_mesh
from coneflat.errors import MeshFileError, OptionError
from coneflat.io.gltf.data import GltfData
from coneflat.quadmesh.extract import extract_quads
from coneflat.quadmesh.quad_mesh import least_jacobians


@pytest.fixture(scope="module")
def cube():
    """Quads of an L of cubes, 3 to a side: 14 squares, ten vertices of valence 3 and two of 5."""
    return extract_quads(on_squares(*polycube(L_SHAPE), 3, inside=7, along=2, seed=3))


class TestObj:
    def test_quads_are_equal_squares_in_the_unit_square(self, cube, tmp_path):
        mesh = read_mesh(cube.save(tmp_path / "quads.obj"))
        np.testing.assert_array_equal(mesh.corners.reshape(-1, 4), cube.quads)
        uv = mesh.uv[mesh.texture].reshape(-1, 4, 2)
        np.testing.assert_array_equal(uv, cube.uv)
        assert uv.min() >= 0
        assert uv.max() <= 1
        sides = np.roll(uv, -1, axis=1) - uv
        np.testing.assert_allclose(np.linalg.norm(sides, axis=2), np.linalg.norm(sides[0, 0]))
        assert (np.linalg.det(sides[:, :2]) > 0).all()
        assert len(np.unique(np.round(uv.mean(axis=1), 9), axis=0)) == len(uv)

    @pytest.mark.parametrize("is_flat", [False, True])
    def test_materials_and_groups_of_the_model(self, tmp_path, is_flat):
        """A sphere whose upper half is of another material and group; its top is in the group without a name."""
        (tmp_path / "in").mkdir()
        (tmp_path / "in" / "a.mtl").write_text("newmtl red\nnewmtl blue\n")
        vertices, faces = shapes.sphere(3)
        upper = vertices[faces].mean(axis=1)[:, 2] > 0
        lines = ["mtllib a.mtl", "mtllib b.mtl", *(f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist())]
        cap = vertices[faces].mean(axis=1)[:, 2] > 0.6
        parts = ["g low", "usemtl red"], ["usemtl blue", "g top cap"], ["g"]
        for words, which in zip(parts, (~upper, upper & ~cap, cap), strict=True):
            lines += [*words, *(f"f {a} {b} {c}" for a, b, c in (faces[which] + 1).tolist())]
        (tmp_path / "in" / "ball.obj").write_text("\n".join(lines) + "\n")
        model = tmp_path / "in" / "ball.obj"
        if is_flat:
            model = coneflat.flatten(model, quantise=np.pi / 2, correct_handles=True, charts="one")
        mesh = coneflat.quads(model, quads=300)
        text = mesh.save(tmp_path / "quads.obj").read_text()
        assert text.startswith("mtllib in/a.mtl\nmtllib in/b.mtl\nv ")
        low, *top = (part.count("\nf ") for part in re.split("usemtl blue", text))
        assert all(line in text for line in ("usemtl red\n", "g low\n", "g top cap\n", "g \n"))
        assert low + sum(top) == len(mesh.quads)
        height = mesh.vertices[mesh.quads].mean(axis=1)[:, 2]
        assert sum(top) == pytest.approx((height > 0).sum(), abs=20)
        assert low > 50


class TestPly:
    def test_trimesh_reads_the_uvs(self, cube, tmp_path):
        """It divides each quad, and each vertex where its UVs differ."""
        trimesh = pytest.importorskip("trimesh")
        mesh = trimesh.load(cube.save(tmp_path / "quads.ply"), process=False)
        read = np.concatenate([mesh.vertices, mesh.visual.uv], axis=1)
        written = np.concatenate([cube.vertices[cube.quads], cube.uv], axis=2).reshape(-1, 5)
        gaps = np.linalg.norm(read[:, None] - written, axis=2)
        assert max(gaps.min(axis=0).max(), gaps.min(axis=1).max()) < 1e-6
        assert len(mesh.faces) == 2 * len(cube.quads)
        assert mesh.area == pytest.approx(14)

    def test_is_read_back(self, cube, tmp_path):
        mesh = read_mesh(cube.save(tmp_path / "quads.ply"))
        np.testing.assert_array_equal(mesh.vertices, cube.vertices)
        np.testing.assert_array_equal(mesh.corners.reshape(-1, 4), cube.quads)
        uv = mesh.uv[mesh.texture].reshape(-1, 4, 2)
        np.testing.assert_array_equal(uv, cube.uv.astype(np.float32))


class TestStl:
    def test_trimesh_reads_a_solid(self, cube, tmp_path):
        trimesh = pytest.importorskip("trimesh")
        mesh = trimesh.load(cube.save(tmp_path / "quads.stl"))  # merges equal corners
        assert len(mesh.faces) == 2 * len(cube.quads)
        assert mesh.is_watertight
        assert mesh.is_winding_consistent
        assert mesh.volume == pytest.approx(3, rel=1e-6)

    def test_meshio_reads_the_triangles(self, cube, tmp_path):
        meshio = pytest.importorskip("meshio")
        mesh = meshio.read(cube.save(tmp_path / "quads.stl"))
        (block,) = mesh.cells
        np.testing.assert_array_equal(
            mesh.points[block.data], cube.vertices[cube.triangles].astype(np.float32)
        )

    @pytest.mark.parametrize(("factor", "shift"), [(1e39, 0.0), (1.0, 1e9)])
    def test_coordinates_beyond_32_bits(self, cube, tmp_path, factor, shift):
        with pytest.raises(MeshFileError, match=r"32-bit numbers of \.stl.* or write \.ply"):
            replace(cube, vertices=factor * cube.vertices + shift).save(tmp_path / "quads.stl")
        assert not list(tmp_path.iterdir())


class TestGlb:
    @pytest.fixture
    def saved(self, cube, tmp_path):
        return cube.save(tmp_path / "quads.glb")

    def test_triangles_are_halves_of_the_quads(self, cube, saved):
        mesh = read_mesh(saved)
        np.testing.assert_array_equal(mesh.vertices, cube.vertices.astype(np.float32))
        triangles = mesh.corners.reshape(-1, 2, 3)
        assert len(triangles) == len(cube.quads)
        # Both halves together have the quad's corners, and each side runs as it does in the quad.
        for quad, pair in zip(cube.quads, triangles, strict=True):
            sides = {(t[i], t[(i + 1) % 3]) for t in pair.tolist() for i in range(3)}
            around = set(zip(quad.tolist(), np.roll(quad, -1).tolist(), strict=True))
            assert around <= sides
            (first, second), again = sides - around
            assert again == (second, first)

    def test_lines_are_the_edges(self, cube, saved):
        data = GltfData(saved, saved.read_bytes())
        faces, lines = data.tree["meshes"][0]["primitives"]
        assert (faces.get("mode", 4), lines["mode"]) == (4, 1)
        ends = np.sort(data.indices(lines["indices"]).reshape(-1, 2), axis=1)
        assert len(np.unique(ends, axis=0)) == len(ends) == 2 * len(cube.quads)
        np.testing.assert_array_equal(ends, cube.edges)
        # They lie above the quads, by a hundredth of an edge of 1/3.
        rows = data.raw(lines["attributes"]["POSITION"]).view(np.float32).reshape(-1, 3)
        off = np.linalg.norm(rows - cube.vertices, axis=1)
        np.testing.assert_allclose(off, 0.01 / 3, rtol=1e-3)
        outward = ((rows - cube.vertices) * (cube.vertices - cube.vertices.mean(axis=0))).sum()
        assert outward > 0

    def test_the_shorter_diagonal(self):
        quad = np.array([[0.0, 0, 0], [3, 0, 0], [2, 1, 0], [0, 1, 0]])
        mesh = QuadMesh(quad, np.array([[0, 1, 2, 3]]), *[None] * 5)
        # From (0, 0) to (2, 1), not from (3, 0) to (0, 1).
        assert sorted(map(sorted, mesh.triangles.tolist())) == [[0, 1, 2], [0, 2, 3]]
        mesh = QuadMesh(quad, np.array([[1, 2, 3, 0]]), *[None] * 5)
        assert sorted(map(sorted, mesh.triangles.tolist())) == [[0, 1, 2], [0, 2, 3]]

    @pytest.mark.parametrize("first", range(4))
    def test_the_diagonal_inside_a_reflex_angle(self, first):
        dart = np.array([[0.0, 0, 0], [5, -0.2, 0], [1, 0, 0], [5, 0.2, 0]])
        mesh = QuadMesh(dart, np.roll([[0, 1, 2, 3]], first, axis=1), *[None] * 5)
        # The diagonal from (0, 0) to (1, 0), of length 1; that of length 0.4 is outside.
        assert sorted(map(sorted, mesh.triangles.tolist())) == [[0, 1, 2], [0, 2, 3]]


class TestNpz:
    @pytest.fixture
    def saved(self, cube, tmp_path):
        return cube.save(tmp_path / "quads.npz")

    def test_saved_quads_are_restored(self, cube, saved):
        again = QuadMesh.load(saved)
        for field in fields(cube):
            stored, restored = getattr(cube, field.name), getattr(again, field.name)
            if field.name == "seconds":
                continue
            if field.name == "surface":
                np.testing.assert_array_equal(stored.vertices, restored.vertices)
                np.testing.assert_array_equal(stored.faces, restored.faces)
            else:
                np.testing.assert_array_equal(stored, restored)

    @pytest.mark.parametrize(
        ("name", "value", "message"),
        [
            ("quads", None, "holds no mesh of quads: 'quads' is missing"),
            ("quads", np.zeros((3, 3)), "'quads' has the shape"),
            ("quads", np.zeros((0, 4)), "holds no mesh of quads: its array 'quads' is empty"),
            ("quads", np.full((3, 4), 10**6), "'quads' has indices outside"),
            ("faces", np.zeros(1), "'faces' has the shape"),
            ("surface_vertices", np.full((100, 3), np.nan), "not finite"),
            ("report", np.array("{}"), "not a readable NPZ file"),
            ("report", np.array("[]"), "not a readable NPZ file"),
        ],
    )
    def test_invalid_archives_are_refused(self, saved, tmp_path, name, value, message):
        with np.load(saved) as archive:
            arrays = dict(archive)
        if value is None:
            del arrays[name]
        else:
            arrays[name] = value
        np.savez(tmp_path / "bad.npz", **arrays)
        with pytest.raises(MeshFileError, match=message) as caught:
            QuadMesh.load(tmp_path / "bad.npz")
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("ending", [".vtk", ".vtu", ".inp", ".msh"])
class TestMeshio:
    def test_reads_the_same_quads(self, cube, tmp_path, ending):
        meshio = pytest.importorskip("meshio")
        mesh = meshio.read(cube.save(tmp_path / f"quads{ending}"))
        np.testing.assert_array_equal(mesh.points, cube.vertices)
        (block,) = mesh.cells
        assert block.type == "quad"
        np.testing.assert_array_equal(block.data, cube.quads)
        if ending != ".inp":
            np.testing.assert_array_equal(mesh.point_data["valence"], cube.valences)
            np.testing.assert_allclose(
                mesh.cell_data["jacobian"][0], least_jacobians(cube.vertices, cube.quads)
            )

    def test_is_an_extra(self, cube, tmp_path, monkeypatch, ending):
        monkeypatch.setitem(sys.modules, "meshio", None)
        with pytest.raises(OptionError, match="need meshio: pip install meshio"):
            cube.save(tmp_path / f"quads{ending}")
        assert not list(tmp_path.iterdir())
