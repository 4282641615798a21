"""Models far from the origin: their triangles are in every written file, or a note says why they are not."""

from __future__ import annotations

import struct

import numpy as np
import pytest
import shapes
from gltf_scenes import SceneMaker, opened, rich_scene
from trials.offsets import READERS

import coneflat
from coneflat.errors import ConeflatError, MeshFileError
from coneflat.io import local_positions, read_mesh, read_mesh_from
from coneflat.source.rounding import coarse_step

OFFSETS = ([1e6, -3e6, 7e5], [452345.1, 5411234.5, 300.0], [1e8, -1e8, 0.1])


def sides(corners):
    return np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)


@pytest.mark.parametrize("offset", OFFSETS)
@pytest.mark.parametrize("ending", list(READERS))
def test_a_model_of_size_one_far_away_keeps_its_triangles(tmp_path, offset, ending):
    vertices, faces = shapes.hill(5, 4)
    vertices = vertices + offset
    result = coneflat.flatten(vertices, faces)
    corners = READERS[ending](result.save(tmp_path / f"out{ending}"))
    if ending == ".glb":  # vertices are in the order of the result
        np.testing.assert_allclose(sides(corners), sides(vertices[result.faces]), rtol=0, atol=4e-7)
        np.testing.assert_allclose(corners, vertices[result.faces], rtol=0, atol=3e-7)
    else:
        assert corners.tobytes() == vertices[result.faces].tobytes()
    stored = result.as_written(ending)
    assert np.array_equal(stored.vertices[stored.faces], corners)
    assert not stored.distortion.degenerate_input
    assert np.isfinite(stored.distortion.qc_mean)
    assert stored.as_written(ending) is stored


def test_other_readers_find_it_by_the_translation_of_its_node(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    vertices, faces = shapes.sphere(1)
    vertices = vertices + OFFSETS[1]
    out = coneflat.flatten(vertices, faces).save(tmp_path / "out.glb")
    mesh = trimesh.load(out, process=False, force="mesh")
    np.testing.assert_allclose(sides(mesh.vertices[mesh.faces]), sides(vertices[faces]), rtol=0, atol=1e-6)
    again = read_mesh(out)
    assert len(again.vertices) == len(vertices)
    (node,) = opened(out.read_bytes())[0]["nodes"]
    assert np.abs(np.subtract(node["translation"], OFFSETS[1])).max() <= 2


@pytest.mark.parametrize("offset", [0.0, 1.0, 3.0])
def test_a_model_near_the_origin_has_its_positions_themselves(tmp_path, offset):
    vertices, faces = shapes.sphere(1)
    tree, accessor, _ = opened(
        coneflat.flatten(vertices + offset, faces).save(tmp_path / "out.glb").read_bytes()
    )
    assert "translation" not in tree["nodes"][0]
    points = accessor(tree["meshes"][0]["primitives"][0]["attributes"]["POSITION"])
    assert set(map(tuple, points.tolist())) == set(map(tuple, (vertices + offset).astype("f4").tolist()))


def test_positions_that_are_32_bit_numbers_are_written_bit_for_bit():
    vertices = (np.random.default_rng(0).random((50, 3)) + 1e5).astype("f4").astype(float)
    placed = local_positions(vertices)
    assert not placed.translation.any()
    assert np.array_equal(placed.local, vertices)


def test_positions_that_were_read_back_do_not_change():
    rng = np.random.default_rng(1)
    for _ in range(200):
        vertices = 10.0 ** rng.uniform(-3, 3) * rng.random((9, 3)) + rng.normal(size=3) * 10.0 ** rng.uniform(
            3, 8
        )
        vertices[:, rng.integers(3)] *= rng.choice([1.0, 0.0])
        once = local_positions(vertices).vertices
        assert np.array_equal(local_positions(once).vertices, once)
        size = np.ptp(vertices, axis=0).max()
        assert np.abs(once - vertices).max() <= 2.0**-23 * size + np.spacing(np.abs(vertices).max())


def test_vertices_without_a_face_do_not_count(tmp_path):
    vertices, faces = shapes.hill(3, 3)
    vertices = np.concatenate([vertices + 1e7, [[0.0, 0, 0]]])
    stored = coneflat.flatten(vertices, faces).as_written(".glb")
    np.testing.assert_allclose(sides(stored.vertices[stored.faces]), sides(vertices[stored.faces]), atol=4e-7)


def test_a_scene_with_transforms_keeps_them(tmp_path):
    make = SceneMaker()
    vertices, faces = shapes.hill(3, 3)
    primitive = {
        "attributes": {"POSITION": make.accessor(vertices)},
        "indices": make.accessor(faces.ravel(), 5123),
    }
    nodes = [
        {"children": [1], "translation": OFFSETS[0]},
        {"mesh": 0, "scale": [2, 2, 2], "rotation": [0, 0, 0.6, 0.8]},
    ]
    make.tree |= {"meshes": [{"primitives": [primitive]}], "nodes": nodes, "scenes": [{"nodes": [0]}]}
    result = coneflat.flatten(read_mesh_from(make.glb(), "a.glb"))
    tree, accessor, _ = opened(result.save(tmp_path / "out.glb").read_bytes())
    assert tree["nodes"] == nodes
    points = accessor(tree["meshes"][0]["primitives"][0]["attributes"]["POSITION"])
    assert set(map(tuple, points.tolist())) == set(map(tuple, vertices.astype("f4").tolist()))
    assert np.array_equal(result.as_written(".glb").vertices, result.vertices)
    rich = coneflat.flatten(read_mesh_from(rich_scene(), "rich.glb"))
    assert np.array_equal(rich.as_written(".glb").vertices, rich.vertices)


def test_triangles_that_32_bit_numbers_make_flat_are_named():
    vertices, faces = shapes.hill(3, 3)
    place = np.array([1 / 3, 1 / 3, 2])
    mesh = shapes.join((vertices, faces), (1e-9 * vertices[faces[0]] + place, np.array([[0, 1, 2]])))
    result = coneflat.flatten(*mesh)
    assert not result.distortion.degenerate_input
    notes = result.as_written(".glb").notes
    assert any("1 triangle has no area in the 32-bit numbers of .glb" in note for note in notes)
    assert not any("32-bit" in note for note in result.as_written(".ply").notes)


@pytest.mark.parametrize("ending", [".obj", ".ply", ".glb", ".vtk", ".vtu", ".inp", ".msh"])
def test_quads_far_away_keep_their_shape(tmp_path, ending):
    meshio, trimesh = pytest.importorskip("meshio"), pytest.importorskip("trimesh")
    vertices, faces = shapes.hill(5, 5)
    mesh = coneflat.quads(vertices + OFFSETS[0], faces, quads=30)
    out = mesh.save(tmp_path / f"out{ending}")
    if ending in (".obj", ".ply", ".glb"):
        scene = trimesh.load_scene(out, process=False)
        meshes = [geometry for geometry in scene.dump() if isinstance(geometry, trimesh.Trimesh)]
        points = meshes[0].vertices
    else:
        points = meshio.read(out).points
    # The reader of triangles repeats vertices of an OBJ at other UVs.
    for axis in range(3):
        errors = np.abs(np.unique(points[:, axis])[:, None] - mesh.vertices[:, axis]).min(axis=1)
        assert errors.max() < 1e-6
    assert len(np.unique(points, axis=0)) == len(mesh.vertices)


def rounded_stl(vertices, faces):
    facet = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    rows = np.zeros(len(faces), facet)
    rows["corners"] = vertices[faces]
    return bytes(80) + struct.pack("<I", len(rows)) + rows.tobytes()


def test_a_file_whose_numbers_are_too_coarse_says_so():
    place = np.array([4e6, 5e6, 0])  # 32-bit numbers have steps of 0.25 and 0.5 there
    vertices, faces = shapes.hill(12, 12)
    vertices[:, 2] = 0
    text = "".join("v {:.1f} {:.1f} {:.1f}\n".format(*point) for point in 0.3 * vertices + place)
    text += "".join(f"f {a} {b} {c}\n" for a, b, c in faces + 1)
    for content, name, step in (
        (rounded_stl(3 * vertices + place, faces), "a.stl", "0.5"),
        (text.encode(), "a.obj", "0.1"),
    ):
        notes = coneflat.flatten(read_mesh_from(content, name), repair=True, method="linear").notes
        assert any(f"because its coordinates are rounded to steps of {step}:" in note for note in notes), (
            notes
        )
    with pytest.raises(
        ConeflatError, match=r"rounded to steps of 0.5; move the model to the origin before it is saved"
    ):
        coneflat.flatten(read_mesh_from(rounded_stl(0.01 * vertices + place, faces), "b.stl"), repair=True)


def test_degenerate_triangles_of_exact_numbers_are_not_blamed_on_rounding():
    vertices, faces = shapes.hill(6, 6)
    faces = np.concatenate([faces, [[0, 1, 1]]])
    far_terrain = np.array([4e5, 5e6, 100]) + np.rint(vertices * [60, 60, 1000]) / [1, 1, 100]
    for points in (vertices, vertices + 1e6, np.rint(60 * vertices), far_terrain):
        notes = coneflat.flatten(points, faces, repair=True).notes
        assert any("with the same vertex twice" in note for note in notes)
        assert not any("rounded to steps" in note for note in notes)


def test_sizes_beyond_32_bits_are_refused():
    vertices, faces = shapes.hill(3, 3)
    with pytest.raises(MeshFileError, match=r"beyond the 32-bit numbers of \.glb"):
        coneflat.flatten(1e20 * vertices, faces).as_written(".glb")


@pytest.mark.parametrize("height", [0.0, 1.5])
def test_the_step_of_a_flat_map_is_that_of_its_extended_axes(height):
    """A map rounded to metres, on a plane."""
    vertices, faces = shapes.grid(12, 12)
    vertices = np.round(vertices * 11 * 0.3 + [5e5, 5e6, 0])
    vertices[:, 2] = height
    step, count = coarse_step(vertices, faces)
    assert step == 1.0
    assert count > 0


def test_a_point_at_the_origin_is_not_put_down_to_rounding():
    assert coarse_step(np.zeros((3, 3)), np.array([[0, 1, 2]])) == (0.0, 0)


def test_errors_of_float_faces_are_those_of_integer_faces():
    with pytest.raises(ConeflatError, match="3 faces with the same vertex twice"):
        coneflat.flatten(np.eye(3), np.zeros((3, 3)))
