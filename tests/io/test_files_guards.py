"""Files that ask for more than they hold, or are none at all."""

from __future__ import annotations

import json
import os
import socket
import struct
import tracemalloc
import zipfile
from io import BytesIO

import numpy as np
import pytest
import shapes
from gltf_scenes import SceneMaker, opened, rich_scene

import coneflat
from coneflat.errors import ConeflatError, MeshFileError
from coneflat.geometry.triangulate import triangulate
from coneflat.io import read_mesh, read_mesh_from

MEMORY = 64 << 20
"""Bytes that refusing a file of a few kilobytes may take."""


def refused(content, name, match, memory=MEMORY):
    """Require that content is refused, in one line, and with little memory."""
    tracemalloc.start()
    try:
        with pytest.raises(ConeflatError, match=match) as caught:
            read_mesh_from(content, name, ending=os.path.splitext(name)[1])
        assert tracemalloc.get_traced_memory()[1] < memory
    finally:
        tracemalloc.stop()
    assert "\n" not in str(caught.value)
    assert name in str(caught.value)


def square():
    """Return the maker of a scene of two triangles."""
    make = SceneMaker()
    position = make.accessor([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    primitive = {"attributes": {"POSITION": position}, "indices": make.accessor([0, 1, 2, 0, 2, 3], 5121)}
    make.tree |= {"meshes": [{"primitives": [primitive]}], "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}]}
    return make


def changed(place, value):
    """Return the scene of two triangles with something else at a place in its tree."""
    make = square()
    item = make.tree
    for key in place[:-1]:
        item = item[key]
    if value is None:
        del item[place[-1]]
    else:
        item[place[-1]] = value
    return make.glb()


class TestGltf:
    def test_positions_that_would_take_eleven_gigabytes_are_refused(self):
        make = square()
        make.tree["accessors"][0] = {"componentType": 5126, "count": 10**9, "type": "VEC3"}
        refused(make.glb(), "a.glb", "not in the file")
        make.tree["accessors"][0]["sparse"] = {
            "count": 1,
            "indices": {"bufferView": 1, "componentType": 5121},
            "values": {"bufferView": 0},
        }
        refused(make.glb(), "a.glb", "1,000,000,000 elements, more than the file has bytes")

    def test_meshes_repeated_without_bound_are_refused(self):
        make = square()
        make.tree["nodes"] = [{"children": [1, 1]}, {"children": [0]}, {"mesh": 0}]
        refused(make.glb(), "a.glb", "reached twice")
        make = square()
        corners = np.zeros(30_000)
        primitive = make.tree["meshes"][0]["primitives"][0]
        primitive["indices"] = make.accessor(corners, 5121)
        make.tree["meshes"][0]["primitives"] = [primitive] * 400
        refused(make.glb(), "a.glb", "so often that there are over 10,000,000 corners", memory=MEMORY * 8)

    def test_names_that_are_not_text_are_refused(self):
        make = square()
        make.tree["nodes"] = [{"mesh": 0, "name": 1.5}]
        refused(make.glb(), "a.glb", "the name of nodes 0 is 1.5, not a string")

    @pytest.mark.parametrize(
        ("place", "value", "match"),
        [
            (("accessors", 0, "count"), 5, "ends at 60 of the 48 bytes"),
            (("accessors", 0, "count"), -1, "'count' is -1, not an integer"),
            (("accessors", 0, "count"), 1.5, "not an integer"),
            (("accessors", 0, "byteOffset"), 2**62, "of the 48 bytes"),
            (("accessors", 0, "componentType"), 5130, "unknown type"),
            (("accessors", 0, "type"), "VEC2", "not 3"),
            (("accessors", 0, "bufferView"), 7, "7 is not one of its 2 bufferViews"),
            (("accessors", 1, "componentType"), 5126, "does not contain indices"),
            (("bufferViews", 0, "byteOffset"), 10**12, "ends at"),
            (("bufferViews", 0, "byteLength"), 10**12, "ends at"),
            (("bufferViews", 0, "byteStride"), 0, "overlap"),
            (("bufferViews", 0, "byteStride"), 200, "ends at"),
            (("bufferViews", 0, "buffer"), 1, "1 is not one of its 1 buffers"),
            (("bufferViews", 1), [], "is not an object"),
            (
                ("meshes", 0, "primitives", 0, "attributes", "POSITION"),
                "x",
                "x is not one of its 2 accessors",
            ),
            (("meshes", 0, "primitives", 0, "attributes", "NORMAL"), 1, "has NORMAL for|not 3"),
            (("meshes", 0, "primitives", 0, "attributes"), [], "'attributes' is not an object"),
            (("meshes", 0, "primitives", 0, "attributes"), None, "no faces"),
            (("meshes", 0, "primitives", 0, "indices"), 0, "does not contain indices"),
            (("meshes", 0, "primitives", 0, "targets"), [{"POSITION": 3}], "3 is not one of its 2 accessors"),
            (("meshes",), {}, "'meshes' is not a list"),
            (("nodes", 0, "mesh"), True, "True is not one of its 1 meshes"),
            (("nodes", 0, "matrix"), [1, 2], "must be 16 finite numbers"),
            (("nodes", 0, "scale"), ["a", 1, 1], "must be 3 finite numbers"),
            (("nodes", 0, "children"), [0], "reached twice"),
            (("scene",), 4, "4 is not one of its 1 scenes"),
            (("asset", "version"), "1.0", "convert it to version 2.0"),
            (("animations",), [{"samplers": [{"input": 9}]}], "9 is not one of its 2 accessors"),
            (("skins",), [7], "is not an object"),
            (("images",), [{"bufferView": 9}], "9 is not one of its 2 bufferViews"),
        ],
    )
    def test_broken_references_are_named(self, place, value, match):
        refused(changed(place, value), "a.glb", match)

    def test_indices_beyond_the_vertices(self):
        make = square()
        make.binary[make.tree["bufferViews"][1]["byteOffset"]] = 9
        refused(make.glb(), "a.glb", "refers to vertex 9, but its primitive has 4 vertices")

    @pytest.mark.parametrize(
        ("uri", "match"),
        [
            (None, "no data"),
            ("gone.bin", "gone.bin: there is no such file"),
            ("data:application/octet-stream;base64,AAA", "data URI of buffer 0 is invalid"),
            ("data:nothing", "data URI of buffer 0 is invalid"),
            ("data:;base64,AAAA", "has 3 of the"),
            ("https://example.org/a.bin", "remote files are not loaded"),
            ("%00", "embedded null|cannot be read|no such file"),
            (".", "is a folder"),
            (f"{'x' * 3000}.obj", "cannot be read: "),
            ("/dev/zero", "'/dev/zero' is outside the folder of the file, and is not read"),
            ("../a.bin", "'../a.bin' is outside the folder"),
            ("b/../../a.bin", "'b/../../a.bin' is outside the folder"),
            ("%2e%2e/a.bin", "'../a.bin' is outside the folder"),
            ("C:%5Ca.bin", "is outside the folder"),
            ("b/../a.bin", "there is no such file"),
            (17, "is not a string"),
        ],
    )
    def test_missing_buffers_are_named(self, uri, match, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        tree = opened(square().glb())[0]
        if uri is not None:
            tree["buffers"][0]["uri"] = uri
        refused(json.dumps(tree).encode(), "a.gltf", match)

    @pytest.mark.parametrize("name", ["KHR_draco_mesh_compression", "EXT_meshopt_compression"])
    def test_compressed_data_are_named(self, name):
        make = square()
        if name.startswith("KHR"):
            del make.tree["accessors"][0]["bufferView"]
            make.tree["meshes"][0]["primitives"][0]["extensions"] = {
                name: {"bufferView": 0, "attributes": {}}
            }
        else:
            make.tree["bufferViews"][0] |= {"buffer": 1, "extensions": {name: {"buffer": 0, "byteLength": 9}}}
            make.tree["buffers"] = [{}, {"byteLength": 48, "extensions": {name: {"fallback": True}}}]
        refused(make.glb(), "a.glb", rf"compressed \({name}\); save it without compression")

    def test_deep_json(self):
        refused(b'{"a":' * 100_000, "a.gltf", "nested too deeply|invalid JSON")

    def test_sparse_positions_replace_those_of_the_buffer(self):
        make = square()
        where = make.view(np.array([2], "<u2").tobytes())
        view = make.view(np.array([5, 6, 7], "<f4").tobytes())
        make.tree["accessors"][0]["sparse"] = {
            "count": 1,
            "indices": {"bufferView": where, "componentType": 5123},
            "values": {"bufferView": view},
        }
        mesh = read_mesh_from(make.glb(), "a.glb")
        assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [5, 6, 7], [0, 1, 0]]
        make.tree["accessors"][0]["count"] = 2
        refused(make.glb(), "a.glb", "replaces element 2 of 2|refers to vertex")

    def test_quantised_positions_are_fractions(self):
        make = square()
        position = make.accessor([[0, 0, 0], [127, 0, 0], [127, -128, 0], [0, 64, 0]], 5120, normalized=True)
        make.tree["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = position
        mesh = read_mesh_from(make.glb(), "a.glb")
        assert mesh.vertices[:, :2].tolist() == [[0, 0], [1, 0], [1, -1], [0, 64 / 127]]

    def test_a_changed_byte_leads_to_a_mesh_or_a_named_error(self, tmp_path):
        content = rich_scene()
        length = struct.unpack_from("<I", content, 12)[0]
        rng = np.random.default_rng(1)
        read = 0
        for place in rng.integers(20, 20 + length, 400).tolist():
            broken = bytearray(content)
            broken[place] = rng.integers(32, 127)
            try:
                mesh = read_mesh_from(bytes(broken), "a.glb")
            except ConeflatError:
                continue
            read += 1
            assert len(mesh.corners) % 3 == 0
        assert 0 < read < 400


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    return coneflat.flatten(*shapes.grid(3, 3)).save(tmp_path_factory.mktemp("npz") / "a.npz")


class TestNpz:
    def written(self, saved, tmp_path, **arrays_by_name):
        with np.load(saved) as archive:
            arrays = dict(archive) | arrays_by_name
        np.savez(tmp_path / "b.npz", **arrays)
        return tmp_path / "b.npz"

    @pytest.mark.parametrize(
        "change", [{"qc_mean": "a"}, {"seconds": {"a": []}}, {"notes": [3]}, {"residual": {}}]
    )
    def test_invalid_reports_are_refused(self, saved, tmp_path, change):
        with np.load(saved) as archive:
            report = json.loads(str(archive["report"])) | change
        with pytest.raises(MeshFileError, match=r"b\.npz"):
            coneflat.read_flattening(self.written(saved, tmp_path, report=np.array(json.dumps(report))))

    def test_saving_a_read_result_again_gives_the_same_file(self, saved, tmp_path):
        result = coneflat.read_flattening(saved)
        for ending in (".npz", ".obj", ".ply", ".glb"):
            result.save(tmp_path / f"c{ending}")
        assert coneflat.read_flattening(tmp_path / "c.npz").report() == result.report()

    def test_a_compression_bomb_is_refused(self, saved, tmp_path):
        bomb = tmp_path / "bomb.npz"
        with np.load(saved) as archive, zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as out:
            for name in archive.files:
                stream = BytesIO()
                np.save(stream, archive[name] if name != "qc" else np.zeros(20_000_000))
                out.writestr(f"{name}.npy", stream.getvalue())
        tracemalloc.start()
        with pytest.raises(MeshFileError, match="unpacks to more than 30 times its size"):
            coneflat.read_flattening(bomb)
        assert tracemalloc.get_traced_memory()[1] < MEMORY
        tracemalloc.stop()


class TestHeaders:
    @pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
    @pytest.mark.parametrize(
        "elements",
        [
            "element vertex 4000000000000\nproperty double x\nproperty double y\nproperty double z\nelement face 1\n"
            "property list uchar int vertex_indices\n",
            "element vertex 1\nproperty double x\nproperty double y\nproperty double z\nelement face 4000000000000\n"
            "property list uchar int vertex_indices\n",
            "element nothing 4000000000000\nelement vertex 1\nproperty double x\nproperty double y\nproperty double z\n"
            "element face 1\nproperty list uchar int vertex_indices\n",
            "element vertex 1\nproperty double x\nproperty double y\nproperty double z\nelement face 2\n"
            "property list uint double weights\nproperty list uchar int vertex_indices\n",
        ],
    )
    def test_ply_counts_that_the_file_cannot_hold(self, form, elements):
        head = f"ply\nformat {form} 1.0\n{elements}end_header\n".encode()
        body = b"1 2 3 4294967295 0 0 0\n" if form == "ascii" else b"\xff" * 64
        refused(head + body, "a.ply", "a.ply")

    def test_stl_and_off_counts_that_the_file_cannot_hold(self):
        refused(
            b"x" * 80 + struct.pack("<I", 2**32 - 1) + bytes(200), "a.stl", "4 of the 4294967295 triangles"
        )
        refused(b"OFF\n99999999999999 99999999999999 0\n0 0 0\n", "a.off", "1 of the 99999999999999 vertices")
        refused(
            b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n99999999999 0 1 2\n", "a.off", "a face of 99999999999 corners"
        )


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes with names")
class TestWhatIsNoFile:
    @pytest.mark.parametrize("ending", [".obj", ".glb", ".npz"])
    def test_pipes_devices_and_sockets_do_not_hang(self, tmp_path, ending):
        read = coneflat.read_flattening if ending == ".npz" else read_mesh
        os.mkfifo(tmp_path / f"pipe{ending}")
        os.symlink("/dev/zero", tmp_path / f"zero{ending}")
        with socket.socket(socket.AF_UNIX) as listener:
            listener.bind(str(tmp_path / f"socket{ending}"))
            for name in ("pipe", "zero", "socket"):
                with pytest.raises(
                    MeshFileError, match=r"not a file but a device, a pipe or a socket; give - to read"
                ):
                    read(tmp_path / f"{name}{ending}")
        (tmp_path / f"folder{ending}").mkdir()
        with pytest.raises(MeshFileError, match="is a folder"):
            read(tmp_path / f"folder{ending}")


def spiral(count):
    """Return a band wound up."""
    t = np.linspace(1, 12 * np.pi, count // 2)
    rim = [np.stack([r * np.cos(t), r * np.sin(t)], axis=1) for r in (t, t + 2)]
    return np.concatenate([rim[1], rim[0][::-1]])


@pytest.mark.parametrize("count", [60, 3000])
def test_large_polygons_are_tiled(count):
    points = spiral(count)
    size = len(points)
    vertices = np.column_stack([points, np.zeros(size)])
    faces, _ = triangulate(vertices, np.arange(size), np.array([0, size]))
    assert len(faces) == size - 2
    assert len(np.unique(faces)) == size
    a, b, c = points[faces].transpose(1, 0, 2)
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    areas = (ux * vy - uy * vx) / 2
    x, y = points.T
    total = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2
    assert (np.sign(total) * areas).min() > 0
    assert areas.sum() == pytest.approx(total, rel=1e-9)


def test_a_name_that_is_too_long():
    with pytest.raises(MeshFileError, match=r"x\.obj cannot be read: "):
        read_mesh(f"{'x' * 3000}.obj")
