"""Results that are written, and read again."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest
import shapes

import coneflat
from coneflat.errors import ConeflatError, MeshFileError


@pytest.fixture(scope="module")
def result():
    return coneflat.flatten(*shapes.hill(), quantise=np.pi / 2)


class TestReadingResults:
    def test_a_result_comes_back(self, result, tmp_path):
        again = coneflat.read_flattening(result.save(tmp_path / "out.npz"))
        for field in fields(result):
            one, other = getattr(result, field.name), getattr(again, field.name)
            if isinstance(one, np.ndarray):
                np.testing.assert_array_equal(one, other)
        np.testing.assert_array_equal(again.distortion.qc, result.distortion.qc)
        assert again.report() == result.report()

    @pytest.mark.parametrize(
        ("name", "value", "message"),
        [
            ("uv", None, "holds no UVs: 'uv' is missing"),
            ("seams", None, "holds no result of coneflat: 'seams' is missing"),
            ("uv", np.zeros((4, 3)), r"'uv' has the shape \(4, 3\)"),
            ("uv_faces", np.array([[0, 1, 10**6]]), r"'uv_faces' has the shape \(1, 3\)"),
            ("uv_faces", np.full((960, 3), 10**6), "'uv_faces' has indices beyond the 534 there are"),
            ("cones", np.zeros(9, dtype=int), r"'curvatures' has the shape"),
            ("vertices", "nan", "not finite"),
            ("report", np.array("{}"), "not a readable NPZ file"),
            ("report", np.array("[1"), "not a readable NPZ file"),
        ],
    )
    def test_what_is_no_result(self, result, tmp_path, name, value, message):
        with np.load(result.save(tmp_path / "out.npz")) as archive:
            arrays = dict(archive)
        if value is None:
            del arrays[name]
        elif isinstance(value, str):
            arrays[name] = np.full_like(arrays[name], value)
        else:
            arrays[name] = value
        np.savez(tmp_path / "bad.npz", **arrays)
        with pytest.raises(MeshFileError, match=message) as caught:
            coneflat.read_flattening(tmp_path / "bad.npz")
        assert "\n" not in str(caught.value)

    @pytest.mark.parametrize("content", [b"PK\x03\x04 broken", b"no archive", b""])
    def test_damaged_files(self, tmp_path, content):
        (tmp_path / "bad.npz").write_bytes(content)
        with pytest.raises(ConeflatError, match=r"bad\.npz"):
            coneflat.read_flattening(tmp_path / "bad.npz")
        with pytest.raises(MeshFileError, match="no such file"):
            coneflat.read_flattening(tmp_path / "none.npz")
