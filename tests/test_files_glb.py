"""glTF scenes, read and written again."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest
from scenes import PNG, SceneMaker, corners_of, opened, rich_scene
from shapes import join, sphere

import coneflat
from coneflat.files import read_mesh, read_mesh_from
from coneflat.files.read import read_joined

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
        for name in (
            "scene",
            "scenes",
            "materials",
            "samplers",
            "textures",
            "skins",
            "animations",
            "cameras",
        ):
            assert new[name] == old[name]
        for name in ("asset", "extensions", "extensionsUsed", "extras"):
            assert new[name] == old[name]
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
                assert after.get("material") == before.get("material")
                assert after.get("extras") == before.get("extras")
                if before.get("mode") == 1:
                    assert after["mode"] == 1
                    np.testing.assert_array_equal(old_values(before["indices"]), new_values(after["indices"]))
                    continue
                here, there = corners_of(old, old_values, before), corners_of(new, new_values, after)
                assert set(after["attributes"]) == set(before["attributes"]) | {"TEXCOORD_0"}
                pairs = [
                    (before["attributes"][name], after["attributes"][name])
                    for name in before["attributes"]
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
        assert compared == 2 * (8 + 2) + 2

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

    def test_trimesh_sees_the_scene(self, rich, tmp_path):
        content, result = rich
        (tmp_path / "in.glb").write_bytes(content)
        old = trimesh.load_scene(tmp_path / "in.glb", process=False)
        new = trimesh.load_scene(result.save(tmp_path / "out.glb"), process=False)
        # It gives primitives of a mesh nodes of their own, with a random ending.
        names = [{name.split("_")[0] for name in scene.graph.nodes} for scene in (old, new)]
        assert names[0] == names[1]
        for scene in (old, new):
            triangles = np.concatenate(
                [one.vertices[one.faces] for one in scene.dump() if hasattr(one, "faces")]
            )
            assert len(triangles) == len(result.faces)
        np.testing.assert_allclose(old.bounds, new.bounds, atol=1e-6)

    def test_the_geometry_read_again_is_the_same(self, rich, tmp_path):
        content, result = rich
        old, new = read_mesh_from(content, "a.glb"), read_mesh(result.save(tmp_path / "out.glb"))
        assert new.vertices[new.corners].tobytes() == old.vertices[old.corners].tobytes()
        np.testing.assert_allclose(new.uv[new.texture], result.corner_uv.reshape(-1, 2), atol=1e-7)
        kept = new.normals[new.normal[new.normal >= 0]]
        np.testing.assert_array_equal(kept, old.normals[old.normal[old.normal >= 0]])


def two_balls(apart):
    """Return the GLB of two balls that touch in a point, of two nodes, or of one."""
    make = SceneMaker()
    ball = sphere(1)
    top, bottom = ball[0][ball[0][:, 2].argmax()], ball[0][ball[0][:, 2].argmin()]
    other = (ball[0] + top - bottom).astype("f4").astype(float)
    # In the numbers of the file, the point is the same.
    other[ball[0][:, 2].argmin()] = top
    parts = [ball, (other, ball[1])] if apart else [join(ball, (other, ball[1]))]
    meshes = [
        {
            "primitives": [
                {"attributes": {"POSITION": make.accessor(points)}, "indices": make.accessor(f.ravel(), 5125)}
            ]
        }
        for points, f in parts
    ]
    nodes = [{"mesh": i, "name": f"ball {i}"} for i in range(len(meshes))]
    make.tree |= {"meshes": meshes, "nodes": nodes, "scenes": [{"nodes": list(range(len(nodes)))}]}
    return make.glb()


class TestWelding:
    def test_nodes_that_touch_stay_apart(self, tmp_path):
        (tmp_path / "balls.glb").write_bytes(two_balls(apart=True))
        result = coneflat.flatten(tmp_path / "balls.glb")
        assert result.distortion.charts == 2
        tree, _, _ = opened(result.save(tmp_path / "out.glb").read_bytes())
        assert [node["name"] for node in tree["nodes"]] == ["ball 0", "ball 1"]

    def test_what_touches_within_a_node_is_one(self, tmp_path):
        (tmp_path / "balls.glb").write_bytes(two_balls(apart=False))
        with pytest.raises(coneflat.errors.NonManifoldError, match="touch in a single point"):
            coneflat.flatten(tmp_path / "balls.glb")

    def test_primitives_of_a_mesh_are_one_surface(self):
        mesh = read_mesh_from(rich_scene(), "rich.glb")
        vertices, faces = sphere(1)
        ball = mesh.corners[: faces.size]
        assert len(np.unique(ball)) == len(vertices)

    def test_a_mesh_that_two_nodes_show_has_uvs_for_each(self, pair):
        _, (new, values, _), _ = pair
        uvs = [values(new["meshes"][i]["primitives"][0]["attributes"]["TEXCOORD_0"]) for i in (1, 2)]
        assert not np.array_equal(*uvs)

    def test_sheets_of_two_nodes_with_one_border_stay_apart_on_the_command_line(self, tmp_path):
        make = SceneMaker()
        sheet = np.array([[x, y, 0.2 * x * y] for x in range(3) for y in range(3)], dtype=float)
        order = [v for a in (0, 1, 3, 4) for v in (a, a + 3, a + 4, a, a + 4, a + 1)]
        for points in (sheet, np.column_stack([sheet[:, 0] - 2, sheet[:, 1], 0 * sheet[:, 2]])):
            one = {"attributes": {"POSITION": make.accessor(points)}, "indices": make.accessor(order, 5121)}
            make.tree.setdefault("meshes", []).append({"primitives": [one]})
        make.tree |= {"nodes": [{"mesh": 0}, {"mesh": 1}], "scenes": [{"nodes": [0, 1]}]}
        (tmp_path / "sheets.glb").write_bytes(make.glb())
        joined = read_joined(tmp_path / "sheets.glb")
        assert len(joined.mesh.vertices) == 18
        assert joined.edges == 0
        assert coneflat.flatten(joined.mesh, charts="one").distortion.charts == 2


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
        assert (
            result.as_written(".glb").notes[-1] == "Triangles that the repair dropped are not in the file: 3."
        )
        tree, values, _ = opened(result.save(tmp_path / "out.glb").read_bytes())
        assert [len(mesh["primitives"]) for mesh in tree["meshes"]] == [1, 1]
        assert ["mesh" in node for node in tree["nodes"]] == [True, False]
        assert values(tree["meshes"][0]["primitives"][0]["indices"]).size == 6
        assert len(read_mesh(tmp_path / "out.glb").corners) == 6

    def test_copies_and_painted_textures_are_named(self, rich):
        *_, copies, painted = rich[1].as_written(".glb").notes
        assert copies == "Meshes that several nodes show have UVs of their own for each: 1 more of them."
        assert painted == "Textures are kept, but were made for the old UVs: those of 1 material."
        assert rich[1].as_written(".npz") is rich[1]


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
