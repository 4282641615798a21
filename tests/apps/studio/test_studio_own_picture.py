"""The texture of a file is shown on the model and on its layout, with the UVs of the file."""

from __future__ import annotations

from io import BytesIO

import numpy as np
import pytest
from gltf_scenes import coloured_ball

import coneflat
from coneflat.apps.transfer import own_picture

Image = pytest.importorskip("PIL.Image")


def test_the_picture_is_that_of_most_triangles(tmp_path):
    path = tmp_path / "ball.glb"
    path.write_bytes(coloured_ball(size=(4096, 2)))
    picture, uv = own_picture(coneflat.read_mesh(path), 1024)
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
