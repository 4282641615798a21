"""The Blender extension: its zip, and what runs without bpy."""

from __future__ import annotations

import ast
import importlib
import itertools
import os
import sys
import time
import types
import zipfile
from pathlib import Path

import numpy as np
import pytest
from command import command
from shapes import box, torus

import coneflat
from coneflat.apps.blender import COMMANDS, HIDDEN, build_extension
from coneflat.apps.cli.main import cli

SESSION = Path(__file__).with_name("session.py")
SESSIONS = (
    "three_objects", "again", "selected_faces", "sharp_edges", "vertex_groups", "quads", "unapplied", "failures",
    "escape", "disable", "edited_together", "all_or_none", "vertex_lists", "mirrored", "panels",
    "lightmaps", "second_uv_set",
)  # fmt: skip


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    return build_extension(tmp_path_factory.mktemp("blender") / "coneflat.zip")


@pytest.fixture(scope="module")
def extension(archive):
    """The modules of the extension that do not need bpy, as they are in the zip."""
    folder = archive.parent / "extension"
    with zipfile.ZipFile(archive) as opened:
        opened.extractall(folder)
    package = types.ModuleType("coneflat_extension")
    package.__path__ = [str(folder)]
    sys.modules[package.__name__] = package
    for name in ("job", "environment", "exchange"):
        setattr(package, name, importlib.import_module(f"{package.__name__}.{name}"))
    return package


def test_every_session_is_run():
    tree = ast.parse(SESSION.read_text(encoding="utf-8"))
    functions = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}
    assert set(SESSIONS) <= functions.keys()
    called = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    assert functions.keys() - called - {"main"} == set(SESSIONS)


def test_the_command_writes_the_same_zip_each_time(archive, tmp_path):
    done = command("blender", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, "wrote coneflat_blender.zip\n")
    assert (tmp_path / "coneflat_blender.zip").read_bytes() == archive.read_bytes()
    done = command("blender", "-o", "coneflat.blend", cwd=tmp_path)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1


def test_the_manifest_has_what_blender_requires(archive):
    tomllib = pytest.importorskip("tomllib")
    with zipfile.ZipFile(archive) as opened:
        manifest = tomllib.loads(opened.read("blender_manifest.toml").decode())
        names = opened.namelist()
    assert "__init__.py" in names
    assert manifest["version"] == coneflat.__version__
    assert manifest["blender_version_min"] == "4.2.0"
    # Limits of Blender's validation.
    texts = [manifest["tagline"], *manifest["permissions"].values()]
    assert all(len(text) <= 64 and text[-1].isalnum() for text in texts)
    assert set(manifest) >= {"schema_version", "id", "name", "maintainer", "type", "license"}


def test_the_extension_imports_only_what_blender_has(archive):
    with zipfile.ZipFile(archive) as opened:
        for name in opened.namelist():
            if not name.endswith(".py"):
                continue
            for node in ast.walk(ast.parse(opened.read(name))):
                modules = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
                if isinstance(node, ast.ImportFrom) and node.level == 0:
                    modules = [node.module]
                assert node.level < 2 if isinstance(node, ast.ImportFrom) else True
                roots = {module.split(".")[0] for module in modules}
                assert roots <= {"bpy", "numpy", *sys.stdlib_module_names}, name


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_every_option_of_a_command_is_shown_or_hidden_for_a_reason(name, extension):
    records = extension.environment.OPTIONS_FILE["commands"][name]
    shown = [record["name"] for record in records]
    hidden = {option.removeprefix(f"{name} ") for names in HIDDEN.values() for option in names}
    params = {option.name for option in cli.commands[name].params}
    assert len(set(shown)) == len(shown)
    assert params - hidden == set(shown)


def test_no_option_is_hidden_that_no_command_has():
    options = {name for command in COMMANDS for option in cli.commands[command].params for name in
        (option.name, f"{command} {option.name}")}  # fmt: skip
    assert {name for names in HIDDEN.values() for name in names} - options == {"strict"}  # a word of repair


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_the_groups_are_those_of_the_command(name, extension):
    records = extension.environment.OPTIONS_FILE["commands"][name]
    groups = {option.name: getattr(option, "group", "") for option in cli.commands[name].params}
    assert all(groups[record["name"]].startswith(record["group"]) for record in records)
    order = [title for title, _ in itertools.groupby(record["group"] for record in records)]
    assert len(set(order)) == len(order)


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_every_option_becomes_a_flag(name, extension):
    records = extension.environment.OPTIONS_FILE["commands"][name]
    flags = {flag for option in cli.commands[name].params for flag in option.opts}
    defaults = {record["name"]: record["default"] for record in records}
    assert extension.exchange.arguments(records, defaults) == []
    for record in records:
        kind = record["kind"]
        changed = record["default"] + 1 if kind in ("number", "integer", "angle") else "group"
        arguments = extension.exchange.arguments(records, {**defaults, record["name"]: changed})
        assert [argument.split("=")[0] in flags for argument in arguments] == [True] * (kind != "vertices")


@pytest.mark.parametrize(
    ("value", "argument"),
    [("", None), ("curvature", "curvature"), ("0.25", "0.25"), ("1e-3", "1e-3"), ("coarse.001", "size")],
)
def test_a_size_is_a_number_a_word_or_a_vertex_group(value, argument, extension):
    (record,) = (
        option
        for option in extension.environment.OPTIONS_FILE["commands"]["quads"]
        if option["name"] == "size"
    )
    arguments = extension.exchange.arguments([record], {"size": value})
    assert arguments == ([] if argument is None else [f"--size={argument}"])
    assert extension.exchange.names_group(record, value) == (argument == "size")


def test_numbers_of_single_precision_are_written_as_they_were_typed(extension):
    records = extension.environment.OPTIONS_FILE["commands"]["flatten"]
    values = {record["name"]: record["default"] for record in records}
    values |= {"distortion": float(np.float32(0.1)), "quantise": float(np.float32(np.pi / 2)), "up": "-x"}
    arguments = extension.exchange.arguments(records, values)
    assert set(arguments) == {"--distortion=0.1", "--quantise=90deg", "--up=-x"}
    values["distortion"] = float(np.float32(0.2))
    assert "--distortion" not in " ".join(extension.exchange.arguments(records, values))


@pytest.mark.slow
def test_maps_of_two_meshes_in_one_atlas(extension, tmp_path):
    """A mesh of quads with a marked loop and one of triangles: seams are where UVs differ, and densities agree."""
    exchange = extension.exchange
    around, across = 24, 12
    i, j = (numbers.ravel() for numbers in np.mgrid[:around, :across])
    u, v = 2 * np.pi * i / around, 2 * np.pi * j / across
    ring = np.stack([(2 + np.cos(v)) * np.cos(u), (2 + np.cos(v)) * np.sin(u), np.sin(v)], axis=1)
    steps = ((0, 0), (1, 0), (1, 1), (0, 1))
    quads = np.stack([(i + a) % around * across + (j + b) % across for a, b in steps], axis=1)
    loop = np.stack([np.arange(across), np.roll(np.arange(across), -1)], axis=1)
    points, faces = box(3)
    parts = [
        exchange.Part("ring", ring, quads.ravel(), np.full(len(quads), 4), lists={"seams": loop}),
        exchange.Part(
            "box",
            points + np.array([1, 0, 0]),  # They intersect, which does not matter.
            faces.ravel(),
            np.full(len(faces), 3),
            {"seam_weights": np.linspace(0, 1, len(points))},
        ),
    ]
    arguments = exchange.write_parts(tmp_path, parts)
    done = command("unwrap", *arguments, "--seam-weights=seam_weights", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    maps, report = exchange.read_maps(tmp_path, parts)
    assert report["flipped"] == 0
    densities = []
    for part, layout in zip(parts, maps, strict=True):
        assert np.isfinite(layout.uv).all()
        assert layout.torn == 0
        size = part.sizes[0]
        corners, uv = part.corners.reshape(-1, size), layout.uv.reshape(-1, size, 2)
        seen, torn = {}, set()
        for polygon, at in zip(corners, uv, strict=True):
            for k in range(size):
                ends = {int(polygon[k - 1]): tuple(at[k - 1]), int(polygon[k]): tuple(at[k])}
                if seen.setdefault(frozenset(ends), ends) != ends:
                    torn.add(frozenset(ends))
        assert torn == {frozenset(pair) for pair in layout.seams.tolist()}
        d = uv[:, 2:] - uv[:, :1], uv[:, 1:-1] - uv[:, :1]
        flat = (d[1][..., 0] * d[0][..., 1] - d[1][..., 1] * d[0][..., 0]).sum(axis=1) / 2
        assert (flat > 0).all()
        p = part.positions[corners]
        area = np.linalg.norm(np.cross(p[:, 1:-1] - p[:, :1], p[:, 2:] - p[:, :1]), axis=2).sum() / 2
        densities.append(flat.sum() / area)
    assert max(densities) < 1.1 * min(densities)
    assert {frozenset(pair) for pair in loop.tolist()} <= {frozenset(p) for p in maps[0].seams.tolist()}


@pytest.mark.slow
def test_a_mesh_that_is_repaired_keeps_its_corners(extension, tmp_path):
    """A reversed triangle and one that occurs twice: all corners get their points."""
    exchange = extension.exchange
    points, faces = torus(16, 8)
    faces = np.concatenate([faces, faces[:1]])
    faces[5] = faces[5][::-1]
    part = exchange.Part("torus", points, faces.ravel(), np.full(len(faces), 3))
    arguments = exchange.write_parts(tmp_path, [part])
    assert command("flatten", *arguments, cwd=tmp_path).returncode == 0
    (layout,), _ = exchange.read_maps(tmp_path, [part])
    uv = layout.uv.reshape(-1, 3, 2)
    first, second = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    flat = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    assert (flat[[0, -1]] != 0).all()
    assert not np.isnan(flat).any()
    assert flat[5] < 0
    assert (np.delete(flat, [0, 5, len(flat) - 1]) > 0).all()


def test_a_result_that_is_missing(extension, tmp_path):
    with pytest.raises(extension.job.Failure, match="cannot be read: .*No such file"):
        extension.exchange.read_quads(tmp_path)


def wait(job):
    while not job.is_done:
        time.sleep(0.01)


def python(extension, code, name="Work"):
    return extension.job.Job(name, [sys.executable, "-c", code])


def test_a_job_reports_its_progress(extension):
    lines = "print('  1.2 s   43%  check mesh', flush=True); import time; time.sleep(60)"
    with python(extension, lines) as job:
        while not job.stage:
            time.sleep(0.01)
        assert (job.stage, job.fraction) == ("check mesh", 0.43)
        assert not job.is_done
    assert job.is_done


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ("print('coneflat: error: no faces'); raise SystemExit(2)", "^Work: no faces$"),
        ("print('Error: no faces (see `coneflat unwrap --help`)'); raise SystemExit(2)", "^Work: no faces$"),
        ("print('ERROR: no wheel\\n leaked'); raise SystemExit(1)", "Work: no wheel"),
        ("raise ValueError('bad')", "Work ended with code 1: ValueError: bad"),
        ("print('x' * 10**6); raise SystemExit(2)", "Work ended with code 2: x"),
    ],
)
def test_an_error_is_one_line(code, message, extension):
    with python(extension, code) as job:
        wait(job)
        with pytest.raises(extension.job.Failure, match=message) as raised:
            job.check()
    assert "\n" not in str(raised.value)
    assert len(str(raised.value)) < 300


@pytest.mark.skipif(os.name == "nt", reason="there are no signals")
def test_a_crash_is_one_line(extension):
    with python(extension, "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)") as job:
        wait(job)
        with pytest.raises(extension.job.Failure, match="^Work crashed or was ended by SIGSEGV$"):
            job.check()


def test_a_program_that_does_not_exist(extension):
    with pytest.raises(extension.job.Failure, match="missing cannot be started: No such file"):
        extension.job.Job("Work", ["missing"])


def fake(folder, version, words="coneflat,"):
    """Return a program that prints a version, of coneflat by default."""
    program = folder / "python"
    program.write_text(f"#!/bin/sh\necho {words} version {version}\n")
    program.chmod(0o755)
    return str(program)


@pytest.mark.skipif(os.name == "nt", reason="the programs are scripts of a shell")
def test_the_environment_is_found(extension, tmp_path, monkeypatch):
    environment, failure = extension.environment, extension.job.Failure
    monkeypatch.setenv("PYTHONPATH", str(Path(coneflat.__file__).parents[1]))
    folder = tmp_path / "own"
    current = environment.find(sys.executable, folder)
    assert current.command == (sys.executable, "-m", "coneflat")
    assert current.version == coneflat.__version__
    with pytest.raises(failure, match="older than the extension"):
        environment.find(fake(tmp_path, "0.1.0"), folder)
    with pytest.raises(failure, match="does not run coneflat: other coneflat, licence version 3"):
        environment.find(fake(tmp_path, "3", "other coneflat, licence"), folder)
    fake(tmp_path, "99.0")
    monkeypatch.setenv("PATH", str(tmp_path))
    assert environment.find("", folder).command == (str(tmp_path / "python"), "-m", "coneflat")
    (folder / "bin").mkdir(parents=True)
    fake(folder / "bin", "99.1")
    assert environment.find("", folder).version == "99.1"
    assert environment.find(str(folder), tmp_path).version == "99.1"
    monkeypatch.setenv("PATH", "")
    with pytest.raises(failure, match="coneflat is not installed: .* name a Python that has coneflat"):
        environment.find("", tmp_path)


@pytest.mark.slow
def test_an_environment_without_a_network(extension, tmp_path, monkeypatch):
    commands, failure = extension.environment.install_commands, extension.job.Failure
    with pytest.raises(
        failure, match="not installed: .* name a Python that has coneflat, or a folder of wheels"
    ):
        commands(tmp_path, "", "", True)
    with pytest.raises(failure, match="online access is off: allow it"):
        commands(tmp_path, "coneflat", "", False)
    with pytest.raises(failure, match="wheels, does not exist"):
        commands(tmp_path, "", str(tmp_path / "none"), True)
    for name in [name for name in os.environ if name.startswith("PIP_")]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("PIP_CONFIG_FILE", os.devnull)
    monkeypatch.setenv("PIP_INDEX_URL", "http://127.0.0.1:9/simple")
    assert commands(tmp_path, "", str(tmp_path), True)[1][1][-1] == f"coneflat>={coneflat.__version__}"
    make, install, _ = commands(tmp_path / "own", "coneflat", "", True)
    with extension.job.Job(*make) as job:
        wait(job)
        job.check()
    with extension.job.Job(*install) as job:
        wait(job)
        with pytest.raises(failure, match="^install coneflat: there is no network; .* a folder of wheels$"):
            job.check()
    install = commands(tmp_path / "own", "coneflat", str(tmp_path), False)[1]
    with extension.job.Job(*install) as job:
        wait(job)
        with pytest.raises(failure, match="^install coneflat: No matching distribution found for coneflat"):
            job.check()
