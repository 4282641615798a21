from __future__ import annotations

import doctest
import subprocess
import sys
from importlib import import_module

import numpy as np
import pytest
from shapes import sphere

import coneflat


def test_every_public_name_is_there():
    assert set(coneflat.__all__) == {*coneflat._HOMES, *coneflat._MODULES, "__version__"}
    for name in coneflat.__all__:
        assert getattr(coneflat, name) is not None
    assert set(coneflat.__all__) <= set(dir(coneflat))
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = coneflat.nothing


def test_packages_for_experts_are_there_and_not_public():
    assert {"cones", "stages"} <= set(coneflat._PACKAGES)
    assert not set(coneflat._PACKAGES) & set(coneflat.__all__)
    for name in coneflat._PACKAGES:
        assert getattr(coneflat, name) is import_module(f"coneflat.{name}")


def test_import_and_help_load_nothing_heavy():
    script = "import sys, coneflat, coneflat.apps.cli.main; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    ).stdout.split()
    assert not {"numpy", "scipy", "trimesh", "matplotlib", "rich"} & set(loaded)


def test_errors_have_one_root():
    kinds = {kind for kind in vars(coneflat.errors).values() if isinstance(kind, type)}
    errors = kinds - {coneflat.GuaranteeWarning}
    assert len(errors) > 10
    assert all(issubclass(kind, coneflat.ConeflatError) for kind in errors)


@pytest.mark.slow
def test_warming_up_compiles_all_that_flattening_needs(tmp_path):
    """What compiles after `coneflat.apps.warm_up` in a new process was missed: other kernels or other types."""
    vertices, faces = sphere(5)
    np.savez(tmp_path / "mesh.npz", vertices=vertices, faces=faces)
    script = """
import sys
from importlib import import_module
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
flat = coneflat.flatten(vertices, faces, charts="atlas")
coneflat.flatten(coneflat.read_mesh(flat.save(sys.argv[1] + ".obj"), weld=True))
coneflat.flatten(vertices, faces[5:], min_cone_angle=0.3, max_cones=6)
coneflat.flatten(coneflat.sample_path(), method="linear")
coneflat.unwrap(vertices, faces[5:])
"""
    subprocess.run([sys.executable, "-m", "coneflat.apps.warm_up"], check=True)
    compiled = subprocess.run(
        [sys.executable, "-c", script, tmp_path / "mesh.npz"], capture_output=True, text=True, check=True
    )
    assert compiled.stdout.split() == []


def test_flattening_a_file_loads_no_more_than_it_uses(tmp_path):
    """Outside a terminal there are no tables of rich, and nothing searches for near points."""
    script = """
import sys
from importlib import import_module
from coneflat.apps.cli.main import cli
cli.main(["flatten", sys.argv[1], "-o", sys.argv[2]], standalone_mode=False)
print(*sys.modules)
"""
    command = [sys.executable, "-c", script, coneflat.sample_path(), tmp_path / "flat.obj"]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split("\n")
    unused = {"trimesh", "matplotlib", "PIL", "rich", "scipy.spatial", "scipy.optimize", "pypardiso"}
    assert "coneflat.flattening" in printed[-2].split()
    assert not unused & set(printed[-2].split())


@pytest.mark.slow
@pytest.mark.parametrize("name", coneflat.__all__)
def test_examples_of_public_names_run(name, tmp_path, monkeypatch):
    """Those of its own docstring; plain values have none, and theirs are in the docstring of the package."""
    documented = getattr(coneflat, name)
    if isinstance(documented, (dict, str)):
        documented = coneflat
    if name in ("make_figure", "save_figure"):
        pytest.importorskip("matplotlib")
    if name == "studio":
        pytest.importorskip("starlette")
        pytest.importorskip("uvicorn")
    monkeypatch.chdir(tmp_path)
    doctests = doctest.DocTestFinder(recurse=False).find(
        documented, name, globs={"coneflat": coneflat, "np": np}
    )
    examples = [example for test in doctests for example in test.examples]
    run = [example.source for example in examples if not example.options.get(doctest.SKIP)]
    about = [source for source in run if name in source] if documented is coneflat else run
    assert about
    printed = []
    runner = doctest.DocTestRunner(verbose=False)
    for test in doctests:
        runner.run(test, out=printed.append)
    assert "".join(printed) == ""
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "call",
    [
        lambda result: coneflat.quads(coneflat.sample_path(), quads=set()),
        lambda result: coneflat.quads(result.vertices, result.faces, quads=30, smooth=2.5),
        lambda result: coneflat.integer_grid(result, stretch="x"),
        lambda result: result.as_written(np.array([])),
        lambda result: coneflat.measure_uv(1j, 2, 3),
        lambda result: coneflat.measure_uv(result.vertices, result.faces, 1j),
        lambda result: import_module("coneflat.geometry").find_overlaps(
            result.uv, result.uv_faces, limit="x"
        ),
        lambda result: import_module("coneflat.optimise").StretchEnergy("x"),
        lambda result: import_module("coneflat.optimise").StretchEnergy(0.0, [1]),
    ],
)
def test_values_of_a_wrong_type_are_errors_of_the_package(call):
    vertices = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
    result = coneflat.flatten(vertices, [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
    with pytest.raises(coneflat.ConeflatError, match="must be|has the shape|number"):
        call(result)
