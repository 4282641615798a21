"""UV points as files give them."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from coneflat import errors, flatten, read_mesh

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
PLACES = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
HEAD = "ply\nformat {form} 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"


def written(folder, name, text):
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def corner_uv(path):
    """Return (c, 2) the UV point of every corner, NaN where there is none."""
    mesh = read_mesh(path)
    return np.append(mesh.uv, [[np.nan, np.nan]], axis=0)[mesh.texture]


class TestObj:
    def test_numbers_that_count_back_from_the_face(self, tmp_path):
        text = SQUARE + "vt 9 9\nvt 0 0\nvt 1 0\nvt 1 1\nf 1/-3 2/-2 3/-1\nvt 0 1\nf 1/-4 3/-2 4/-1\n"
        uv = corner_uv(written(tmp_path, "a.obj", text))
        np.testing.assert_array_equal(uv, PLACES[[0, 1, 2, 0, 2, 3]])

    def test_corners_without_uv(self, tmp_path):
        text = SQUARE + "vt 0 0\nvt 1 0\nvt 1 1\nf 1 3 4\nf 1/1 2/2 3/3\nf 1//1 3 4/1\n"
        mesh = read_mesh(written(tmp_path, "a.obj", text))
        assert mesh.texture.tolist() == [-1, -1, -1, 0, 1, 2, -1, -1, 0]

    def test_a_file_without_uv(self, tmp_path):
        mesh = read_mesh(written(tmp_path, "a.obj", SQUARE + "vt 0 0\nf 1 2 3\n"))
        assert mesh.texture is None
        assert mesh.uv is None

    def test_a_file_with_invalid_uv_indices_can_be_flattened(self, tmp_path):
        path = written(tmp_path, "a.obj", SQUARE + "f 1/1 2/2 3/3 4/4\n")
        assert read_mesh(path).uv is None
        assert flatten(path).distortion.flipped == 0

    def test_invalid_uv_numbers_become_nan(self, tmp_path):
        text = SQUARE + "vt nan 0\nvt 1 inf\nvt 1 1\nf 1/1 2/2 3/3\n"
        uv = corner_uv(written(tmp_path, "a.obj", text))
        assert np.isfinite(uv).tolist() == [[False, True], [True, False], [True, True]]

    @pytest.mark.parametrize("number", ["4", "-4", "-5", "400"])
    def test_a_point_that_does_not_exist(self, tmp_path, number):
        text = SQUARE + f"vt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3\nf 1/1 3/3 4/{number}\n"
        with pytest.raises(
            errors.FaceIndexError,
            match=rf"a.obj, line 9: a face refers to UV point {number}, but there are 3",
        ):
            read_mesh(written(tmp_path, "a.obj", text))

    @pytest.mark.parametrize(
        ("line", "message"), [("vt", "line 5: a UV point needs"), ("vt a b", "line 5: 'a' is not")]
    )
    def test_incomplete_uv_points_are_refused(self, tmp_path, line, message):
        with pytest.raises(errors.MeshFileError, match=message):
            read_mesh(written(tmp_path, "a.obj", SQUARE + f"{line}\nf 1/1 2/1 3/1\n"))


class TestPly:
    @pytest.mark.parametrize("names", [("s", "t"), ("u", "v"), ("texture_u", "texture_v")])
    @pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
    def test_of_vertices(self, tmp_path, names, form):
        head = HEAD.format(form=form) + "".join(f"property double {name}\n" for name in names)
        head += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
        points = PLACES * [0.5, 0.25]
        rows = [(x, y, 0.0, *uv) for (x, y), uv in zip(PLACES, points, strict=True)]
        if form == "ascii":
            body = "".join(" ".join(map(str, row)) + "\n" for row in rows).encode() + b"4 3 2 1 0\n"
        else:
            order = "<" if "little" in form else ">"
            body = b"".join(struct.pack(order + "fffdd", *row) for row in rows)
            body += struct.pack(order + "B4i", 4, 3, 2, 1, 0)
        np.testing.assert_array_equal(
            corner_uv(written(tmp_path, "a.ply", head.encode() + body)), points[::-1]
        )

    @pytest.mark.parametrize("order", ["<", ">"])
    @pytest.mark.parametrize("before", [False, True])
    def test_of_corners_as_meshlab_writes_them(self, tmp_path, order, before):
        """Each face has a list; one is empty; they may stand before those of the vertices."""
        form = "binary_little_endian" if order == "<" else "binary_big_endian"
        lists = ["property list uchar int vertex_indices\n", "property list uchar float texcoord\n"]
        head = HEAD.format(form=form) + "element face 3\n"
        head += "".join(lists[::-1] if before else lists) + "property int texnumber\nend_header\n"
        body = b"".join(struct.pack(order + "3f", x, y, 0) for x, y in PLACES)
        for corners, uv in (((0, 1, 2), PLACES[:3]), ((0, 2, 3), ()), ((0, 1, 2, 3), PLACES / 2)):
            numbers = np.ravel(uv).tolist()
            parts = [
                struct.pack(f"{order}B{len(corners)}i", len(corners), *corners),
                struct.pack(f"{order}B{len(numbers)}f", len(numbers), *numbers),
            ]
            body += b"".join(parts[::-1] if before else parts) + struct.pack(order + "i", 0)
        path = written(tmp_path, "a.ply", head.encode() + body)
        assert read_mesh(path).texture.tolist() == [0, 1, 2, -1, -1, -1, 3, 4, 5, 6]
        np.testing.assert_array_equal(corner_uv(path)[[0, 1, 2]], PLACES[:3])
        np.testing.assert_array_equal(corner_uv(path)[6:], PLACES / 2)

    def test_a_list_that_does_not_fit(self, tmp_path):
        head = HEAD.format(form="ascii") + "element face 1\nproperty list uchar int vertex_indices\n"
        head += "property list uchar float texcoord\nend_header\n"
        body = "".join(f"{x} {y} 0\n" for x, y in PLACES) + "3 0 1 2 5 0 0 1 0 1\n"
        with pytest.raises(errors.MeshFileError, match="face 0 has 3 corners and 5 numbers in 'texcoord'"):
            read_mesh(written(tmp_path, "a.ply", head + body))


def test_uv_points_repeated_for_each_corner_make_no_seams(tmp_path):
    """As sets of places: many programs write a point for every corner, of which neighbours have the same."""
    vt = "".join(f"vt {x} {y}\n" for x, y in PLACES[[0, 1, 2, 0, 2, 3]])
    path = written(tmp_path, "a.obj", SQUARE + vt + "f 1/1 2/2 3/3\nf 1/4 3/5 4/6\n")
    assert len(flatten(path, seams="input").seams) == 0
    path = written(tmp_path, "a.obj", SQUARE + vt + "f 1/1 2/2 3/3\nf 1/4 3/6 4/5\n")
    assert len(flatten(path, seams="input").seams) == 1
