"""Meshes from standard input, and results on standard output."""

from __future__ import annotations

import numpy as np
import pytest
from click.testing import CliRunner
from shapes import hill

import coneflat
from coneflat.apps.cli.main import cli
from coneflat.base.formats import FREESURFER
from coneflat.errors import MeshFileError
from coneflat.io import INPUT_FORMATS, read_mesh_from

trimesh = pytest.importorskip("trimesh")


def piped(content, *arguments):
    return CliRunner().invoke(cli, ["flatten", *arguments], input=content)


@pytest.fixture(scope="module")
def contents():
    """Return the same mesh as files of every format."""
    mesh = trimesh.Trimesh(*hill(6, 5), process=False)
    exported = {f".{name}": mesh.export(file_type=name) for name in ("obj", "ply", "stl", "off", "glb")}
    exported = {ending: body.encode() if isinstance(body, str) else body for ending, body in exported.items()}
    exported[".stl text"] = mesh.export(file_type="stl_ascii").encode()
    exported[".ply text"] = mesh.export(file_type="ply", encoding="ascii")
    exported[".obj commented"] = b"# solid OFF ply\n" + exported[".obj"]
    exported[".off commented"] = b"# made by hand\n" + exported[".off"]
    return exported


def test_formats_are_recognized_by_content(contents):
    assert {ending.split()[0] for ending in contents} == set(INPUT_FORMATS) - {".gltf", ".gii", *FREESURFER}
    for ending, content in contents.items():
        recognized = read_mesh_from(content, "-", weld=False)
        named = read_mesh_from(content, "a", weld=False, ending=ending.split()[0])
        assert recognized.vertices.tobytes() == named.vertices.tobytes(), ending
        assert len(recognized.offsets) == 61, ending


def test_a_gltf_with_its_data_within_goes_through_a_pipe(contents):
    import base64
    import json

    content = contents[".glb"]
    length = int.from_bytes(content[12:16], "little")
    tree = json.loads(content[20 : 20 + length])
    tree["buffers"][0]["uri"] = "data:;base64," + base64.b64encode(content[28 + length :]).decode()
    assert len(read_mesh_from(json.dumps(tree).encode(), "-").vertices) == 42


@pytest.mark.parametrize("form", ["obj", "ply", "glb", "npz"])
def test_a_pipe_gets_the_bytes_of_the_file(contents, tmp_path, form):
    ran = piped(contents[".ply"], "-", "-o", "-", "--format", form)
    assert ran.exit_code == 0, ran.output
    # The table stands on stderr.
    assert "UV islands" in ran.stderr
    assert "wrote" not in ran.stderr
    (tmp_path / "in.ply").write_bytes(contents[".ply"])
    direct = CliRunner().invoke(
        cli, ["flatten", str(tmp_path / "in.ply"), "-o", str(tmp_path / f"out.{form}")]
    )
    assert direct.exit_code == 0
    if form != "npz":
        assert ran.stdout_bytes == (tmp_path / f"out.{form}").read_bytes()
    else:
        (tmp_path / "piped.npz").write_bytes(ran.stdout_bytes)
        from_pipe, saved = (coneflat.read_flattening(tmp_path / name) for name in ("piped.npz", "out.npz"))
        np.testing.assert_array_equal(from_pipe.uv, saved.uv)


def test_a_mesh_from_a_pipe_is_written_to_a_pipe(contents):
    ran = piped(contents[".stl"], "-", "-q")
    assert ran.exit_code == 0
    assert ran.stdout_bytes.startswith(b"v ")
    assert not ran.stderr


@pytest.mark.parametrize(
    ("content", "reason"), [(b"", "standard input is empty"), (b"hello\n", "- has no vertices")]
)
def test_invalid_meshes_in_pipes_are_refused(content, reason):
    ran = piped(content, "-", "-o", "-")
    assert ran.exit_code != 0
    assert reason in str(ran.exception)
    assert not ran.stdout_bytes


@pytest.mark.parametrize(
    "arguments",
    [
        ["flatten", "hill.off", "-o", "flat.obj", "--report", "-"],
        ["cones", "hill.off", "-o", "-"],
        ["measure", "hill.off", "--report", "-"],
    ],
    ids=lambda arguments: arguments[0],
)
def test_an_invalid_mesh_leaves_no_file_named_as_the_pipe(contents, tmp_path, monkeypatch, arguments):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "hill.off").write_bytes(contents[".off"])
    ran = CliRunner().invoke(cli, arguments)
    assert isinstance(ran.exception, MeshFileError)
    assert "name a file" in str(ran.exception)
    assert not (tmp_path / "-").exists()
