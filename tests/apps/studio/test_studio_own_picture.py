"""The texture of a file is shown on the model and on its layout, with the UVs of the file."""

from __future__ import annotations

from io import BytesIO

import numpy as np
import pytest
from gltf_scenes import SceneMaker
from shapes import sphere

import coneflat
from coneflat.apps.studio.outputs import own_picture

Image = pytest.importorskip("PIL.Image")


def coloured_ball(size=(4, 2), image=None, slot=None):
    """Return a GLB of a ball whose texture is red where x > 0 and green elsewhere, and of a plain triangle."""
    vertices, faces = sphere(3)
    corners = vertices[faces].reshape(-1, 3)
    is_red = np.repeat(vertices[faces].mean(axis=1)[:, 0] > 0, 3)
    uv = np.stack([np.where(is_red, 0.25, 0.75), np.full(len(corners), 0.5)], axis=1)
    stream, pixels = BytesIO(), np.zeros((size[1], size[0], 3), np.uint8)
    pixels[:, : size[0] // 2, 0] = pixels[:, size[0] // 2 :, 1] = 255
    Image.fromarray(pixels).save(stream, format="PNG")
    make = SceneMaker()
    content = stream.getvalue() if image is None else image
    make.tree |= {
        "images": [{"bufferView": make.view(content), "mimeType": "image/png"}],
        "textures": [{"source": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": slot or {"index": 0}}}, {}],
    }
    ball = {
        "attributes": {
            "POSITION": make.accessor(corners),
            "TEXCOORD_0": make.accessor(uv + np.array([1, 0])),
        },
        "material": 0,
    }
    plain = {"attributes": {"POSITION": make.accessor([[3.0, 0, 0], [4, 0, 0], [3, 1, 0]])}, "material": 1}
    make.tree |= {
        "meshes": [{"primitives": [plain, ball]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    }
    return make.glb()


def test_the_picture_is_that_of_most_triangles(tmp_path):
    path = tmp_path / "ball.glb"
    path.write_bytes(coloured_ball(size=(4096, 2)))
    picture, uv = own_picture(coneflat.read_mesh(path))
    image = Image.open(BytesIO(picture.content))
    assert max(image.size) == 1024
    assert (uv[:3] == -1e6).all()
    assert set(np.round(uv[3:, 0], 6)) == {1.25, 1.75}  # they repeat


def test_files_without_a_readable_picture_have_none(tmp_path):
    path = tmp_path / "ball.glb"
    path.write_bytes(coloured_ball(slot=5))
    assert own_picture(coneflat.read_mesh(path)) is None
    path.write_bytes(coloured_ball(image=b"\x89PNG\r\n\x1a\n broken"))
    assert own_picture(coneflat.read_mesh(path)) is None
    assert own_picture(coneflat.read_mesh(coneflat.sample_path())) is None
