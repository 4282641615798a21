"""Where results can be written; that a file is written in full or not at all."""

from __future__ import annotations

import os

import numpy as np
import pytest
import shapes
from bars import cut_bar, read_bar

import coneflat
from coneflat.errors import MeshFileError, UnknownFormatError
from coneflat.files import OUTPUT_FORMATS, atomic_write, check_output, write_flattening
from coneflat.files.texture import read_picture


@pytest.fixture
def bar(tmp_path):
    return read_bar(tmp_path)


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

    def test_folder_in_the_way(self, bar, tmp_path):
        (tmp_path / "x.obj").mkdir()
        with pytest.raises(MeshFileError, match="it is a folder"):
            write_flattening(cut_bar(bar), tmp_path / "x.obj")
        (tmp_path / "file").write_text("")
        with pytest.raises(MeshFileError, match="no folder"):
            check_output(tmp_path / "file" / "x.obj")

    @pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write everywhere")
    def test_no_permission(self, bar, tmp_path):
        (tmp_path / "x.obj").write_text("old")
        (tmp_path / "x.obj").chmod(0o444)
        with pytest.raises(MeshFileError, match="permission"):
            write_flattening(cut_bar(bar), tmp_path / "x.obj")
        (tmp_path / "in").chmod(0o555)
        with pytest.raises(MeshFileError, match="permission"):
            write_flattening(cut_bar(bar), tmp_path / "in" / "x.obj")

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

    @pytest.mark.parametrize("ending", OUTPUT_FORMATS)
    def test_interrupted_writer_leaves_nothing(self, bar, tmp_path, ending):
        result = cut_bar(bar)
        (tmp_path / "out").mkdir()

        class Interrupting:
            def __getattr__(self, name):
                if name in ("uv", "uv_faces"):
                    raise KeyboardInterrupt
                return getattr(result, name)

        with pytest.raises(KeyboardInterrupt):
            write_flattening(Interrupting(), tmp_path / "out" / ("x" + ending))
        assert list((tmp_path / "out").iterdir()) == []

    def test_text_is_utf8_with_its_own_newlines(self, tmp_path):
        with atomic_write(tmp_path / "t.txt", "w") as stream:
            stream.write("größer\n")
        assert (tmp_path / "t.txt").read_bytes() == "größer\n".encode()

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
def test_what_is_no_path_is_refused_by_name(name):
    result = coneflat.flatten(*shapes.hill(4, 4))
    for call in (coneflat.read_mesh, coneflat.read_flattening, result.save, read_picture):
        with pytest.raises(MeshFileError, match=f"not by {type(name).__name__}"):
            call(name)


def test_a_path_may_be_bytes(tmp_path):
    path = coneflat.flatten(*shapes.hill(4, 4)).save(os.fsencode(tmp_path / "hill.npz"))
    assert path == tmp_path / "hill.npz"
    assert len(coneflat.read_flattening(os.fsencode(path)).faces) == 32
