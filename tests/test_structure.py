"""The structure of the package: sizes that only go down, stages side by side, imports without circles."""

from __future__ import annotations

import ast
import sys
from collections import defaultdict
from graphlib import CycleError
from pathlib import Path

import pytest

import coneflat

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tools"))
from structure import (
    STAGES,
    Module,
    imported_packages,
    levels,
    package_of,
    read_modules,
    size_of,
    sizes,
    total,
)

MODULES = read_modules()
#: Lines of code per package, which only go down.
CEILINGS = {
    "": 112,
    "__main__": 3,
    "apps": 0,
    "apps.ahead": 37,
    "apps.batch": 384,
    "apps.blender": 884,
    "apps.cli": 1576,
    "apps.controls": 49,
    "apps.measure_uv": 159,
    "apps.peers": 438,
    "apps.quads": 3752,
    "apps.studio": 1710,
    "apps.transfer": 300,
    "apps.brains": 259,
    "apps.pyvista": 26,
    "apps.unwrap": 1379,
    "apps.view": 1545,
    "atlas": 1352,
    "base": 282,
    "cone_curve": 108,
    "cones": 2045,
    "evaluate": 157,
    "flatten": 221,
    "flattener": 35,
    "geometry": 1542,
    "io": 2823,
    "layout": 1901,
    "linalg": 519,
    "measure": 805,
    "mesh": 533,
    "metric": 915,
    "options": 519,
    "result": 96,
    "sample": 5,
    "seams": 169,
    "source": 509,
    "stages": 219,
    "xatlas": 2,
}
#: Applications with a ceiling of their own, which the ceilings of everything else leave out.
OWN_CEILING = {"apps.blender", "apps.brains", "apps.transfer", "apps.unwrap"}
#: Applications that set up the others, and modules of applications that others may import, beside options.
FRONT = ("apps.ahead", "apps.blender", "apps.cli", "apps.studio")
SHARED = ("apps.quads.nearest",)
#: The largest size of the core, and of everything else.
CORE_FILES, CORE_LINES, ALL_FILES, ALL_LINES = 146, 14_866, 234, 24_542
CONSTANTS, KERNELS, NAMES, LEVELS = 294, 84, 30, 8
#: Lines from which on a file may serve one other file alone.
OWN_FILE = 80


def is_core(name: str) -> bool:
    return name.split(".")[0] not in ("apps", "xatlas", "__main__")


@pytest.fixture(scope="module")
def found():
    return sizes()


def test_packages_are_within_their_ceilings(found):
    lines = {name: size.lines for name, size in found.items()}
    assert {name: count for name, count in lines.items() if count > CEILINGS.get(name, 0)} == {}


def test_the_whole_is_within_its_ceilings(found):
    rest = {name: size for name, size in found.items() if name not in OWN_CEILING}
    core, everything = total(rest, core=True), total(rest, core=False)
    assert (core.files <= CORE_FILES, core.lines <= CORE_LINES) == (True, True), core
    assert (everything.files <= ALL_FILES, everything.lines <= ALL_LINES) == (True, True), everything
    assert (everything.constants <= CONSTANTS, everything.kernels <= KERNELS) == (True, True), everything
    assert len(coneflat.__all__) <= NAMES


def test_packages_do_not_import_each_other_in_circles():
    try:
        found = levels(MODULES)
    except CycleError as error:
        pytest.fail(f"packages import each other in a circle: {' -> '.join(error.args[1])}")
    assert max(level for name, level in found.items() if is_core(name)) <= LEVELS


@pytest.mark.parametrize("stage", STAGES)
def test_stages_stand_side_by_side(stage: str):
    assert imported_packages(MODULES)[stage] & {*STAGES, "options", "flatten"} == set()


@pytest.mark.parametrize("name", sorted(name for name in MODULES if not is_core(name)))
def test_applications_import_what_packages_export(name: str):
    module = MODULES[name]
    imported = module.imports | module.late_imports
    assert {other for other in imported if is_core(other) and other.count(".") > 0} == set()
    if not name.startswith("apps.view"):
        assert {other for other in imported if other.startswith("apps.view.")} == set()


def test_applications_do_not_import_what_is_inside_others():
    found = {
        (name, other)
        for name, module in MODULES.items()
        if name.startswith("apps.") and not name.startswith(FRONT)
        for other in module.imports | module.late_imports
        if other.count(".") > 1 and not is_core(other) and package_of(other) != package_of(name)
    }
    assert {(name, other) for name, other in found if other not in SHARED} == set()


@pytest.mark.parametrize("name", sorted(filter(is_core, MODULES)))
def test_the_core_imports_no_application(name: str):
    module = MODULES[name]
    allowed = name in ("", "result", "__main__")
    imported = set() if allowed else module.imports | module.late_imports
    assert [other for other in imported if not is_core(other)] == []


def test_a_file_for_one_other_is_large():
    """But for formats, which have a file each."""
    users = defaultdict(set)
    for name, module in MODULES.items():
        for other in module.imports | module.late_imports:
            users[other].add(name)
    small = {
        name: size_of(module.path).lines
        for name, module in MODULES.items()
        if module.path.name != "__init__.py"
        and len(users[name]) == 1
        and not name.startswith("io.")
        and len(module.path.read_text().split("\n")) <= OWN_FILE
    }
    assert small == {}


def test_tests_mirror_the_packages():
    tests = Path(__file__).parent
    known = {package_of(name).replace(".", "/") for name in MODULES}
    folders = {
        path.parent.relative_to(tests).as_posix() for path in tests.rglob("test_*.py") if path.parent != tests
    }
    assert folders <= known


def test_the_check_sees_what_it_should(tmp_path):
    (tmp_path / "mesh.py").write_text("def late():\n    from .files import read\n")
    (tmp_path / "files.py").write_text("from . import mesh\n")
    found = read_modules(tmp_path)
    assert found["mesh"] == Module("mesh", tmp_path / "mesh.py", frozenset(), frozenset({"files"}))
    assert found["files"].imports == {"mesh"}
    with pytest.raises(CycleError):
        levels(found)
    assert ast.parse((tmp_path / "mesh.py").read_text())
