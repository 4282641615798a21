"""glTF scenes, read and written again."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest
from gltf_scenes import PNG, SceneMaker, corners_of, opened, rich_scene
from shapes import sphere

import coneflat
from coneflat.io import read_mesh, read_mesh_from

trimesh = pytest.importorskip("trimesh")


@pytest.fixture(scope="module")
def rich():
    """Return a GLB, and that of its flattening, both opened."""
    content = rich_scene()
    result = coneflat.flatten(read_mesh_from(content, "rich.glb"), charts="atlas")
    return content, result


@pytest.fixture
def pair(rich, tmp_path):
    content, result = rich
    return opened(content), opened(result.save(tmp_path / "out.glb").read_bytes()), result


class TestScene:
    def test_all_but_the_triangles_stays_as_it_is(self, pair):
        (old, _, old_view), (new, _, new_view), _ = pair
        kept = "scene scenes materials samplers textures skins animations cameras asset extensions extras"
        for name in (*kept.split(), "extensionsUsed"):
            assert new[name][: len(old[name])] == old[name] if name == "materials" else new[name] == old[name]
        for one, other in zip(old["nodes"], new["nodes"], strict=True):
            assert {**one, "mesh": 0} == {**other, "mesh": 0}
        assert [node.get("mesh") for node in new["nodes"]] == [None, 0, 1, None, 2]
        assert [mesh["name"] for mesh in new["meshes"]] == ["body", "strip", "strip"]
        assert new["meshes"][0]["weights"] == [0, 0]
        assert new["meshes"][0]["extras"] == old["meshes"][0]["extras"]
        (image,) = new["images"]
        assert image["name"] == "skin"
        assert new_view(image["bufferView"]) == old_view(old["images"][0]["bufferView"]) == PNG

    def test_every_attribute_of_every_corner_is_the_same_bit_for_bit(self, pair):
        (old, old_values, _), (new, new_values, _), _ = pair
        compared = 0
        for node in range(5):
            if "mesh" not in old["nodes"][node]:
                continue
            primitives = zip(
                old["meshes"][old["nodes"][node]["mesh"]]["primitives"],
                new["meshes"][new["nodes"][node]["mesh"]]["primitives"],
                strict=True,
            )
            for before, after in primitives:
                plain = None if before.get("mode") == 1 else len(old["materials"])
                assert after.get("material") == before.get("material", plain)
                assert after.get("extras") == before.get("extras")
                if before.get("mode") == 1:
                    assert after["mode"] == 1
                    np.testing.assert_array_equal(old_values(before["indices"]), new_values(after["indices"]))
                    continue
                here, there = corners_of(old, old_values, before), corners_of(new, new_values, after)
                kept = set(before["attributes"])
                # Tangents are those of the normal map's UVs, which are the second ones of the lower half.
                kept -= {"TANGENT"} if before.get("material") == 0 else set()
                assert set(after["attributes"]) == kept | {"TEXCOORD_0"}
                pairs = [
                    (before["attributes"][name], after["attributes"][name])
                    for name in kept
                    if name != "TEXCOORD_0"
                ]
                for one, other in zip(before.get("targets", []), after.get("targets", []), strict=True):
                    pairs += [(one[name], other[name]) for name in one]
                for one, other in pairs:
                    forms = [
                        {k: tree["accessors"][i].get(k) for k in ("componentType", "type", "normalized")}
                        for tree, i in ((old, one), (new, other))
                    ]
                    assert forms[0] == forms[1]
                    assert old_values(one)[here].tobytes() == new_values(other)[there].tobytes()
                    compared += 1
        assert compared == 2 * (8 + 2) + 2 - 1

    def test_the_uvs_are_those_of_the_result(self, pair):
        _, (new, values, _), result = pair
        found = []
        for node in new["nodes"]:
            for one in new["meshes"][node["mesh"]]["primitives"] if "mesh" in node else []:
                if "TEXCOORD_0" in one["attributes"]:
                    corners = corners_of(new, values, one)
                    found.append(values(one["attributes"]["TEXCOORD_0"])[corners].reshape(-1, 3, 2))
        # Nodes in depth-first order: the ball, the mirrored ribbon, whose corners run the other way, the other one.
        found[2] = found[2][:, ::-1]
        expected = result.as_written(".glb").corner_uv * [1, -1] + [0, 1]
        np.testing.assert_array_equal(np.concatenate(found), expected)

    def test_nothing_of_the_old_arrays_stays_behind(self, rich, tmp_path):
        _, result = rich
        once = result.save(tmp_path / "once.glb")
        twice = coneflat.flatten(once, charts="atlas").save(tmp_path / "twice.glb")
        one, other = opened(once.read_bytes())[0], opened(twice.read_bytes())[0]
        assert len(other["accessors"]) == len(one["accessors"])
        assert len(other["bufferViews"]) == len(one["bufferViews"])
        assert twice.stat().st_size < 1.2 * once.stat().st_size


def two_balls():
    """Return the GLB of two balls that touch in a point, of a node each."""
    make = SceneMaker()
    ball = sphere(1)
    top, bottom = ball[0][ball[0][:, 2].argmax()], ball[0][ball[0][:, 2].argmin()]
    other = (ball[0] + top - bottom).astype("f4").astype(float)
    # In the numbers of the file, the point is the same.
    other[ball[0][:, 2].argmin()] = top
    for points in (ball[0], other):
        one = {
            "attributes": {"POSITION": make.accessor(points)},
            "indices": make.accessor(ball[1].ravel(), 5125),
        }
        make.tree.setdefault("meshes", []).append({"primitives": [one]})
    make.tree |= {"nodes": [{"mesh": i, "name": f"ball {i}"} for i in (0, 1)], "scenes": [{"nodes": [0, 1]}]}
    return make.glb()


class TestWelding:
    def test_nodes_that_touch_stay_apart(self, tmp_path):
        (tmp_path / "balls.glb").write_bytes(two_balls())
        result = coneflat.flatten(tmp_path / "balls.glb")
        assert result.distortion.charts == 2
        tree, _, _ = opened(result.save(tmp_path / "out.glb").read_bytes())
        assert [node["name"] for node in tree["nodes"]] == ["ball 0", "ball 1"]

    def test_primitives_of_a_mesh_are_one_surface(self):
        mesh = read_mesh_from(rich_scene(), "rich.glb")
        vertices, faces = sphere(1)
        ball = mesh.corners[: faces.size]
        assert len(np.unique(ball)) == len(vertices)


class TestLosses:
    def test_a_repair_names_the_triangles_that_are_gone(self, tmp_path):
        make = SceneMaker()
        points = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
        order = [0, 1, 2, 0, 2, 3, 1, 1, 2]
        one = {"attributes": {"POSITION": make.accessor(points)}, "indices": make.accessor(order, 5121)}
        lost = {"attributes": one["attributes"], "indices": make.accessor([3, 3, 0], 5121)}
        make.tree |= {"meshes": [{"primitives": [one, lost]}, {"primitives": [lost]}]}
        make.tree |= {"nodes": [{"mesh": 0}, {"mesh": 1}], "scenes": [{"nodes": [0, 1]}]}
        result = coneflat.flatten(read_mesh_from(make.glb(), "a.glb"), repair=True)
        assert "Triangles that the repair dropped are not in the file: 3." in result.as_written(".glb").notes
        tree, values, _ = opened(result.save(tmp_path / "out.glb").read_bytes())
        assert [len(mesh["primitives"]) for mesh in tree["meshes"]] == [1, 1]
        assert ["mesh" in node for node in tree["nodes"]] == [True, False]
        assert values(tree["meshes"][0]["primitives"][0]["indices"]).size == 6
        assert len(read_mesh(tmp_path / "out.glb").corners) == 6

    def test_copies_and_painted_textures_are_named(self, rich):
        *_, copies, bare, tangents, painted = rich[1].as_written(".glb").notes
        assert bare.startswith("2 primitives without a material got the default material of glTF")
        assert tangents.startswith("Tangents of the old UVs are not in the file")
        assert copies == "Meshes of several nodes were copied, to have UVs for each node: 1 copy."
        assert painted.startswith(
            "The textures of 2 materials are kept, but were made for the old UVs; `coneflat tr"
        )
        *_, lost = rich[1].as_written(".npz").notes
        assert lost.startswith("These data of the input are not kept in .npz: vertex attributes (")


class TestFilesBeside:
    def test_a_gltf_with_files_becomes_one_glb(self, rich, tmp_path):
        content, _ = rich
        length = struct.unpack_from("<I", content, 12)[0]
        tree = json.loads(content[20 : 20 + length])
        folder = tmp_path / "in"
        folder.mkdir()
        (folder / "a b.bin").write_bytes(content[28 + length :])
        tree["buffers"][0]["uri"] = "a%20b.bin"
        (folder / "skin.png").write_bytes(PNG)
        tree["images"] = [{"uri": "skin.png"}, {"uri": "gone%20away.png"}]
        (folder / "rich.gltf").write_text(json.dumps(tree))
        result = coneflat.flatten(folder / "rich.gltf")
        new, _, view = opened(result.save(tmp_path / "out.glb").read_bytes())
        assert view(new["images"][0]["bufferView"]) == PNG
        assert new["images"][1]["uri"] == "in/gone%20away.png"
        assert "uri" not in new["buffers"][0]

    def test_a_checkerboard_takes_the_place_of_the_materials(self, rich, tmp_path):
        _, result = rich
        new, _, view = opened(result.save(tmp_path / "out.glb", texture="checker").read_bytes())
        shown = {
            one.get("material")
            for mesh in new["meshes"]
            for one in mesh["primitives"]
            if one.get("mode") != 1
        }
        (number,) = shown
        index = new["materials"][number]["pbrMetallicRoughness"]["baseColorTexture"]["index"]
        image = new["images"][new["textures"][index]["source"]]
        assert view(image["bufferView"]).startswith(b"\x89PNG")
        assert view(image["bufferView"]) != PNG
        assert [one["name"] for one in new["materials"][:2]] == ["upper", "lower"]

    def test_primitives_without_a_material_get_a_plain_one(self, tmp_path):
        trimesh.creation.icosphere(2).export(tmp_path / "in.glb")
        tree, _, _ = opened((tmp_path / "in.glb").read_bytes())
        assert "materials" not in tree
        coneflat.flatten(tmp_path / "in.glb").save(tmp_path / "out.glb")
        assert trimesh.load(tmp_path / "out.glb", force="mesh").visual.uv is not None
