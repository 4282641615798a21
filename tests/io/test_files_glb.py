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
        (old, _, old_view), (tree, _, new_view), _ = pair
        names = "scene scenes materials samplers textures skins animations cameras asset extensions extras"
        for name in (*names.split(), "extensionsUsed"):
            assert (
                tree[name][: len(old[name])] == old[name] if name == "materials" else tree[name] == old[name]
            )
        for old_node, tree_node in zip(old["nodes"], tree["nodes"], strict=True):
            assert {**old_node, "mesh": 0} == {**tree_node, "mesh": 0}
        assert [node.get("mesh") for node in tree["nodes"]] == [None, 0, 1, None, 2]
        assert [mesh["name"] for mesh in tree["meshes"]] == ["body", "strip", "strip"]
        assert tree["meshes"][0]["weights"] == [0, 0]
        assert tree["meshes"][0]["extras"] == old["meshes"][0]["extras"]
        (image,) = tree["images"]
        assert image["name"] == "skin"
        assert new_view(image["bufferView"]) == old_view(old["images"][0]["bufferView"]) == PNG

    def test_every_attribute_of_every_corner_is_the_same_bit_for_bit(self, pair):
        (old, old_values, _), (written, written_values, _), _ = pair
        compared = 0
        for node in range(5):
            if "mesh" not in old["nodes"][node]:
                continue
            primitives = zip(
                old["meshes"][old["nodes"][node]["mesh"]]["primitives"],
                written["meshes"][written["nodes"][node]["mesh"]]["primitives"],
                strict=True,
            )
            for before, after in primitives:
                plain = None if before.get("mode") == 1 else len(old["materials"])
                assert after.get("material") == before.get("material", plain)
                assert after.get("extras") == before.get("extras")
                if before.get("mode") == 1:
                    assert after["mode"] == 1
                    np.testing.assert_array_equal(
                        old_values(before["indices"]), written_values(after["indices"])
                    )
                    continue
                old_corners, written_corners = (
                    corners_of(old, old_values, before),
                    corners_of(written, written_values, after),
                )
                copied = set(before["attributes"])
                # Tangents are those of the normal map's UVs, which are the second ones of the lower half.
                copied -= {"TANGENT"} if before.get("material") == 0 else set()
                assert set(after["attributes"]) == copied | {"TEXCOORD_0"}
                pairs = [
                    (before["attributes"][name], after["attributes"][name])
                    for name in copied
                    if name != "TEXCOORD_0"
                ]
                for old_item, written_item in zip(
                    before.get("targets", []), after.get("targets", []), strict=True
                ):
                    pairs += [(old_item[name], written_item[name]) for name in old_item]
                for old_item, written_item in pairs:
                    forms = [
                        {k: tree["accessors"][i].get(k) for k in ("componentType", "type", "normalized")}
                        for tree, i in ((old, old_item), (written, written_item))
                    ]
                    assert forms[0] == forms[1]
                    assert (
                        old_values(old_item)[old_corners].tobytes()
                        == written_values(written_item)[written_corners].tobytes()
                    )
                    compared += 1
        assert compared == 2 * (8 + 2) + 2 - 1

    def test_the_uvs_are_those_of_the_result(self, pair):
        _, (tree, values, _), result = pair
        uvs = []
        for node in tree["nodes"]:
            for primitive in tree["meshes"][node["mesh"]]["primitives"] if "mesh" in node else []:
                if "TEXCOORD_0" in primitive["attributes"]:
                    corners = corners_of(tree, values, primitive)
                    uvs.append(values(primitive["attributes"]["TEXCOORD_0"])[corners].reshape(-1, 3, 2))
        # Nodes in depth-first order: the ball, the mirrored ribbon, whose corners run the other way, the other one.
        uvs[2] = uvs[2][:, ::-1]
        expected = result.as_written(".glb").corner_uv * [1, -1] + [0, 1]
        np.testing.assert_array_equal(np.concatenate(uvs), expected)

    def test_nothing_of_the_old_arrays_stays_behind(self, rich, tmp_path):
        _, result = rich
        once = result.save(tmp_path / "once.glb")
        twice = coneflat.flatten(once, charts="atlas").save(tmp_path / "twice.glb")
        first_tree, second_tree = opened(once.read_bytes())[0], opened(twice.read_bytes())[0]
        assert len(second_tree["accessors"]) == len(first_tree["accessors"])
        assert len(second_tree["bufferViews"]) == len(first_tree["bufferViews"])
        assert twice.stat().st_size < 1.2 * once.stat().st_size


def two_balls():
    """Return the GLB of two balls that touch in a point, of a node each."""
    make = SceneMaker()
    ball = sphere(1)
    top, bottom = ball[0][ball[0][:, 2].argmax()], ball[0][ball[0][:, 2].argmin()]
    second_ball = (ball[0] + top - bottom).astype("f4").astype(float)
    # In the numbers of the file, the point is the same.
    second_ball[ball[0][:, 2].argmin()] = top
    for points in (ball[0], second_ball):
        primitive = {
            "attributes": {"POSITION": make.accessor(points)},
            "indices": make.accessor(ball[1].ravel(), 5125),
        }
        make.tree.setdefault("meshes", []).append({"primitives": [primitive]})
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
        primitive = {"attributes": {"POSITION": make.accessor(points)}, "indices": make.accessor(order, 5121)}
        lost = {"attributes": primitive["attributes"], "indices": make.accessor([3, 3, 0], 5121)}
        make.tree |= {"meshes": [{"primitives": [primitive, lost]}, {"primitives": [lost]}]}
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
        # The normal map of the other material has the second set of UVs, which is as before.
        assert painted.startswith(
            "The textures of 1 material are kept, but were made for the old UVs; `coneflat tr"
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
        written, _, view = opened(result.save(tmp_path / "out.glb").read_bytes())
        assert view(written["images"][0]["bufferView"]) == PNG
        assert written["images"][1]["uri"] == "in/gone%20away.png"
        assert "uri" not in written["buffers"][0]

    def test_a_checkerboard_takes_the_place_of_the_materials(self, rich, tmp_path):
        _, result = rich
        tree, _, view = opened(result.save(tmp_path / "out.glb", texture="checker").read_bytes())
        shown = {
            item.get("material")
            for mesh in tree["meshes"]
            for item in mesh["primitives"]
            if item.get("mode") != 1
        }
        (number,) = shown
        index = tree["materials"][number]["pbrMetallicRoughness"]["baseColorTexture"]["index"]
        image = tree["images"][tree["textures"][index]["source"]]
        assert view(image["bufferView"]).startswith(b"\x89PNG")
        assert view(image["bufferView"]) != PNG
        assert [item["name"] for item in tree["materials"][:2]] == ["upper", "lower"]

    def test_primitives_without_a_material_get_a_plain_one(self, tmp_path):
        trimesh.creation.icosphere(2).export(tmp_path / "in.glb")
        tree, _, _ = opened((tmp_path / "in.glb").read_bytes())
        assert "materials" not in tree
        coneflat.flatten(tmp_path / "in.glb").save(tmp_path / "out.glb")
        assert trimesh.load(tmp_path / "out.glb", force="mesh").visual.uv is not None
