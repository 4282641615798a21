"""Faces with fewer than three corners are dropped with a note; text that cannot be read is named with its line."""

from __future__ import annotations

import json

import numpy as np
import pytest
from command import command

import coneflat
from coneflat.errors import DegenerateFaceError, EmptyMeshError, MeshFileError
from coneflat.io import read_mesh_from

OBJ = "# head\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\ng one\nf 1 2 3\ng two\nf 2 4\n# between\nf 2 4 3\nf 1\n# end\n"
OFF = "OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n3 0 1 2\n2 1 3\n3 1 3 2\n1 0\n"
HEAD = ["element vertex 4", *(f"property double {axis}" for axis in "xyz"), "element face 4"]
PLY = "\n".join(
    ["ply", "format ascii 1.0", *HEAD, "property list uchar int vertex_indices", "property int segment"]
)
PLY += "\nend_header\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n3 0 1 2 7\n2 1 3 8\n3 1 3 2 9\n1 0 10\n"
FILES = {"a.obj": OBJ, "a.off": OFF, "a.ply": PLY}
NOTE = "Dropped 2 faces with fewer than three corners."


@pytest.mark.parametrize("name", list(FILES))
def test_faces_of_two_corners_are_dropped_with_a_note(name, tmp_path):
    mesh = read_mesh_from(FILES[name].encode(), name)
    assert mesh.corners.tolist() == [0, 1, 2, 1, 3, 2]
    assert mesh.short_faces == 2
    result = coneflat.flatten(mesh, repair=True)
    assert result.notes == (NOTE,)
    with pytest.raises(DegenerateFaceError, match="2 faces with fewer than three corners; pass repair=True"):
        coneflat.flatten(mesh)
    for ending in (".obj", ".ply", ".glb"):
        again = coneflat.read_mesh(result.save(tmp_path / f"out{ending}"))
        assert (len(again.corners), again.short_faces) == (6, 0)


def test_the_text_around_a_dropped_face_of_an_obj_is_kept(tmp_path):
    out = coneflat.flatten(read_mesh_from(OBJ.encode(), "a.obj"), repair=True).save(tmp_path / "out.obj")
    lines = [line for line in out.read_text().splitlines() if not line.startswith(("v", "f"))]
    assert lines == ["# head", "g one", "g two", "# between", "# end"]
    text = out.read_text()
    assert text.index("g two") < text.index("# between") < text.index("f 2/")


def test_properties_of_faces_stay_with_them(tmp_path):
    mesh = read_mesh_from(PLY.encode(), "a.ply")
    assert mesh.face_properties["segment"].tolist() == [7, 9]


def test_commands_name_dropped_faces(tmp_path):
    (tmp_path / "a.obj").write_text(OBJ)
    for verb in ("flatten", "unwrap"):
        assert f"note: {NOTE}" in command(verb, "a.obj", "-o", "out.obj", cwd=tmp_path).stdout
    assert command("flatten", "a.obj", "-o", "out.obj", "--strict", cwd=tmp_path).returncode == 2
    (tmp_path / "b.obj").write_text(OBJ.replace("f 1 2 3", "vt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3"))
    assert NOTE in json.loads(command("measure", "b.obj", "--json", cwd=tmp_path).stdout)["notes"]


def test_a_file_of_short_faces_alone_has_no_faces():
    with pytest.raises(EmptyMeshError, match="has no faces of three corners or more"):
        read_mesh_from(b"v 0 0 0\nv 1 0 0\nf 1 2\n", "a.obj")


@pytest.mark.parametrize("code", ["utf-16", "utf-16-le", "utf-16-be"])
@pytest.mark.parametrize("name", list(FILES))
def test_text_in_utf_16_is_named(name, code):
    with pytest.raises(
        MeshFileError, match=rf"{name}, line 1: this is text in UTF-16: save the file as UTF-8"
    ):
        read_mesh_from(FILES[name].encode(code), name)


def test_triangle_strips_are_named():
    head = PLY.replace("element face 4", "element tristrips 1").partition("end_header")[0]
    content = f"{head}end_header\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n5 0 1 2 3 -1 0\n"
    with pytest.raises(MeshFileError, match=r"a.ply, line 7: its faces are triangle strips \(tristrips\)"):
        read_mesh_from(content.encode(), "a.ply")


@pytest.mark.parametrize(
    ("old", "replacement", "message"),
    [
        ("3 1 3 2 9", "3 1 3 9", "line 17: the properties of this face need 5 numbers, but the line has 4"),
        (
            "3 1 3 2 9",
            "3 1 3 2 9 9",
            "line 17: the properties of this face need 5 numbers, but the line has 6",
        ),
        ("3 1 3 2 9", "4 1 3 2 9", "line 17: the properties of this face need 6 numbers, but the line has 5"),
        ("3 1 3 2 9", "-3 1 3 2 9", "line 17: the list of this face has no valid length"),
        ("3 1 3 2 9", "nan 1 3 2 9", "line 17: the list of this face has no valid length"),
        ("3 1 3 2 9", "2.5 1 3 2 9", "line 17: the list of this face has no valid length"),
        (
            "0 1 0\n1 1 0",
            "0 1 0\n1 1",
            "line 14: the properties of this vertex need 3 numbers, but the line has 2",
        ),
    ],
)
def test_a_bad_line_of_a_text_ply_is_named(old, replacement, message):
    assert old in PLY
    with pytest.raises(MeshFileError, match=message):
        read_mesh_from(PLY.replace(old, replacement).encode(), "a.ply")


def test_rows_of_several_lines_are_read():
    mesh = read_mesh_from(PLY.replace("3 1 3 2 9", "3 1\n3 2 9").encode(), "a.ply")
    np.testing.assert_array_equal(mesh.corners, [0, 1, 2, 1, 3, 2])
