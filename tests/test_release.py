"""What a release says in several files agrees."""

from __future__ import annotations

import re
import sys
from typing import Any

import pytest
from markers import ROOT
from wheels import DEVELOPERS_EXTRAS, EXTRAS, Resolution

import coneflat

if sys.version_info >= (3, 11):
    import tomllib
else:
    tomllib = pytest.importorskip("tomli")

#: Names that conda-forge writes differently, and what it has not.
CONDA_NAMES = {"mapbox-earcut": "mapbox_earcut"}
NOT_ON_CONDA = {"rslab"}


def text(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def project() -> dict[str, Any]:
    return tomllib.loads(text("pyproject.toml"))["project"]


@pytest.mark.parametrize(
    ("name", "pattern"),
    [
        ("CITATION.cff", r"^version: (.+)$"),
        ("CHANGELOG.md", r"\A# Changelog[^#]*^## (\S+)$"),
        ("packaging/conda/recipe.yaml", r'^  version: "(.+)"$'),
        ("pyproject.toml", r'^version = "(.+)"$'),
    ],
)
def test_versions_agree(name: str, pattern: str):
    assert re.findall(pattern, text(name), re.MULTILINE) == [coneflat.__version__]


def test_pythons_are_those_that_the_workflow_tests(project):
    named = {line.split(" :: ")[-1] for line in project["classifiers"] if re.search(r":: 3\.\d+$", line)}
    tested = set(re.findall(r'"(3\.\d+)"', text(".github/workflows/tests.yml")))
    assert named == tested
    assert project["requires-python"] == ">=" + min(named, key=lambda version: int(version[2:]))


def test_the_recipe_for_conda_needs_what_the_package_needs(project):
    recipe = re.search(r"^  run:\n((?:    - .*\n)+)", text("packaging/conda/recipe.yaml"), re.MULTILINE)
    assert recipe is not None
    lines = [line.strip("- ") for line in recipe[1].splitlines() if "python" not in line]
    # Intel Macs have a bound of their own for wheels.
    needed = {re.sub(r"[ ;].*", "", line) for line in project["dependencies"] if "== 'darwin'" not in line}
    bounds = dict(re.fullmatch(r"([\w-]+)(>=[\d.,<]+)", line).groups() for line in needed)
    assert {
        f"{CONDA_NAMES.get(name, name)} {bound}" for name, bound in bounds.items() if name not in NOT_ON_CONDA
    } == set(lines)


def test_wheels_are_resolved_for_every_extra(project):
    assert {*EXTRAS, *DEVELOPERS_EXTRAS} == set(project["optional-dependencies"])
    assert not set(EXTRAS) & set(DEVELOPERS_EXTRAS)


def test_the_package_without_wheels_is_named():
    error = (
        "Because a==2 has no usable wheels and c depends on a>=2, we can conclude that c is unsatisfiable."
        "\n\nhint: Wheels are required for `a` because building from source is disabled for all packages"
    )
    assert Resolution({}, error).cell == "no wheel: a"
    assert Resolution({}, "c==1 and d==1 need different versions of e").cell == "fails"
    assert Resolution({"a": "2.0", "b": "1.0"}).cell == "2"


def test_the_page_on_containers_shows_the_dockerfile():
    shown = re.search(r"```dockerfile\n(.*?)```", text("docs/how-to/container.md"), re.DOTALL)
    assert shown is not None
    lines = text("packaging/Dockerfile").splitlines(keepends=True)
    assert shown[1] == "".join(line for line in lines if not line.startswith("#"))
