"""What a file has in addition to its mesh is in the written file, or a note names it."""

from __future__ import annotations

import json

import numpy as np
import pytest
from command import command
from gltf_scenes import SceneMaker, opened, rich_scene
from trials.attributes import glb_rows, read_ply

import coneflat
from coneflat.io import OUTPUT_FORMATS, Attribute, read_mesh, read_mesh_from

PLY = """ply
format ascii 1.0
comment TextureFile part0.png
element vertex 8
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
property uchar alpha
property float quality
property int label
property list uchar int near
element face 4
property list uchar int vertex_indices
property list uchar float texcoord
property int texnumber
property uchar red
property short segment
element edge 1
property int vertex1
property int vertex2
end_header
0 0 0 255 0 0 128 0.1 1 0
1 0 0 0 255 0 128 0.2 1 0
1 1 0 0 0 255 128 0.3 2 0
0 1 0 255 255 0 128 0.4 2 1 7
0 0 1 255 0 0 128 0.5 3 0
1 0 1 0 255 0 128 0.6 3 0
1 1 1 0 1 255 128 0.7 4 0
0 1 1 255 255 0 7 0.8 4 0
3 0 1 2 6 0 0 1 0 1 1 0 255 -1
3 0 2 3 6 0 0 1 1 0 1 0 254 1
3 4 5 6 6 0 0 1 0 1 1 1 253 2
3 4 6 7 6 0 0 1 1 0 1 1 252 3
0 1
"""


@pytest.fixture
def painted(tmp_path):
    path = tmp_path / "painted.ply"
    path.write_text(PLY)
    return path


def lost_in(result, ending):
    """Return the note on lost data, without its beginning."""
    begin = f"These data of the input are not kept in {ending}: "
    return "".join(
        note.removeprefix(begin) for note in result.as_written(ending).notes if note.startswith(begin)
    )


def test_a_ply_keeps_its_properties_in_their_types(painted, tmp_path):
    result = coneflat.flatten(painted)
    out = result.save(tmp_path / "out.ply")
    vertices, faces = read_ply(out)
    source = vertices["source_vertex"]
    np.testing.assert_array_equal(
        vertices["quality"], np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8], "f4")[source]
    )
    np.testing.assert_array_equal(vertices["label"], np.array([1, 1, 2, 2, 3, 3, 4, 4])[source])
    np.testing.assert_array_equal(vertices["alpha"], np.array([128] * 7 + [7])[source])
    np.testing.assert_array_equal(vertices["green"][source == 6], 1)
    assert [vertices.dtype[name] for name in ("quality", "label", "red")] == ["f4", "i4", "u1"]
    # The faces have the order of the input, and alone the second two are at z = 1.
    assert faces["texnumber"].tolist() == [0, 0, 1, 1]
    assert faces["red"].tolist() == [255, 254, 253, 252]
    assert faces["segment"].tolist() == [-1, 1, 2, 3]
    assert faces["segment"].dtype == "i2"
    assert b"comment TextureFile part0.png\n" in out.read_bytes()
    assert lost_in(result, ".ply") == "vertex properties (near), elements (edge)."
    (tmp_path / "in").mkdir()
    moved = result.save(tmp_path / "in" / "out.ply").read_bytes()
    assert b"comment TextureFile ../part0.png\n" in moved
    assert any("made for the old UVs" in note for note in result.as_written(".ply").notes)
    # Once more, nothing is lost, and nothing is written twice.
    again = coneflat.flatten(out)
    assert again.save(tmp_path / "again.ply").read_bytes().count(b"comment") == out.read_bytes().count(
        b"comment"
    )
    assert lost_in(again, ".ply") == ""


def test_properties_follow_the_vertices_that_a_repair_splits(tmp_path):
    lines = ["ply", "format ascii 1.0", "element vertex 5", *(f"property double {axis}" for axis in "xyz")]
    lines += [
        "property double heat",
        "element face 2",
        "property list uchar int vertex_indices",
        "end_header",
    ]
    lines += ["0 0 0 5", "1 0 0 6", "0 1 0 7", "-1 0 0 8", "0 -1 0 9", "3 0 1 2", "3 0 3 4"]
    (tmp_path / "bow.ply").write_text("\n".join(lines))
    result = coneflat.flatten(tmp_path / "bow.ply", repair=True)
    assert len(result.vertices) == 6
    rows, _ = read_ply(result.save(tmp_path / "out.ply"))
    np.testing.assert_array_equal(rows["heat"], rows["source_vertex"] + 5)


def test_colours_of_vertices_are_those_of_a_glb(painted, tmp_path):
    result = coneflat.flatten(painted)
    out = result.save(tmp_path / "out.glb")
    shades = glb_rows(out, "COLOR_0") / 65535
    source = glb_rows(out, "_SOURCE_VERTEX").astype(int).ravel()
    # 1 of 255 is on the line of sRGB, 255 is 1.
    np.testing.assert_allclose(shades[source == 6][0], [0, 1 / 255 / 12.92, 1, 128 / 255], atol=1e-5)
    np.testing.assert_allclose(shades[source == 7][0], [1, 1, 0, 7 / 255], atol=1e-5)
    tree = opened(out.read_bytes())[0]
    assert tree["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] == [1.0] * 4
    assert "vertex colours" not in lost_in(result, ".glb")
    pytest.importorskip("PIL")
    textured = result.save(tmp_path / "textured.glb", texture="checker")
    assert b"COLOR_0" not in textured.read_bytes()


def test_colours_that_a_texture_hides_are_named(painted, tmp_path):
    pytest.importorskip("PIL")
    done = command("flatten", painted, "-o", tmp_path / "out.glb", "--texture", "checker")
    assert (
        "not kept in .glb: texture files (part0.png), vertex colours, vertex properties (alpha" in done.stdout
    )


def test_a_scene_names_its_attributes_in_other_formats():
    result = coneflat.flatten(read_mesh_from(rich_scene(), "rich.glb"))
    for ending in (".obj", ".ply", ".npz"):
        assert lost_in(result, ending) == (
            "vertex attributes (TANGENT, TEXCOORD_1, COLOR_0, JOINTS_0, WEIGHTS_0, _HEAT), morph targets, materials, "
            "textures, nodes, skins, animations, cameras, lines and points, extensions (KHR_lights_punctual, "
            "KHR_materials_ior), extras; .glb keeps them."
        )
    assert lost_in(result, ".glb") == ""


def test_a_primitive_without_a_material_looks_the_same(tmp_path):
    make = SceneMaker()
    points = make.accessor([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    make.tree |= {"meshes": [{"primitives": [{"attributes": {"POSITION": points}}]}]}
    make.tree |= {"nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}]}
    result = coneflat.flatten(read_mesh_from(make.glb(), "a.glb"))
    tree = opened(result.save(tmp_path / "out.glb").read_bytes())[0]
    # All properties of a material that are left out have their defaults, those of primitives without one.
    assert [set(material) - {"name"} for material in tree["materials"]] == [set()]
    assert any("got the default material" in note for note in result.as_written(".glb").notes)


@pytest.mark.parametrize(
    ("name", "text", "lost"),
    [
        (
            "groups.obj",
            "o a\ng left arm\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\nl 1 2\n",
            "groups, objects, lines and points; .obj keeps them.",
        ),
        (
            "weights.obj",
            "v 0 0 0 1\nv 1 0 0 1\nv 1 1 0 1\nf 1 2 3\n",
            "weights of vertices; .obj keeps them.",
        ),
        ("named.stl", None, "solids."),
        ("face.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 255 0 0\n", "face colours."),
        ("part.off", "OFF\n3 1 0\n0 0 0 1 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "vertex colours."),
    ],
)
def test_other_formats_name_what_they_do_not_keep(name, text, lost, tmp_path):
    if text is None:
        corners = "".join(f"vertex {p}\n" for p in ("0 0 0", "1 0 0", "0 1 0"))
        text = (
            f"solid left arm\nfacet normal 0 0 1\nouter loop\n{corners}endloop\nendfacet\nendsolid left arm\n"
        )
    result = coneflat.flatten(read_mesh_from(text.encode(), name))
    for ending in OUTPUT_FORMATS:
        assert lost_in(result, ending) == ("" if name.endswith(ending) else lost)


def test_colours_of_an_off_file_are_kept(tmp_path):
    text = "COFF\n3 1 0\n0 0 0 255 0 0 255\n1 0 0 0 255 0 128\n0 1 0 0 0 7 255\n3 0 1 2\n"
    mesh = read_mesh_from(text.encode(), "a.off")
    np.testing.assert_allclose(255 * mesh.properties["blue"], [0, 0, 7])
    rows, _ = read_ply(coneflat.flatten(mesh).save(tmp_path / "out.ply"))
    assert rows[["red", "green", "blue", "alpha"]].tolist() == [
        (255, 0, 0, 255),
        (0, 255, 0, 128),
        (0, 0, 7, 255),
    ]


def test_colours_of_an_obj_in_bytes_are_colours():
    text = b"v 0 0 0 255 0 51\nv 1 0 0 0 0 0\nv 0 1 0 0 0 0\nf 1 2 3\n"
    assert [read_mesh_from(text, "a.obj").properties[name][0] for name in ("red", "blue")] == [1.0, 0.2]


def test_gifti_names_its_metadata():
    nibabel = pytest.importorskip("nibabel")
    image = nibabel.GiftiImage()
    meta = nibabel.gifti.GiftiMetaData({"AnatomicalStructurePrimary": "CortexLeft"})
    points, faces = np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32)
    for values, intent in ((points, "POINTSET"), (faces, "TRIANGLE")):
        metadata = {"meta": meta} if intent == "POINTSET" else {}
        image.add_gifti_data_array(
            nibabel.gifti.GiftiDataArray(values, intent=f"NIFTI_INTENT_{intent}", **metadata)
        )
    mesh = read_mesh_from(image.to_bytes(), "lh.surf.gii")
    assert Attribute("metadata", "AnatomicalStructurePrimary") in mesh.attributes
    assert "metadata (AnatomicalStructurePrimary)" in lost_in(coneflat.flatten(mesh), ".obj")


@pytest.mark.slow
def test_every_command_that_writes_a_mesh_names_what_it_does_not_keep(painted, tmp_path):
    note = "note: These data of the input are not kept in .obj: texture files (part0.png), vertex colours"
    for verb in ("flatten", "unwrap", "quads"):
        arguments = ["--quads", "8"] if verb == "quads" else []
        assert note in command(verb, painted, "-o", tmp_path / "out.obj", *arguments).stdout
    command("batch", painted, "--out", tmp_path / "many", "--jobs", "1")
    assert note.removeprefix("note: ") in (tmp_path / "many" / "summary.csv").read_text()
    pytest.importorskip("PIL")
    for name in ("old.glb", "new.obj"):
        command("unwrap", painted, "-o", tmp_path / name)
    text = (tmp_path / "new.obj").read_text().replace("\nf ", "\ng left arm\nf ", 1)
    (tmp_path / "new.obj").write_text(text)
    baked = command(
        "transfer",
        tmp_path / "old.glb",
        tmp_path / "new.obj",
        "-o",
        tmp_path / "baked.glb",
        "--resolution",
        "64",
    )
    assert "note: These data of the input are not kept in .glb: groups." in baked.stdout


def test_names_are_shown_up_to_a_number(tmp_path):
    names = [f"f_{i}" for i in range(50)]
    lines = ["ply", "format ascii 1.0", "element vertex 3", *(f"property double {axis}" for axis in "xyz")]
    lines += [*(f"property float {name}" for name in names), "element face 1"]
    lines += ["property list uchar int vertex_indices", "end_header"]
    lines += [" ".join([*point, *["1"] * 50]) for point in ("000", "100", "010")]
    (tmp_path / "splats.ply").write_text("\n".join([*lines, "3 0 1 2"]) + "\n")
    lost = lost_in(coneflat.flatten(read_mesh(tmp_path / "splats.ply")), ".obj")
    assert lost == f"vertex properties ({', '.join(names[:20])} and 30 more); .ply keeps them."


@pytest.mark.parametrize("weld", [(), ("--weld",)])
def test_properties_that_merged_vertices_do_not_share_are_named(weld, tmp_path):
    lines = ["ply", "format ascii 1.0", "element vertex 6", *(f"property double {axis}" for axis in "xyz")]
    lines += [
        "property int label",
        "property int same",
        "element face 2",
        "property list uchar int vertex_indices",
    ]
    lines += ["end_header", "0 0 0 1 9", "1 0 0 2 9", "0 1 0 3 9", "1 0 0 2 9", "1 1 0 5 9", "0 1 0 4 9"]
    (tmp_path / "slit.ply").write_text("\n".join([*lines, "3 0 1 2", "3 3 4 5"]) + "\n")
    output = command("flatten", tmp_path / "slit.ply", "-o", tmp_path / "out.ply", *weld).stdout
    assert "note: Merged vertices differ in label: the values of the first of them are used" in output
    output = command("flatten", tmp_path / "slit.ply", "-o", tmp_path / "out.ply", "--no-weld").stdout
    assert "Merged" not in output


@pytest.mark.parametrize("has_uv", [True, False])
@pytest.mark.parametrize("line", ["map_Kd skin.png", "Kd 1 0 0"])
def test_textures_of_the_old_uvs_of_an_obj_are_named(line, has_uv, tmp_path):
    (tmp_path / "a.mtl").write_text(f"newmtl paint\n{line}\n")
    corner = "{0}/{0}" if has_uv else "{0}"
    lines = ["mtllib a.mtl", "v 0 0 0", "v 1 0 0", "v 0 1 0", "vt 0 0", "vt 1 0", "vt 0 1", "usemtl paint"]
    lines.append("f " + " ".join(corner.format(v) for v in (1, 2, 3)))
    (tmp_path / "a.obj").write_text("\n".join(lines))
    result = coneflat.flatten(tmp_path / "a.obj")
    note = "The textures of the file are kept, but were made for the old UVs"
    is_noted = [
        any(text.startswith(note) for text in result.as_written(ending).notes) for ending in OUTPUT_FORMATS
    ]
    assert is_noted == [has_uv and line.startswith("map") and ending == ".obj" for ending in OUTPUT_FORMATS]


def test_a_report_has_the_note(painted, tmp_path):
    command("flatten", painted, "-o", tmp_path / "out.obj", "--report", tmp_path / "report.json")
    notes = json.loads((tmp_path / "report.json").read_text())["notes"]
    assert any("not kept in .obj" in note for note in notes)
