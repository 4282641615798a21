"""Imports run one way: each room is built on rooms below it alone, and no two files import each other in a circle."""

from __future__ import annotations

import ast
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tools"))
from house import FLOORS, Module, floor_of, read_modules

MODULES = read_modules()
#: Doors: calls by which what is below hands over to what is above, late and in one function each.
DOORS = {
    ("input.arrays", "files"),  # a path in place of a mesh
    ("result.mapped", "files.read"),  # likewise
    ("result.mapped", "files.npz"),  # likewise
    ("result.flattening", "files"),  # Flattening.save
    ("result.flattening", "files.written"),  # Flattening.as_written
    ("result.flattening", "files.packages"),  # Flattening.to_trimesh, .to_pyvista, .to_meshio
    ("result.flattening", "view.page.webpage"),  # Flattening.view
    ("grid.quad_mesh", "files.quads"),  # QuadMesh.save, .load
    ("grid.integer_map", "files.grid"),  # IntegerGrid.save, .load
}


def test_every_module_has_a_floor():
    assert [name for name in MODULES if floor_of(name) is None] == []


@pytest.mark.parametrize("name", sorted(MODULES))
def test_imports_lead_down(name: str):
    module = MODULES[name]
    upwards = {
        other
        for other in module.imports | module.late_imports
        if floor_of(other) > floor_of(name) and not (other in module.late_imports and (name, other) in DOORS)
    }
    assert not upwards, f"{name} is on floor {floor_of(name)} and imports {', '.join(sorted(upwards))} above"


def test_no_circle():
    graph = {
        name: module.imports | {other for other in module.late_imports if (name, other) not in DOORS}
        for name, module in MODULES.items()
    }
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(f"files import each other in a circle: {' -> '.join(error.args[1])}")


def test_doors_are_used():
    assert {(name, other) for name, other in DOORS if other in MODULES[name].late_imports} == DOORS


def test_the_check_sees_what_it_should(tmp_path):
    (tmp_path / "mesh.py").write_text("def late():\n    from .files import read\n")
    (tmp_path / "files.py").write_text("from . import mesh\n")
    found = read_modules(tmp_path)
    assert found["mesh"] == Module("mesh", tmp_path / "mesh.py", frozenset(), frozenset({"files"}))
    assert found["files"].imports == {"mesh"}
    assert floor_of("files") > floor_of("mesh")
    assert ast.parse((tmp_path / "mesh.py").read_text())
    assert len(FLOORS) > 5
