"""Sessions of the Blender extension in Blender, where bpy can be imported."""
# ruff: noqa: F811  (fixtures that are imported)

from __future__ import annotations

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from test_blender import SESSION, SESSIONS, archive  # noqa: F401

import coneflat

if find_spec("bpy") is None:
    pytest.skip("bpy is not installed", allow_module_level=True)

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("name", SESSIONS)
def test_session(name, archive, tmp_path):
    source = str(Path(coneflat.__file__).parents[1])
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(tmp_path), "PYTHONPATH": source}
    done = subprocess.run(
        [sys.executable, SESSION, name, archive], env=environment, capture_output=True, text=True, timeout=900
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
