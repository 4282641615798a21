from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from shapes import sphere

import coneflat


def test_every_public_name_is_there():
    assert set(coneflat.__all__) == {*coneflat._HOMES, "errors", "__version__"}
    for name in coneflat.__all__:
        assert getattr(coneflat, name) is not None
    assert set(coneflat.__all__) <= set(dir(coneflat))
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = coneflat.nothing


def test_import_and_help_load_nothing_heavy():
    script = "import sys, coneflat, coneflat.apps.cli.main; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    ).stdout.split()
    assert not {"numpy", "scipy", "trimesh", "matplotlib", "rich"} & set(loaded)


def test_errors_have_one_root():
    kinds = [kind for kind in vars(coneflat.errors).values() if isinstance(kind, type)]
    assert len(kinds) > 10
    assert all(issubclass(kind, coneflat.ConeflatError) for kind in kinds)


def test_kernels_compiled_ahead_are_all_that_flattening_needs(tmp_path):
    """What compiles after `coneflat.ahead` in a new process was missed: other kernels or other types."""
    vertices, faces = sphere(4)
    np.savez(tmp_path / "mesh.npz", vertices=vertices, faces=faces)
    script = """
import sys
import numpy
from numba.core import event
import coneflat

class Listener(event.Listener):
    def on_start(self, happening):
        print(happening.data["dispatcher"].py_func.__name__)

    def on_end(self, happening):
        pass

event.register("numba:compile", Listener())
with numpy.load(sys.argv[1]) as mesh:
    vertices, faces = mesh["vertices"], mesh["faces"]
flat = one = coneflat.flatten(vertices, faces, charts="atlas")
coneflat.pack_together([one, one])
coneflat.flatten(coneflat.read_mesh(flat.save(sys.argv[1] + ".obj"), weld=True))
coneflat.flatten(vertices, faces[5:], min_cone_angle=0.3, max_cones=6)
coneflat.flatten(coneflat.sample_path(), method="linear")
"""
    subprocess.run([sys.executable, "-m", "coneflat.ahead"], check=True)
    compiled = subprocess.run(
        [sys.executable, "-c", script, tmp_path / "mesh.npz"], capture_output=True, text=True, check=True
    )
    assert compiled.stdout.split() == []
