"""Reading meshes."""

from __future__ import annotations

import re
import struct

import numpy as np
import pytest

from coneflat import flatten
from coneflat.errors import (
    ConeflatError,
    EmptyMeshError,
    FaceIndexError,
    MeshFileError,
    NonFiniteError,
    UnknownFormatError,
)
from coneflat.io import INPUT_FORMATS, read_mesh

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
TETRA_POINTS = [[0.1, 0, 0], [1, 0, 1 / 3], [0, 1, 0], [0, 0, 1e-7]]
TETRA_FACES = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]


def polygons(mesh):
    return [mesh.corners[a:b].tolist() for a, b in zip(mesh.offsets[:-1], mesh.offsets[1:], strict=True)]


def written(folder, name, text):
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def tetra_text(ending):
    points, faces = TETRA_POINTS, TETRA_FACES
    rows = [" ".join(map(repr, p)) for p in points]
    if ending == ".obj":
        body = [f"v {r}" for r in rows] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
    elif ending == ".off":
        body = ["OFF", "4 4 6", *rows] + [f"3 {a} {b} {c}" for a, b, c in faces]
    elif ending == ".ply":
        body = ["ply", "format ascii 1.0", "element vertex 4", *(f"property double {c}" for c in "xyz")]
        body += ["element face 4", "property list uchar int vertex_indices", "end_header", *rows]
        body += [f"3 {a} {b} {c}" for a, b, c in faces]
    else:
        body = ["solid tetra vertex"]
        for face in faces:
            body += ["facet normal 0 0 0", "outer loop", *(f"vertex {rows[v]}" for v in face)]
            body += ["endloop", "endfacet"]
        body += ["endsolid tetra"]
    return "\n".join(body) + "\n"


def stl_bytes(corners, promised=None):
    head = b"solid but binary".ljust(80) + struct.pack("<I", len(corners) if promised is None else promised)
    return head + b"".join(struct.pack("<12fH", 0, 0, 0, *np.ravel(c), 0) for c in corners)


def ply_bytes(order, points, faces):
    name = {"<": "little", ">": "big"}[order]
    head = [
        "ply", f"format binary_{name}_endian 1.0", "comment end of line", f"element vertex {len(points)}",
        "property uchar red", *(f"property double {c}" for c in "xyz"), "element edge 1",
        "property int vertex1", f"element face {len(faces)}", "property list uchar int vertex_indices",
        "property float quality", "end_header",
    ]  # fmt: skip
    body = b"".join(struct.pack(order + "B3d", 7, *p) for p in points) + struct.pack(order + "i", 3)
    for face in faces:
        body += struct.pack(f"{order}B{len(face)}if", len(face), *face, 0.5)
    return "\n".join(head).encode() + b"\n" + body


class TestFormats:
    @pytest.mark.parametrize("ending", [".obj", ".off", ".ply"])
    def test_text_formats_keep_every_bit(self, tmp_path, ending):
        mesh = read_mesh(written(tmp_path, "tetra" + ending.upper(), tetra_text(ending)))
        assert mesh.vertices.tobytes() == np.array(TETRA_POINTS, dtype=float).tobytes()
        assert polygons(mesh) == TETRA_FACES
        assert mesh.welded == 0

    def test_stl_text_is_welded(self, tmp_path):
        mesh = read_mesh(written(tmp_path, "tetra.stl", tetra_text(".stl")))
        assert mesh.welded == 8
        # Numbered by first occurrence, which is 0, 2, 1, 3 here.
        assert mesh.vertices.tolist() == [TETRA_POINTS[i] for i in (0, 2, 1, 3)]
        assert polygons(mesh) == [[0, 1, 2], [0, 2, 3], [2, 1, 3], [1, 0, 3]]

    @pytest.mark.parametrize("extra", [b"", b"trailing"])
    def test_stl_binary(self, tmp_path, extra):
        corners = np.array(TETRA_POINTS, dtype=np.float32)[TETRA_FACES]
        content = stl_bytes(corners) + extra
        path = written(tmp_path, "t.stl", content if not extra else b"header" + content[6:])
        mesh = read_mesh(path)
        assert (len(mesh.vertices), mesh.welded) == (4, 8)
        np.testing.assert_array_equal(mesh.vertices[mesh.corners].reshape(-1, 3, 3), corners)
        loose = read_mesh(path, weld=False)
        assert (len(loose.vertices), loose.welded) == (12, 0)

    def test_welding_merges_minus_zero_and_zero_only(self, tmp_path):
        nearly = float(np.nextafter(1.0, 2))
        text = f"v 0 0 -0.0\nv 1 0 0\nv 0 1 0\nv -0 0 0.0\nv {nearly!r} 0 0\nv 5 5 5\nf 1 2 3\nf 4 3 5\n"
        path = written(tmp_path, "slit.obj", text)
        mesh = read_mesh(path, weld=True)
        assert mesh.welded == 1
        assert polygons(mesh) == [[0, 1, 2], [0, 2, 3]]
        assert len(mesh.vertices) == 5
        slit = read_mesh(path)
        assert len(slit.vertices) == 6
        assert polygons(slit) == [[0, 1, 2], [3, 2, 4]]

    @pytest.mark.parametrize("order", "<>")
    @pytest.mark.parametrize(
        "faces", [TETRA_FACES, [[0, 1, 2, 3]], [[0, 1, 2], [3, 2, 1, 0], [0, 1, 3], [4, 3, 2, 1, 0]]]
    )
    def test_ply_binary_keeps_polygons(self, tmp_path, order, faces):
        points = [*TETRA_POINTS, [9, 9, 9], [8, 8, 8]]
        mesh = read_mesh(written(tmp_path, "t.ply", ply_bytes(order, points, faces)))
        assert mesh.vertices.tolist() == points
        assert polygons(mesh) == faces

    def test_off_with_colours_comments_and_counts_on_the_header_line(self, tmp_path):
        text = (
            "COFF 4 2 0 # counts\n\n# points\n0 0 0 255 0 0\n1 0 0 255 0 0\n1 1 0 0 0 0 # here\n0 1 0 1 1 1\n"
            "4 0 1 2 3 0.5 0.5 0.5\n3 0 2 3\n"
        )
        mesh = read_mesh(written(tmp_path, "t.off", text))
        np.testing.assert_array_equal(mesh.vertices, SQUARE)
        assert polygons(mesh) == [[0, 1, 2, 3], [0, 2, 3]]

    @pytest.mark.parametrize("ending", [".glb", ".gltf"])
    def test_gltf_joins_and_transforms(self, tmp_path, ending):
        trimesh = pytest.importorskip("trimesh")
        # Two unit boxes; a rotation and a shift put the second's face on the first's.
        scene = trimesh.Scene()
        box = trimesh.creation.box()
        scene.add_geometry(box)
        turn = trimesh.transformations.rotation_matrix(np.pi / 2, [0, 0, 1])
        turn[:3, 3] = (2, 0, 0)
        scene.add_geometry(trimesh.creation.box((1, 2, 1)), transform=turn)
        path = tmp_path / f"boxes{ending}"
        if ending == ".glb":
            path.write_bytes(scene.export(file_type="glb"))
        else:
            for name, content in scene.export(file_type="gltf").items():
                (tmp_path / name).write_bytes(content)
            (tmp_path / "model.gltf").rename(path)
        mesh = read_mesh(path, weld=False)
        assert len(mesh.vertices) == 16
        assert len(mesh.offsets) == 25
        np.testing.assert_allclose(mesh.vertices.min(0), [-0.5, -0.5, -0.5], atol=1e-6)
        np.testing.assert_allclose(mesh.vertices.max(0), [3, 0.5, 0.5], atol=1e-6)

    def test_an_unknown_ending_lists_the_formats(self, tmp_path):
        for name in ("mesh.xyz", "mesh"):
            with pytest.raises(UnknownFormatError, match=r"\.obj.*\.glb"):
                read_mesh(tmp_path / name)


class TestObj:
    def test_forms_of_numbers(self, tmp_path):
        text = (
            "# header\r\n  v 0 0 0 1 0 0\r\nv\t1 0 0\r\nv 1 1 0 1.0 # colour\r\nvt 0 0\r\nvn 0 0 1\r\n"
            "g left\xe9\r\nf 1 2 3\r\nf -3//-1 -2//-1 -1//-1 # relative\r\nv 0 1 0\r\n"
            "f 1/1/1 3/1 \\\r\n 4\r\n"
            "f -1 1/ 2// 3/1/\r\nl 1/1 2/1\r\n"
        ).encode("latin-1")
        mesh = read_mesh(written(tmp_path, "m.obj", text))
        np.testing.assert_array_equal(mesh.vertices, SQUARE)
        # The second face counts back from the three vertices above it.
        assert polygons(mesh) == [[0, 1, 2], [0, 1, 2], [0, 2, 3], [3, 0, 1, 2]]

    def test_byte_order_mark_and_unused_vertex(self, tmp_path):
        mesh = read_mesh(
            written(tmp_path, "m.obj", b"\xef\xbb\xbfv 3 0 0\nv 1 0 0\nv 9 9 9\nv 0 1 0\nf 1 2 4\n ")
        )
        assert mesh.vertices[:, 0].tolist() == [3, 1, 9, 0]
        assert mesh.corners.tolist() == [0, 1, 3]

    @pytest.mark.parametrize(
        ("text", "line", "reason"),
        [
            ("v 0 0 0\nv 1 0 x1\nv 0 1 0\nf 1 2 3\n", 2, "'x1' is not a number"),
            ("v 0 0 0\nv 1 0 \nv 0 1 0\nf 1 2 3\n", 2, "needs 3 coordinates, but has 2"),
            ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 two 3\n", 5, "'two' is not a number"),
            ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/1 2/1 3/1\nf 1/1 2/q 3/1\n", 5, "'2/q'"),
            ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf /1 /2 /3\n", 4, "'/1'"),
            ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/1/1/1 2 3\n", 4, "'1/1/1/1'"),
            ("v 0 0 0\nv 1 0 \\\n 0\nv 0 1 zero\nf 1 2 3\n", 4, "'zero'"),
            ("v 0 0 0\nv 1 0-1\nv 0 1 0\nf 1 2 3\n", 2, "has 2"),
            ("v 0 0 0\nv 1 0-1 0\nv 0 1 0\nf 1 2 3\n", 2, "'0-1'"),
        ],
    )
    def test_bad_lines_are_named(self, tmp_path, text, line, reason):
        with pytest.raises(MeshFileError, match=rf"bad\.obj, line {line}: .*{re.escape(reason)}"):
            read_mesh(written(tmp_path, "bad.obj", text))

    @pytest.mark.parametrize("number", ["0", "4", "-4", "9" * 18])
    @pytest.mark.parametrize("form", ["f 1 2 {}", "f 1/7/7 2/7 {}//7"])
    def test_bad_index(self, tmp_path, number, form):
        text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n" + form.format(number)
        with pytest.raises(FaceIndexError, match=rf"bad\.obj, line 5: .*vertex {number}"):
            read_mesh(written(tmp_path, "bad.obj", text))


class TestBadFiles:
    @pytest.mark.parametrize("ending", INPUT_FORMATS)
    @pytest.mark.parametrize(
        "content", [b"", b" \n", b"\x00\xff\x13garbage" * 40, b"ply\nglTF\x02\x00\x00\x00{"]
    )
    def test_garbage(self, tmp_path, ending, content):
        path = written(tmp_path, "bad" + ending, content)
        with pytest.raises((MeshFileError, EmptyMeshError)) as caught:
            read_mesh(path)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)

    @pytest.mark.parametrize("ending", INPUT_FORMATS)
    def test_missing_folder_and_directory(self, tmp_path, ending):
        with pytest.raises(MeshFileError, match="no such file"):
            read_mesh(tmp_path / "none" / ("x" + ending))
        (tmp_path / ("dir" + ending)).mkdir()
        with pytest.raises(MeshFileError, match="folder"):
            read_mesh(tmp_path / ("dir" + ending))

    @pytest.mark.parametrize("ending", [".off", ".ply", ".stl"])
    def test_text_cut_anywhere(self, tmp_path, ending):
        text = tetra_text(ending).rstrip()
        # A cut inside the last number, or name of the solid, leaves a file nobody can tell from a whole one.
        stop = len(text) if ending != ".stl" else text.index("endsolid")
        for cut in range(1, stop - 1):
            with pytest.raises(ConeflatError):
                read_mesh(written(tmp_path, "cut" + ending, text[:cut]))

    @pytest.mark.parametrize("order", "<>")
    @pytest.mark.parametrize("faces", [TETRA_FACES, [[0, 1, 2], [3, 2, 1, 0], [0, 1, 3]]])
    def test_binary_ply_cut_anywhere(self, tmp_path, order, faces):
        content = ply_bytes(order, TETRA_POINTS, faces)
        for cut in range(1, len(content)):
            with pytest.raises((MeshFileError, EmptyMeshError)):
                read_mesh(written(tmp_path, "cut.ply", content[:cut]))

    @pytest.mark.parametrize(
        ("name", "old", "replacement", "reason"),
        [
            ("x.off", "4 4 6", "4 5 6", "4 of the 5 faces"),
            ("x.off", "4 4 6", "9 4 6", "8 of the 9 vertices"),
            ("x.off", "1e-07", "abc", "line 6: 'abc'"),
            ("x.off", "3 0 2 1", "-1 0 2", "line 7: a face has -1 corners"),
            ("x.off", "3 0 2 1", "4 0 2 1", "line 7: .*4 corners names 3"),
            ("x.off", "OFF", "OFF BINARY", "binary"),
            ("x.ply", "1e-07", "abc", "line 13: 'abc'"),
            ("x.ply", "element face 4", "element face 5", "5 face elements"),
            ("x.ply", "property double z", "property double w", "'z'"),
            ("x.ply", "3 0 2 1", "3 0 2.5 1", "2.5"),
            ("x.ply", "format ascii", "format utf8", "format"),
            ("x.stl", "1e-07", "abc", "'abc'"),
        ],
    )
    def test_reasons(self, tmp_path, name, old, replacement, reason):
        text = tetra_text(name[1:])
        assert old in text
        with pytest.raises(MeshFileError, match=reason):
            read_mesh(written(tmp_path, name, text.replace(old, replacement, 1)))

    @pytest.mark.parametrize("ending", [".off", ".ply"])
    def test_index_out_of_range(self, tmp_path, ending):
        text = tetra_text(ending).replace("3 0 2 1", "3 0 2 4")
        with pytest.raises(FaceIndexError, match="face 0 refers to vertex 4"):
            read_mesh(written(tmp_path, "x" + ending, text))

    @pytest.mark.parametrize("text", ["v 0 0 0\n", "f 1 2 3\n", "# nothing\n"])
    def test_empty_obj(self, tmp_path, text):
        with pytest.raises(EmptyMeshError, match=r"x\.obj has no"):
            read_mesh(written(tmp_path, "x.obj", text))


def test_a_signalling_nan_is_passed_on_in_silence(tmp_path):
    """Such a float32 makes the processor complain on the way to a double; warnings are errors in the tests."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4")
    corners.view("<u4")[2, 0] = 0x7F800001
    head = b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
    head += b"property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
    (tmp_path / "a.ply").write_bytes(head + corners.tobytes() + b"\3" + np.arange(3, dtype="<i4").tobytes())
    (tmp_path / "a.stl").write_bytes(bytes(80) + b"\1\0\0\0" + bytes(12) + corners.tobytes() + bytes(2))
    for name in ("a.ply", "a.stl"):
        mesh = read_mesh(tmp_path / name)
        assert np.isnan(mesh.vertices).sum() == 1
        with pytest.raises(NonFiniteError):
            flatten(mesh)
