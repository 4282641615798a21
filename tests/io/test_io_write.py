"""Writing flattened meshes."""

from __future__ import annotations

import sys
from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
import shapes
from full_obj import OBJ, POINTS, cut_bar, flattening, read_bar
from gltf_scenes import opened

import coneflat
from coneflat.errors import MeshFileError, OptionError
from coneflat.geometry.triangulate import triangulate
from coneflat.io import read_mesh, write_flattening
from coneflat.io.texture import DARK_CELL, LIGHT_CELL


@pytest.fixture
def bar(tmp_path):
    return read_bar(tmp_path)


def lines_of(path):
    return path.read_bytes().splitlines()


def corner_uv(path):
    """Return the UV at every polygon corner of an OBJ file, by an independent reading of its text."""
    uv = [tuple(map(float, line.split()[1:])) for line in lines_of(path) if line.startswith(b"vt ")]
    words = [line.split()[1:] for line in lines_of(path) if line.startswith(b"f ")]
    return [[uv[int(word.split(b"/")[1]) - 1] for word in face] for face in words]


class TestObj:
    def test_everything_else_stays_in_place(self, bar, tmp_path):
        out = write_flattening(cut_bar(bar), tmp_path / "in" / "out.obj")
        lines_before = [line for line in OBJ.splitlines() if not line.startswith((b"vt", b"f", b"l"))]
        lines_after = [
            line for line in lines_of(out) if not line.startswith((b"vt", b"f", b"l", b"# the triangle"))
        ]
        assert lines_after == lines_before
        lines = lines_of(out)
        assert [line for line in lines if line.startswith(b"f")] == [
            b"f 1/1/1 2/2/1 5/5/1 4/4/1",
            b"f 2/8/1 3/3/1 6/6/1",
            b"f 2/8 6/6 5/9",
        ]
        assert b"l 1 2" in lines
        assert lines.index(b"# the triangle") == lines.index(b"f 2/8/1 3/3/1 6/6/1") + 1
        texture = [i for i, line in enumerate(lines) if line.startswith(b"vt ")]
        assert len(texture) == 9
        assert texture[-1] < lines.index(b"f 1/1/1 2/2/1 5/5/1 4/4/1")

    def test_round_trip_is_exact(self, bar, tmp_path):
        result = cut_bar(bar)
        result = replace(result, uv=np.random.default_rng(1).random((9, 2)) ** 20)
        out = write_flattening(result, tmp_path / "out.obj")
        again = read_mesh(out)
        assert again.vertices.tobytes() == POINTS.tobytes() == bar.vertices.tobytes()
        np.testing.assert_array_equal(again.corners, bar.corners)
        np.testing.assert_array_equal(again.offsets, bar.offsets)
        quad, *triangles = corner_uv(out)
        # The layout's points 0, 1, 4, 3 are those of the vertices, in the left cell.
        assert quad == [tuple(p) for p in result.uv[[0, 1, 4, 3]]]
        assert triangles == [[tuple(p) for p in face] for face in result.uv[result.uv_faces[2:]]]

    def test_written_over_itself_twice_is_the_same(self, bar):
        write_flattening(cut_bar(bar), bar.path)
        first = bar.path.read_bytes()
        write_flattening(cut_bar(read_mesh(bar.path)), bar.path)
        assert bar.path.read_bytes() == first

    def test_material_paths_follow_the_output(self, bar, tmp_path):
        (tmp_path / "elsewhere").mkdir()
        out = write_flattening(cut_bar(bar), tmp_path / "elsewhere" / "out.obj")
        assert b"mtllib ../in/bar.mtl ../in/more/paint.mtl" in lines_of(out)
        (bar.path.parent / "bar.mtl more").mkdir()
        (bar.path.parent / "bar.mtl more" / "paint.mtl").write_text("newmtl red\n")
        out = write_flattening(cut_bar(bar), tmp_path / "out.obj")
        assert b"mtllib in/bar.mtl more/paint.mtl" in lines_of(out)

    def test_reversed_polygons_run_backwards(self, bar, tmp_path):
        out = write_flattening(cut_bar(bar, flip=(0, 1, 3)), tmp_path / "out.obj")
        assert [line for line in lines_of(out) if line.startswith(b"f")] == [
            b"f 1/1/1 4/4/1 5/5/1 2/2/1",
            b"f 2/8/1 3/3/1 6/6/1",
            b"f 2/8 5/9 6/6",
        ]

    def test_dropped_faces_are_left_out(self, bar, tmp_path):
        result = cut_bar(bar, keep=[0, 3])
        out = write_flattening(result, tmp_path / "out.obj")
        faces = [line.split()[1:] for line in lines_of(out) if line.startswith(b"f")]
        # Of the quad one triangle is left, of the first triangle nothing.
        assert [len(face) for face in faces] == [3, 3]
        assert {int(w.split(b"/")[0]) - 1 for w in faces[0]} == set(result.faces[0].tolist())
        assert faces[1] == [b"2/8", b"6/6", b"5/9"]
        order = [line.split()[0] for line in lines_of(out)]
        assert order.index(b"s") > order.index(b"f")
        assert lines_of(out)[-1] == b"# the end"

    def test_welded_input_keeps_the_numbers_of_the_file(self, tmp_path):
        path = tmp_path / "slit.obj"
        path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 0\nv -1 0 0\nf 1 2 3\nf 4 3 5\n")
        source = read_mesh(path, weld=True)
        faces, face_corners = triangulate(source.vertices, source.corners, source.offsets)
        result = flattening(source.vertices, faces, source.vertices[:, :2], faces, source, face_corners)
        out = write_flattening(result, tmp_path / "out.obj")
        assert lines_of(out)[-2:] == [b"f 1/1 2/2 3/3", b"f 4/1 3/3 5/4"]

    def test_source_of_another_format_keeps_polygons(self, tmp_path):
        path = tmp_path / "q.off"
        path.write_text("OFF\n5 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n0.1 5 0.2\n4 0 1 2 3\n3 3 2 4\n")
        source = read_mesh(path)
        faces, face_corners = triangulate(source.vertices, source.corners, source.offsets)
        result = flattening(source.vertices, faces, source.vertices[:, :2], faces, source, face_corners)
        out = write_flattening(result, tmp_path / "out.obj")
        assert lines_of(out)[-2:] == [b"f 1/1 2/2 3/3 4/4", b"f 4/4 3/3 5/5"]
        assert read_mesh(out).vertices.tobytes() == source.vertices.tobytes()


def embedded_image(tree, view):
    """Return the bytes of the image that the first material of a GLB file has as its texture."""
    index = tree["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["index"]
    return view(tree["images"][tree["textures"][index]["source"]]["bufferView"])


class TestSplitFormats:
    def test_ply_round_trip(self, bar, tmp_path):
        result = cut_bar(bar)
        uv = np.random.default_rng(1).random((9, 2))
        result = replace(result, uv=uv, vertex_origin=np.arange(7) + 10)
        out = write_flattening(result, tmp_path / "out.ply")
        mesh = read_mesh(out)
        # Vertex 6 has no face, vertices 1 and 4 lie on the seam, and at 2 and 5 one face has a normal, the other none.
        assert len(mesh.vertices) == 10
        triangles = mesh.corners.reshape(-1, 3)
        assert mesh.vertices[triangles].tobytes() == result.vertices[result.faces].tobytes()
        header, _, body = out.read_bytes().partition(b"end_header\n")
        properties = [line.split()[-1] for line in header.splitlines() if line.startswith(b"property")]
        assert properties == b"x y z nx ny nz s t source_vertex vertex_indices".split()
        kind = [("xyz", "<f8", 3), ("normal", "<f8", 3), ("uv", "<f8", 2), ("source", "<i4")]
        rows = np.frombuffer(body, kind, len(mesh.vertices))
        assert rows["uv"][triangles].tobytes() == result.uv[result.uv_faces].tobytes()
        np.testing.assert_array_equal(rows["source"][triangles], result.faces + 10)
        np.testing.assert_array_equal(rows["normal"][triangles][:3], np.tile([0.0, 0, 1], (3, 3, 1)))

    @pytest.mark.parametrize("ending", [".ply", ".obj"])
    def test_ply_keeps_colours(self, tmp_path, ending):
        vertices, faces = shapes.sphere(2)
        shades = np.random.default_rng(4).integers(0, 256, (len(vertices), 3))
        if ending == ".ply":
            lines = ["ply", "format ascii 1.0", f"element vertex {len(vertices)}"]
            lines += [f"property double {axis}" for axis in "xyz"]
            lines += [f"property uchar {name}" for name in ("red", "green", "blue")]
            lines += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
            rows = [
                " ".join(map(str, [*p, *c])) for p, c in zip(vertices.tolist(), shades.tolist(), strict=True)
            ]
            rows += [f"3 {a} {b} {c}" for a, b, c in faces]
        else:
            lines = []
            rows = [f"v {x} {y} {z} {r / 255} {g / 255} {b / 255}"
                    for (x, y, z), (r, g, b) in zip(vertices.tolist(), shades.tolist(), strict=True)]  # fmt: skip
            rows += [f"f {a} {b} {c}" for a, b, c in faces + 1]
        path = tmp_path / f"painted{ending}"
        path.write_text("\n".join([*lines, *rows]) + "\n")
        result = coneflat.flatten(read_mesh(path))
        again = read_mesh(write_flattening(result, tmp_path / "out.ply"))
        assert len(again.vertices) > len(vertices)
        origin = again.properties["source_vertex"].astype(int)
        for k, name in enumerate(("red", "green", "blue")):
            np.testing.assert_array_equal(255 * again.properties[name], shades[origin, k])

    def test_glb_by_the_specification(self, bar, tmp_path):
        result = cut_bar(bar)
        uv = np.random.default_rng(1).random((9, 2))
        result = replace(result, uv=uv, vertex_origin=np.arange(7) + 10)
        out = write_flattening(result, tmp_path / "out.glb")
        tree, accessor, _ = opened(out.read_bytes())
        (primitive,) = tree["meshes"][0]["primitives"]
        triangles = accessor(primitive["indices"]).reshape(-1, 3)
        attributes = {name: accessor(i)[triangles] for name, i in primitive["attributes"].items()}
        np.testing.assert_array_equal(attributes["POSITION"], result.vertices[result.faces].astype("f4"))
        # glTF counts v from the top of the image.
        expected = result.as_written(".glb").corner_uv * [1, -1] + [0, 1]
        np.testing.assert_array_equal(attributes["TEXCOORD_0"], expected)
        np.testing.assert_allclose(expected, result.corner_uv * [1, -1] + [0, 1], rtol=0, atol=2.0**-24)
        np.testing.assert_array_equal(attributes["_SOURCE_VERTEX"][..., 0], result.faces + 10)
        np.testing.assert_allclose(np.linalg.norm(attributes["NORMAL"], axis=-1), 1, rtol=1e-6)
        assert (attributes["NORMAL"][..., 2] > 0).all()
        assert tree["materials"][primitive["material"]]["doubleSided"]
        assert tree["accessors"][primitive["attributes"]["_SOURCE_VERTEX"]]["type"] == "SCALAR"
        # The seam closes again when the file is read, since the positions agree.
        assert len(read_mesh(out).vertices) == 6

    @pytest.mark.parametrize("cells", [10, 11])
    def test_glb_carries_a_checkerboard(self, tmp_path, monkeypatch, cells):
        image = pytest.importorskip("PIL.Image")
        monkeypatch.setattr("coneflat.io.texture.cell_side", lambda uv, uv_faces: 1 / cells)
        result = coneflat.flatten(*shapes.hill())
        tree, accessor, view = opened(result.save(tmp_path / "out.glb", texture="checker").read_bytes())
        content = embedded_image(tree, view)
        assert tree["images"][0]["mimeType"] == "image/png"
        board = np.asarray(image.open(BytesIO(content)).convert("RGB")).astype(int)
        assert len(content) < 20_000
        assert board.shape[0] == board.shape[1] > 1000
        # What a viewer looks up for some points of the surface is what the figures show there.
        (primitive,) = tree["meshes"][0]["primitives"]
        uv = accessor(primitive["attributes"]["TEXCOORD_0"])[accessor(primitive["indices"])[:, 0]]
        column, row = np.minimum(uv * len(board), len(board) - 1).astype(int).T
        place = np.floor(np.stack([uv[:, 0], 1 - uv[:, 1]]) * cells)
        inside = np.abs(uv * cells - np.round(uv * cells)).min(axis=1) > 0.02
        expected = np.where((place.sum(axis=0) % 2 == 0)[:, None], LIGHT_CELL, DARK_CELL)
        np.testing.assert_allclose(board[row, column][inside], 255 * expected[inside], atol=1)
        assert inside.mean() > 0.8

    def test_invalid_textures_are_refused(self, bar, tmp_path, monkeypatch):
        pytest.importorskip("PIL")
        result = cut_bar(bar)
        (tmp_path / "text.png").write_text("no image")
        for path, texture, kind, message in (
            ("out.obj", "checker", OptionError, "only .glb files contain a texture"),
            ("out.glb", tmp_path / "none.png", MeshFileError, "there is no such file"),
            ("out.glb", tmp_path / "text.png", MeshFileError, "text.png is not a readable image"),
        ):
            with pytest.raises(kind, match=message):
                write_flattening(result, tmp_path / path, texture)
        monkeypatch.setitem(sys.modules, "PIL.Image", None)
        with pytest.raises(OptionError, match=r'textures need Pillow: pip install "coneflat\[figures\]"'):
            write_flattening(result, tmp_path / "out.glb", "checker")
        assert not list(tmp_path.glob("out.*"))
