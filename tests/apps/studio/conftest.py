"""A mesh file, and a session of the studio in which it is open."""

from __future__ import annotations

import pytest
import shapes

from coneflat.apps.studio.session import Session


@pytest.fixture
def mesh(tmp_path):
    return shapes.write_obj(tmp_path / "ball.obj", *shapes.sphere(3))


@pytest.fixture
def session(tmp_path, mesh):
    opened = Session(tmp_path)
    opened.open(mesh)
    yield opened
    opened.close()
