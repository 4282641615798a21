"""Results that are written and read again; where they can be written; that a file is written in full or not at all."""

from __future__ import annotations

import os
from dataclasses import fields

import numpy as np
import pytest
import shapes
from full_obj import cut_bar, read_bar

import coneflat
from coneflat.errors import ConeflatError, MeshFileError, UnknownFormatError
from coneflat.io import atomic_write, check_output, read, write, write_flattening
from coneflat.io.texture import read_picture
from coneflat.io.write import OUTPUT_FORMATS


@pytest.fixture(scope="module")
def result():
    return coneflat.flatten(*shapes.hill(), quantise=np.pi / 2)


class TestReadingResults:
    def test_a_result_comes_back(self, result, tmp_path):
        again = coneflat.read_flattening(result.save(tmp_path / "out.npz"))
        for field in fields(result):
            written_value, read_value = getattr(result, field.name), getattr(again, field.name)
            if isinstance(written_value, np.ndarray):
                np.testing.assert_array_equal(written_value, read_value)
        np.testing.assert_array_equal(again.distortion.qc, result.distortion.qc)
        assert again.report() == result.report()

    @pytest.mark.parametrize(
        ("name", "value", "message"),
        [
            ("uv", None, "holds no result of coneflat with UVs: 'uv' is missing"),
            ("seams", None, "holds no result of coneflat with UVs: 'seams' is missing"),
            ("uv", np.zeros((4, 3)), r"'uv' has the shape \(4, 3\)"),
            (
                "uv_faces",
                np.full((960, 3), 10**6),
                "'uv_faces' has indices outside the range of 534 elements",
            ),
            ("uv_faces", np.full((960, 3), 0.5), "uv_faces"),
            ("faces", np.full((960, 3), 525), "'faces' has indices outside"),
            ("cones", np.array([525]), "cones"),
            ("seams", np.array([[0, 525]]), "seams"),
            ("face_origin", np.full(960, -1), "face_origin"),
            ("vertex_origin", np.zeros((525, 1)), "vertex_origin"),
            ("curvatures", np.ones(7), "curvatures"),
            ("qc", np.ones(959), "qc"),
            ("qc", np.array(["a"] * 960), "bad.npz"),
            ("uv_scale", np.float64(np.nan), "'uv_scale' has numbers that are not finite"),
            ("vertices", np.full((525, 3), np.nan), "not finite"),
            ("report", np.array("{}"), "not a readable NPZ file"),
            ("report", np.array("[1"), "not a readable NPZ file"),
            ("report", np.array('{"notes": 1}'), "bad.npz"),
        ],
    )
    def test_archives_without_a_result_are_refused(self, result, tmp_path, name, value, message):
        with np.load(result.save(tmp_path / "out.npz")) as archive:
            arrays = dict(archive)
        if value is None:
            del arrays[name]
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


@pytest.fixture
def bar(tmp_path):
    return read_bar(tmp_path)


def test_every_declared_format_is_read_and_written():
    """The declared endings, which commands list, are those of the readers and the writers."""
    assert set(OUTPUT_FORMATS) == set(write._FORMATS)
    assert set(read.INPUT_FORMATS) == set(read._FORMATS)


class TestTargets:
    @pytest.mark.parametrize("ending", OUTPUT_FORMATS)
    def test_missing_folder(self, bar, tmp_path, ending):
        with pytest.raises(MeshFileError, match=r"there is no folder .*create it first"):
            write_flattening(cut_bar(bar), tmp_path / "none" / ("x" + ending))
        assert not (tmp_path / "none").exists()

    @pytest.mark.parametrize("name", ["x.stl", "x", "x.png"])
    def test_unknown_ending(self, bar, tmp_path, name):
        with pytest.raises(UnknownFormatError, match=r"\.obj, \.ply, \.glb, \.npz"):
            write_flattening(cut_bar(bar), tmp_path / name)
        assert not (tmp_path / name).exists()

    def test_a_folder_of_the_same_name_is_an_error(self, bar, tmp_path):
        (tmp_path / "x.obj").mkdir()
        with pytest.raises(MeshFileError, match="it is a folder"):
            write_flattening(cut_bar(bar), tmp_path / "x.obj")
        (tmp_path / "file").write_text("")
        with pytest.raises(MeshFileError, match="no folder"):
            check_output(tmp_path / "file" / "x.obj")

    @pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError, OSError, MeshFileError])
    def test_interruption_leaves_the_old_file(self, tmp_path, error):
        path = tmp_path / "report.json"
        path.write_text("old")
        expected = MeshFileError if error is OSError else error

        def interrupted():
            with atomic_write(path, "w") as stream:
                stream.write("new")
                stream.flush()
                assert len(list(tmp_path.iterdir())) == 2
                raise error("stop")

        with pytest.raises(expected, match="stop"):
            interrupted()
        assert [p.name for p in tmp_path.iterdir()] == ["report.json"]
        assert path.read_text() == "old"

    @pytest.mark.skipif(os.name != "posix", reason="links and modes of POSIX")
    def test_links_and_modes_are_respected(self, tmp_path):
        (tmp_path / "real").mkdir()
        target = tmp_path / "real" / "t.bin"
        target.write_bytes(b"old")
        target.chmod(0o640)
        (tmp_path / "link.bin").symlink_to(target)
        with atomic_write(tmp_path / "link.bin") as stream:
            stream.write(b"new")
        assert (tmp_path / "link.bin").is_symlink()
        assert target.read_bytes() == b"new"
        assert target.stat().st_mode & 0o777 == 0o640
        with pytest.raises(MeshFileError, match="not an ordinary file"), atomic_write("/dev/null"):
            pass


@pytest.mark.parametrize("name", [None, 3, 2.5, object(), ["a.obj"], np.zeros(3), {"a": 1}])
def test_invalid_paths_are_refused_by_name(name):
    result = coneflat.flatten(*shapes.hill(4, 4))
    for call in (coneflat.read_mesh, coneflat.read_flattening, result.save, read_picture):
        with pytest.raises(MeshFileError, match=f"got {type(name).__name__}"):
            call(name)


def test_a_path_may_be_bytes(tmp_path):
    path = coneflat.flatten(*shapes.hill(4, 4)).save(os.fsencode(tmp_path / "hill.npz"))
    assert path == tmp_path / "hill.npz"
    assert len(coneflat.read_flattening(os.fsencode(path)).faces) == 32
