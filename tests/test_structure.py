"""The structure of the package: stages side by side, imports without circles."""

from __future__ import annotations

import ast
import re
import sys
from graphlib import CycleError, TopologicalSorter
from importlib import import_module
from pathlib import Path

import pytest

import coneflat

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tools"))
from structure import (
    STAGES,
    Module,
    file_circles,
    imported_packages,
    levels,
    module_paths,
    package_of,
    read_modules,
)

NAMES = module_paths()
#: Applications that set up the others.
FRONT = ("apps.warm_up", "apps.blender", "apps.cli", "apps.studio")
#: The most levels of the packages of the core.
LEVELS = 10


def is_core(name: str) -> bool:
    return name.split(".")[0] not in ("apps", "xatlas", "__main__")


def test_packages_do_not_import_each_other_in_circles():
    try:
        package_levels = levels(read_modules())
    except CycleError as error:
        pytest.fail(f"packages import each other in a circle: {' -> '.join(error.args[1])}")
    assert max(level for name, level in package_levels.items() if is_core(name)) <= LEVELS


def test_files_do_not_import_each_other_in_circles():
    assert file_circles(read_modules()) == []


def test_folders_of_patterns_do_not_import_each_other_in_circles():
    """Files beside the folders, such as the result, combine them."""
    folders: dict[str, set[str]] = {}
    for name, module in read_modules().items():
        folder = _folder_of_patterns(name)
        if folder:
            imported = {_folder_of_patterns(target) for target in module.imports | module.late_imports}
            folders.setdefault(folder, set()).update(imported - {"", folder})
    assert {"pieces", "drawing", "pages"} <= folders.keys()
    assert [*TopologicalSorter(folders).static_order()]


def _folder_of_patterns(name: str) -> str:
    inner = name.removeprefix("apps.patterns.") if name.startswith("apps.patterns.") else ""
    return inner.partition(".")[0] if "." in inner else ""


def test_entry_points_are_functions_of_the_package():
    """Names of functions in text, which imports do not check."""
    texts = [path.read_text(encoding="utf-8") for path in NAMES.values()]
    targets = {target for text in texts for target in re.findall(r'\bEntryPoint\[.*\]\("(.+?)"\)', text)}
    assert len(targets) > 9
    for target in targets:
        module, _, name = target.partition(":")
        assert callable(getattr(import_module(f"coneflat.{module}"), name)), target


def test_no_module_replaces_a_public_name():
    """Importing such a module would replace the function as attribute of the package."""
    modules = {name.split(".")[0] for name in NAMES}
    assert modules & {*coneflat.__all__} == {"errors"}


@pytest.mark.parametrize("stage", STAGES)
def test_stages_stand_side_by_side(stage: str):
    assert imported_packages(read_modules())[stage] & {*STAGES, "options", "flattening"} == set()


@pytest.mark.parametrize("name", sorted(name for name in NAMES if not is_core(name)))
def test_applications_import_what_packages_export(name: str):
    module = read_modules()[name]
    imported = module.imports | module.late_imports
    assert {
        module_name for module_name in imported if is_core(module_name) and module_name.count(".") > 0
    } == set()
    if not name.startswith("apps.view"):
        assert {module_name for module_name in imported if module_name.startswith("apps.view.")} == set()


def test_applications_do_not_import_what_is_inside_others():
    violations = {
        (name, imported)
        for name, module in read_modules().items()
        if name.startswith("apps.") and not name.startswith(FRONT)
        for imported in module.imports | module.late_imports
        if imported.count(".") > 1 and not is_core(imported) and package_of(imported) != package_of(name)
    }
    assert violations == set()


@pytest.mark.parametrize("name", sorted(filter(is_core, NAMES)))
def test_the_core_imports_no_application(name: str):
    module = read_modules()[name]
    allowed = name in ("", "__main__")
    imported = set() if allowed else module.imports | module.late_imports
    assert [module_name for module_name in imported if not is_core(module_name)] == []


def test_no_module_has_the_name_of_a_public_function():
    """But the application `studio`, which `coneflat.studio` opens."""
    functions = {name for name in coneflat.__all__ if callable(getattr(coneflat, name))}
    assert {name for name in NAMES if name.split(".")[-1] in functions} == {"apps.studio"}


def test_tests_mirror_the_packages():
    tests = Path(__file__).parent
    packages = {package_of(name).replace(".", "/") for name in NAMES}
    folders = {
        path.parent.relative_to(tests).as_posix() for path in tests.rglob("test_*.py") if path.parent != tests
    }
    assert folders <= packages


def test_late_imports_and_circles_are_found(tmp_path):
    (tmp_path / "mesh.py").write_text("def late():\n    from .files import read\n")
    (tmp_path / "files.py").write_text("from . import mesh\n")
    modules = read_modules(tmp_path)
    assert modules["mesh"] == Module("mesh", tmp_path / "mesh.py", frozenset(), frozenset({"files"}))
    assert modules["files"].imports == {"mesh"}
    with pytest.raises(CycleError):
        levels(modules)
    assert file_circles(modules) == [["files", "mesh"]]
    assert ast.parse((tmp_path / "mesh.py").read_text())
