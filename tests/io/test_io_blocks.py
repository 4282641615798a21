"""Text in blocks, decimals read and written without loss, positions merged."""

from __future__ import annotations

import numpy as np
import pytest

from coneflat.errors import ConeflatError, FaceIndexError, MeshFileError
from coneflat.io import lines_of, read_mesh, text
from coneflat.mesh.check import weld

OBJ = (
    b"\xef\xbb\xbf# C:\\models\\\r\no thing\r\nv 0 0 0\r\n  v 1 0.5 \\\r\n 1e-3 # a \\ b\r\nv 1 1 -0\r\nvt 0 0\r\n"
    b"vt 1 1\r\nvn 0 0 1\r\n\tf 1/1 2/2 3/1 # first\r\ng one\r\nl 1/1 2/2 # 1/1\r\nf -3//-1 \\\r\n -2//1 -1\r\n"
    b"v .5 2 nan\r\ng two\r\nvt 2 2\r\nusemtl red\r\nf 4/1/1 3/ 2// 1/2/\r\n# end"
)
OFF = (
    b"COFF # points\r4 3 0\r\r0 0 0 1 0 0\r1 0 0 1 0 0 # red\r\r1 1 0.125 1 0 0\r0 1 0 1 0 0\r"
    b"3 0 1 2 0.5 0.5 0.5\r# quad\r4 0 1 2 3\r3 3 2 0 red\r"
)
PLY = (
    b"ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\nproperty double z\n"
    b"property uchar red\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
    b"0 0 0 9\n1 0 0 9\n1 1 -0.0 9\n0 1 1e-300 255\n3 0 1 2\n4 0 1 2 3\n"
)
STL = (
    b"solid vertex facet\nFACET normal 0 0 1\n outer loop\n  Vertex 0 0 0\n\tVERTEX 1 0 0\n vertex 1 1 1e0\n"
    b" endloop\nendfacet\nfacet\nvertex 1 1 1\nvertex 1 0 0\nvertex 2 2 2\nendfacet\nendsolid vertex\n"
)
NUMBERS = [
    "1", "+1", "-1.", ".5", "-.5e1", "5E+3", "00012.5", "1e-70", "0e5", "-0", "-0.0", "123456789012345678",
    "9007199254740993", "1234567890123456789", "1e300", "1e-320", "1e99999999999999999999", "nan", "-NaN", "inf",
    "-Infinity",
]  # fmt: skip
NO_NUMBERS = [
    "x", "1e", "1e+", "1-2", "--1", "1..2", ".", "e5", "+", "1_0", "0x1", "1e5x", "1\x002", "1,5", "nano", "1d5",
]  # fmt: skip
TEXTS = {".obj": OBJ, ".off": OFF, ".ply": PLY, ".stl": STL}


def written(folder, name, content):
    path = folder / name
    path.write_bytes(content)
    return path


@pytest.fixture(params=[1, 17, 100])
def small_blocks(request, monkeypatch):
    """Blocks of a line or some."""
    monkeypatch.setattr(text, "BLOCK_BYTES", request.param)


class TestBlocks:
    @pytest.fixture
    def meshes(self, tmp_path):
        """Read before any test makes the blocks small."""
        return {
            name: read_mesh(written(tmp_path, "whole" + name, content)) for name, content in TEXTS.items()
        }

    @pytest.mark.parametrize("ending", TEXTS)
    def test_the_result_does_not_depend_on_the_block_size(self, tmp_path, meshes, small_blocks, ending):
        mesh, expected = read_mesh(tmp_path / ("whole" + ending)), meshes[ending]
        for name in ("vertices", "corners", "offsets"):
            assert getattr(mesh, name).tobytes() == getattr(expected, name).tobytes(), name
        assert mesh.welded == expected.welded
        assert mesh.properties.keys() == expected.properties.keys()
        if ending == ".obj":
            assert mesh.obj.gaps == {place: gap for place, gap in expected.obj.gaps.items() if gap}
            np.testing.assert_array_equal(mesh.normal, expected.normal)
            assert mesh.obj.newline == b"\r\n"

    def test_obj_with_all_kinds_of_lines(self, meshes):
        mesh = meshes[".obj"]
        np.testing.assert_array_equal(mesh.vertices, [[0, 0, 0], [1, 0.5, 1e-3], [1, 1, 0], [0.5, 2, np.nan]])
        assert mesh.corners.tolist() == [0, 1, 2, 0, 1, 2, 3, 2, 1, 0]
        assert mesh.normal.tolist() == [-1, -1, -1, 0, 0, -1, 0, -1, -1, -1]
        assert mesh.obj.gaps[1] == b"# first\r\ng one\r\nl 1 2 # 1/1\r\n"
        assert mesh.obj.gaps[2] == b"v .5 2 nan\r\ng two\r\nusemtl red\r\n"
        assert b"vt" not in b"".join(mesh.obj.gaps.values())

    @pytest.mark.parametrize(
        ("ending", "old", "replacement", "message"),
        [
            (".obj", b"f 4/1/1", b"f x/1/1", "line 19: 'x/1/1' is not a number"),
            (".obj", b"f 4/1/1", b"f 5/1/1", "line 19: a face refers to vertex 5"),
            (".obj", b"v .5 2", b"v .5.2 2", "line 15: '.5.2' is not a number"),
            (".obj", b"-2//1 -1", b"-2//1 -9", "line 13: a face refers to vertex -9"),
            (".off", b"3 3 2 0", b"3 3 2 0x0", "line 12: '0x0' is not a number"),
            (".off", b"3 3 2 0", b"3.0 3 2 0", "line 12: '3.0' is not a number of corners"),
            (".off", b"3 3 2 0", b"3 3 2", "line 12: 'red' is not a number"),
            (".off", b"1 1 0.125", b"1 1 0_125", "line 7: '0_125' is not a number"),
            (".ply", b"4 0 1 2 3", b"4 0 1 2 #", "line 16: '#' is not a number"),
            (".stl", b"vertex 2 2 2", b"vertex 2 2 2x", "line 12: '2x' is not a number"),
            (".stl", b"vertex 2 2 2", b"vertex2 2 2 2", "2 facets but 5 vertices"),
        ],
    )
    def test_bad_words_are_named_with_their_lines(
        self, tmp_path, small_blocks, ending, old, replacement, message
    ):
        assert old in TEXTS[ending]
        with pytest.raises((MeshFileError, FaceIndexError)) as caught:
            read_mesh(written(tmp_path, "bad" + ending, TEXTS[ending].replace(old, replacement)))
        assert message in str(caught.value)


class TestDecimals:
    @staticmethod
    def samples():
        rng = np.random.default_rng(5)
        bits = rng.integers(0, 2**63, 90_000).view(np.float64)
        return {
            "uniform": rng.random(30_000),
            "of six digits": np.round(rng.normal(size=30_000), 6),
            "single": rng.normal(size=30_000).astype(np.float32).astype(np.float64),
            "of all sizes": bits[(bits > 1e-59) & (bits < 1e59)][:15_000] * rng.choice([-1, 1], 15_000),
            "whole": rng.integers(-(10**7), 10**7, 30_000).astype(np.float64),
            "special": np.tile(
                [0.0, -0.0, 1e16, 1e15, 9999999999999998.0, 1e-4, 9.9e-5, 1e22, 0.1, 2 / 3], 3000
            ),
        }

    @staticmethod
    def words_read(tmp_path, words):
        """Return numbers that are read of words, a multiple of three of them."""
        lines = [f"v {' '.join(words[i : i + 3])}\n" for i in range(0, len(words), 3)]
        path = written(tmp_path, "words.obj", ("".join(lines) + "f 1 1 1\n").encode())
        return read_mesh(path).vertices.reshape(-1)

    def test_are_read_as_python_reads_them(self, tmp_path):
        for name, numbers in self.samples().items():
            for form in ("{!r}", "{:.8e}", "{:.25g}"):
                words = [form.format(number) for number in numbers.tolist()]
                expected = np.array([float(word) for word in words])
                assert self.words_read(tmp_path, words).tobytes() == expected.tobytes(), (name, form)

    def test_are_read_as_written(self):
        powers_of_two = np.ldexp(1.0, np.arange(-1074, 1024))
        for values in (*self.samples().values(), powers_of_two, np.nextafter(powers_of_two, 0)):
            words = b"".join(lines_of("", values[:, None], b"\n")).split()
            assert np.array([float(word) for word in words]).tobytes() == values.tobytes()
            assert max(map(len, words)) <= 24

    @pytest.mark.parametrize("word", NUMBERS)
    def test_numbers(self, tmp_path, word):
        read, expected = self.words_read(tmp_path, [word, "0", "0"])[0], float(word)
        # Not a number is one thing, whatever its sign.
        assert np.isnan(read) if np.isnan(expected) else str(float(read)) == str(expected)

    @pytest.mark.parametrize("word", NO_NUMBERS)
    def test_other_words_are_refused(self, tmp_path, word):
        with pytest.raises(MeshFileError, match="line 1: .* is not a number"):
            self.words_read(tmp_path, [word, "0", "0"])


class TestPly:
    def test_lists_of_different_lengths(self, tmp_path):
        header = (
            "ply\nformat binary_big_endian 1.0\nelement vertex 5\nproperty float x\nproperty float y\n"
            "property float z\nelement face 3\nproperty uchar flag\nproperty list short double weights\n"
            "property list int ushort vertex_index\nproperty short mark\nend_header\n"
        )
        points = np.arange(15, dtype=">f4")
        faces = [([], [0, 1, 2]), ([0.5], [1, 2, 3, 4]), ([1.5, 2.5, 3.5], [4, 3, 2])]
        body = b"".join(
            b"\x07" + np.array([len(w)], ">i2").tobytes() + np.array(w, ">f8").tobytes()
            + np.array([len(c)], ">i4").tobytes() + np.array(c, ">u2").tobytes() + b"\x00\x01"
            for w, c in faces
        )  # fmt: skip
        content = header.encode() + points.tobytes() + body
        mesh = read_mesh(written(tmp_path, "lists.ply", content))
        assert mesh.offsets.tolist() == [0, 3, 7, 10]
        assert mesh.corners.tolist() == [0, 1, 2, 1, 2, 3, 4, 4, 3, 2]
        for cut in range(len(header), len(content)):
            with pytest.raises(ConeflatError):
                read_mesh(written(tmp_path, "cut.ply", content[:cut]))


def test_welding_agrees_with_sorting():
    rng = np.random.default_rng(3)
    points = (
        rng.integers(-3, 4, (5000, 3)) * np.array([0.25, 1e-30, 1e30]) * rng.choice([-1.0, 1.0], (5000, 3))
    )
    points[::97, 1] = np.nan
    representatives, merged = weld(points)
    distinct, first, number = np.unique(
        (points + 0.0).view(np.int64), axis=0, return_index=True, return_inverse=True
    )
    assert len(representatives) == len(distinct) < 400
    np.testing.assert_array_equal(representatives, np.sort(first))
    np.testing.assert_array_equal(representatives[merged], first[number.ravel()])
    assert all(len(part) == 0 for part in weld(np.empty((0, 3))))
