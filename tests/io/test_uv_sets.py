"""UVs as a second set of a GLB, beside those of the textures."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest
from command import command
from gltf_scenes import SceneMaker, corners_of, opened, rich_scene
from shapes import sphere

import coneflat
from coneflat.apps.batch import find_jobs
from coneflat.errors import MissingUVError, OptionError
from coneflat.io import read_mesh_from, write_measured

# The corners of the ball, whose two materials are parts of it, are compared in the numbers of the file.
SETS = ("TEXCOORD_0", "TEXCOORD_1")


@pytest.fixture(scope="module")
def rich():
    """Return a GLB with two UV sets, and its UVs."""
    content = rich_scene()
    return content, coneflat.unwrap(read_mesh_from(content, "rich.glb"))


@pytest.fixture
def pair(rich, tmp_path):
    content, result = rich
    return opened(content), opened(result.save(tmp_path / "out.glb", uv_set=1).read_bytes()), result


def primitives_of(tree, values):
    """Return the primitives of triangles that nodes show, depth first, with the vertices of their corners."""
    primitives = []
    for node in tree["nodes"]:
        for primitive in tree["meshes"][node["mesh"]]["primitives"] if "mesh" in node else []:
            if primitive.get("mode") != 1:
                primitives.append((primitive, corners_of(tree, values, primitive)))
    return primitives


def textured_square(attributes, material=True):
    """Return the GLB of a square with UVs by the name of their set."""
    make = SceneMaker()
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    arrays = {name: make.accessor(values) for name, values in attributes.items()}
    primitive = {
        "attributes": {"POSITION": make.accessor(points), **arrays},
        "indices": make.accessor(np.array([0, 1, 2, 0, 2, 3]), 5125),
    }
    make.tree |= {"meshes": [{"primitives": [primitive]}], "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}]}
    if material:
        primitive["material"] = 0
        make.tree["materials"] = [{"normalTexture": {"index": 0, "texCoord": 0}}]
        make.tree["textures"] = [{"source": 0}]
        make.tree["images"] = [{"uri": "data:image/png;base64,"}]
    return make.glb()


class TestScene:
    def test_all_but_the_second_set_is_the_same_bit_for_bit_at_every_corner(self, pair):
        (old, old_values, _), (written, written_values, _), _ = pair
        compared = 0
        for (before, vertices), (after, new_vertices) in zip(
            primitives_of(old, old_values), primitives_of(written, written_values), strict=True
        ):
            attributes = set(before["attributes"]) - {"TEXCOORD_1"}
            # The normal map of the lower half has the second set, and its tangents with it.
            attributes -= {"TANGENT"} if before.get("material") == 1 else set()
            assert set(after["attributes"]) == attributes | {*SETS}
            for name in attributes:
                old_rows, rows = (
                    values(item["attributes"][name])[corners]
                    for values, item, corners in (
                        (old_values, before, vertices),
                        (written_values, after, new_vertices),
                    )
                )
                assert old_rows.tobytes() == rows.tobytes()
                compared += 1
        assert compared == 8 + 7 + 1 + 1

    def test_materials_and_images_refer_to_what_they_did(self, pair):
        (old, _, old_view), (written, _, new_view), _ = pair
        assert written["materials"][: len(old["materials"])] == old["materials"]
        assert written["textures"] == old["textures"]
        assert new_view(written["images"][0]["bufferView"]) == old_view(old["images"][0]["bufferView"])

    def test_the_second_set_has_the_uvs_of_the_result(self, pair):
        _, (tree, values, _), result = pair
        uvs = [
            values(primitive["attributes"]["TEXCOORD_1"])[corners].reshape(-1, 3, 2)
            for primitive, corners in primitives_of(tree, values)
        ]
        uvs[2] = uvs[2][:, ::-1]  # a mirrored node
        expected = result.as_written(".glb", uv_set=1).corner_uv * [1, -1] + [0, 1]
        np.testing.assert_array_equal(np.concatenate(uvs), expected)

    def test_a_vertex_is_split_only_where_a_set_needs_it(self, pair):
        _, (tree, values, _), _ = pair
        for primitive, _ in primitives_of(tree, values):
            names = primitive["attributes"]
            rows = np.concatenate(
                [
                    np.asarray(values(names[name]), float).reshape(len(values(names[name])), -1)
                    for name in names
                ],
                axis=1,
            )
            assert len(np.unique(rows, axis=0)) == len(rows)

    def test_primitives_without_uvs_have_the_first_set_too(self, pair):
        _, (tree, values, _), _ = pair
        ribbon = primitives_of(tree, values)[2][0]["attributes"]
        assert ribbon["TEXCOORD_0"] == ribbon["TEXCOORD_1"]

    def test_what_changes_is_noted(self, rich):
        notes = " ".join(rich[1].as_written(".glb", uv_set=1).notes)
        assert "TEXCOORD_1 of 2 primitives is replaced." in notes
        assert "2 primitives without UVs got the new ones as TEXCOORD_0, too." in notes
        assert "The textures of 1 material are kept, but use TEXCOORD_1, which is replaced." in notes
        assert "TEXCOORD_1" not in " ".join(rich[1].as_written(".glb").notes)

    @pytest.mark.parametrize(("uv_set", "is_outdated"), [(0, True), (1, False)])
    def test_textures_of_the_other_set_are_not_outdated(self, uv_set, is_outdated):
        square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
        result = coneflat.unwrap(read_mesh_from(textured_square({"TEXCOORD_0": square}), "a.glb"))
        notes = result.as_written(".glb", uv_set=uv_set).notes
        assert any("old UVs" in note or "replaced" in note for note in notes) == is_outdated

    @pytest.mark.parametrize("uv_set", [None, 0, 1])
    @pytest.mark.parametrize("options", [{}, {"lightmap": 128}])
    def test_the_notes_of_a_written_file_are_those_of_its_set_alone(self, tmp_path, options, uv_set):
        for content in (rich_scene(), textured_square({})):
            result = coneflat.unwrap(read_mesh_from(content, "a.glb"), **options)
            written = write_measured(result, tmp_path / "out.glb", uv_set=uv_set)
            assert written.notes == result.as_written(".glb", uv_set=uv_set).notes

    def test_writing_again_changes_nothing(self, tmp_path):
        square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
        result = coneflat.unwrap(read_mesh_from(textured_square({"TEXCOORD_0": square}), "a.glb"))
        once = result.save(tmp_path / "once.glb", uv_set=1)
        twice = coneflat.unwrap(once).save(tmp_path / "twice.glb", uv_set=1)
        assert once.read_bytes() == twice.read_bytes()


def read_sets(path):
    """Return the UVs of the first primitive of a GLB, by their sets, at all corners, with their positions."""
    tree, values, _ = opened(path.read_bytes())
    primitive, corners = primitives_of(tree, values)[0]
    return tree, {name: values(primitive["attributes"][name])[corners] for name in ("POSITION", *SETS)}


class TestOneMesh:
    def test_uvs_of_an_obj_are_the_first_set(self, tmp_path):
        vertices, faces = sphere(1)
        uv = np.round(np.random.default_rng(0).random((3 * len(faces), 2)), 3)
        lines = [f"v {x} {y} {z}" for x, y, z in vertices.tolist()] + [f"vt {u} {v}" for u, v in uv.tolist()]
        lines += [
            "f " + " ".join(f"{v + 1}/{3 * i + c + 1}" for c, v in enumerate(face))
            for i, face in enumerate(faces.tolist())
        ]
        (tmp_path / "a.obj").write_text("\n".join(lines) + "\n")
        result = coneflat.unwrap(tmp_path / "a.obj")
        _, sets = read_sets(result.save(tmp_path / "a.glb", uv_set=1))
        np.testing.assert_allclose(sets["TEXCOORD_0"] * [1, -1] + [0, 1], uv, atol=1e-6)
        written = result.as_written(".glb", uv_set=1)
        np.testing.assert_array_equal(
            sets["TEXCOORD_1"].reshape(-1, 3, 2) * [1, -1] + [0, 1], written.corner_uv
        )

    def test_a_mesh_without_uvs_has_them_in_both_sets(self, tmp_path):
        result = coneflat.unwrap(*sphere(1))
        _, sets = read_sets(result.save(tmp_path / "a.glb", uv_set=1))
        np.testing.assert_array_equal(sets["TEXCOORD_0"], sets["TEXCOORD_1"])
        assert result.as_written(".glb", uv_set=1).notes == (
            "The input has no UVs: both UV sets of the file are the new ones.",
        )

    @pytest.mark.parametrize("uv_set", [None, 0, 1])
    def test_the_notes_of_a_written_file_are_those_of_its_set_alone(self, tmp_path, uv_set):
        result = coneflat.unwrap(*sphere(1), lightmap=128)
        written = write_measured(result, tmp_path / "out.glb", uv_set=uv_set)
        is_second = uv_set != 0
        assert any("both UV sets" in note for note in written.notes) == is_second

    def test_a_command_names_textures_of_the_old_uvs_only_if_these_are_replaced(self, tmp_path):
        (tmp_path / "a.glb").write_bytes(
            textured_square({"TEXCOORD_0": np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)})
        )
        for uv_set in ("0", "1"):
            done = command("unwrap", "a.glb", "-o", "b.glb", "--uv-set", uv_set, cwd=tmp_path)
            assert done.returncode == 0
            assert ("made for the old UVs" in " ".join((done.stdout + done.stderr).split())) == (
                uv_set == "0"
            )

    def test_corners_without_uvs_are_counted(self, tmp_path):
        (tmp_path / "a.obj").write_text(
            "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0.5 0.5\nf 1/1 2/1 3/1\nf 1 3 4\n"
        )
        result = coneflat.unwrap(tmp_path / "a.obj")
        assert (
            "TEXCOORD_0 is (0, 0) at 3 triangle corners without UVs."
            in result.as_written(".glb", uv_set=1).notes
        )

    def test_an_image_is_shown_by_the_uvs_it_was_given_for(self, tmp_path):
        result = coneflat.unwrap(*sphere(1))
        for uv_set in (0, 1):
            tree, _, _ = opened(
                result.save(tmp_path / "a.glb", texture="checker", uv_set=uv_set).read_bytes()
            )
            slot = tree["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]
            assert slot.get("texCoord", 0) == uv_set


class TestErrors:
    @pytest.mark.parametrize("ending", [".obj", ".ply", ".npz"])
    def test_formats_without_a_second_set(self, ending, tmp_path):
        result = coneflat.unwrap(*sphere(1))
        with pytest.raises(OptionError, match=r"only \.glb files have a second UV set, and .* is not one"):
            result.save(tmp_path / f"a{ending}", uv_set=1)
        assert not list(tmp_path.iterdir())
        result.save(tmp_path / f"a{ending}", uv_set=0)

    @pytest.mark.parametrize(
        "uv_set", [2, -1, "1", 1.0, 1.5, True, np.array([0, 1]), np.array(1.0), [1], "0"]
    )
    def test_other_sets(self, uv_set, tmp_path):
        for result in (
            coneflat.unwrap(*sphere(1)),
            coneflat.unwrap(read_mesh_from(textured_square({}), "a.glb")),
        ):
            for call in (
                lambda result=result: result.save(tmp_path / "a.glb", uv_set=uv_set),
                lambda result=result: result.as_written(".glb", uv_set=uv_set),
            ):
                with pytest.raises(OptionError, match="uv_set must be 0 or 1"):
                    call()

    def test_integers_of_numpy_are_sets(self, rich, tmp_path):
        written = [
            rich[1].save(tmp_path / f"{i}.glb", texture="checker", uv_set=uv_set)
            for i, uv_set in enumerate((1, np.int64(1)))
        ]
        assert written[0].read_bytes() == written[1].read_bytes()

    def test_commands_say_so_in_a_line_before_they_start(self, tmp_path):
        (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n")
        for arguments in (
            ("unwrap", "a.obj", "-o", "b.obj", "--uv-set", "1"),
            ("flatten", "a.obj", "-o", "-", "--format", "ply", "--uv-set", "1"),
            ("batch", "a.obj", "--out", "flat", "--uv-set", "1"),
        ):
            done = command(*arguments, cwd=tmp_path)
            assert done.returncode == 2
            assert len(done.stderr.splitlines()) == 1
            assert "only .glb files have a second UV set" in done.stderr
        assert [path.name for path in tmp_path.iterdir()] == ["a.obj"]


def attributes_in(path):
    """Return the names of the attributes of the first primitive of a GLB."""
    content = path.read_bytes()
    (length,) = struct.unpack_from("<I", content, 12)
    return set(json.loads(content[20 : 20 + length])["meshes"][0]["primitives"][0]["attributes"])


def test_batches_write_the_set(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n")
    arguments = ("batch", "a.obj", "--out", "flat", "--format", "glb", "--jobs", "1")
    assert command(*arguments, "--uv-set", "1", cwd=tmp_path).returncode == 0
    assert attributes_in(tmp_path / "flat/a.glb") >= {*SETS}
    # Another set is another result.
    marks = {
        job.mark
        for uv_set in (None, 0, 1)
        for job in find_jobs([str(tmp_path / "a.obj")], tmp_path / "flat", ".glb", {}, None, (), uv_set)
    }
    assert len(marks) == 3


class TestReading:
    """UV sets that files have, read by number."""

    FIRST = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    SECOND = np.array([[0.25, 0.25], [0.5, 0.25], [0.5, 0.5], [0.25, 0.5]])

    @pytest.fixture
    def square(self, tmp_path):
        path = tmp_path / "square.glb"
        path.write_bytes(
            textured_square({"TEXCOORD_0": self.FIRST, "TEXCOORD_1": self.SECOND}, material=False)
        )
        return path

    def test_each_set_is_read(self, square):
        for number, uv in enumerate((self.FIRST, self.SECOND)):
            mesh = coneflat.read_mesh(square, uv_set=number)
            expected = uv[[0, 1, 2, 0, 2, 3]] * [1, -1] + [0, 1]  # v points down in glTF.
            np.testing.assert_allclose(mesh.uv[mesh.texture], expected)

    def test_each_set_is_measured(self, square):
        covered = [
            coneflat.measure_uv(square, uv_set=number).report()["packing_efficiency"] for number in (0, 1)
        ]
        assert covered == pytest.approx([1, 1 / 16])
        done = command("measure", square, "--uv-set", 1, "--json")
        assert json.loads(done.stdout)["packing_efficiency"] == pytest.approx(1 / 16)

    def test_a_lightmap_that_was_written_is_that_of_the_result(self, rich, tmp_path):
        content, _ = rich
        result = coneflat.unwrap(read_mesh_from(content, "rich.glb"), lightmap=256)
        measured = coneflat.measure_uv(result.save(tmp_path / "lightmap.glb"), uv_set=1)
        assert (measured.distortion.overlapping_pairs, measured.distortion.flipped) == (0, 0)
        assert measured.report()["packing_efficiency"] == pytest.approx(result.packing_efficiency, rel=1e-3)
        assert measured.report()["textures"] == 1  # Two materials share the lightmap.

    def test_a_missing_set_is_an_error(self, square, tmp_path):
        with pytest.raises(MissingUVError, match="has no UV set 2"):
            coneflat.measure_uv(square, uv_set=2)
        with pytest.raises(MissingUVError, match="has no UV set 1"):
            coneflat.read_mesh(coneflat.sample_path(), uv_set=1)
        for number in (-1, "1", True, 0.5):
            with pytest.raises(OptionError, match="uv_set must be an integer"):
                coneflat.read_mesh(square, uv_set=number)
        with pytest.raises(OptionError, match="applies to mesh files only"):
            coneflat.measure_uv(coneflat.read_mesh(square), uv_set=1)
        done = command("measure", square, "--uv-set", 7)
        assert done.returncode == 2
        assert "has no UV set 7" in done.stderr
