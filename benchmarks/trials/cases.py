"""One case: a kind and a seed, run in this process."""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import signal
import tempfile
import time
import warnings
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from .arguments import DOORS, Calls
from .attributes import attribute_case
from .choices import cross_options, in_short, make_options
from .commands import interrupt_command, make_command, run_command, run_without_streams
from .doubled import doubled_case
from .files import make_file
from .grids import few_case, grid_case, grid_of_mesh
from .meshes import make_many, make_mesh, make_tiny
from .offsets import offset_case
from .outcome import LONGEST_MESSAGE, Outcome
from .promises import check
from .textures import texture_case, texture_mesh
from .transfers import transfer_case
from .written import READERS, check_file, check_report

Random = np.random.Generator

#: Faces of a file's mesh at most that are flattened: a damaged one may have many.
LARGEST_FILE = 5_000


def run_case(kind: str, seed: int) -> Outcome:
    """Return the outcome of a case; all files it writes are removed afterwards."""
    outcome = Outcome(kind, seed)
    rng = np.random.default_rng([zlib.crc32(kind.encode()), seed])
    home, folder = Path.cwd(), Path(tempfile.mkdtemp(prefix="case", dir="."))
    before = _resident("VmRSS")
    began = time.perf_counter()
    try:
        os.chdir(folder)
        with outcome.guarded("harness or package: "):
            KINDS[kind](rng, outcome)
    finally:
        os.chdir(home)
        shutil.rmtree(folder, ignore_errors=True)
    outcome.seconds = time.perf_counter() - began
    outcome.memory = max(0.0, _resident("VmHWM") - before)
    return outcome


def warm_up() -> None:
    """Load and compile everything that cases need, so that it is not part of their time."""
    import shapes

    import coneflat

    for charts in ("one", "atlas"):
        for mesh in (shapes.hill(6, 5), shapes.sphere(1), shapes.torus(8, 5)):
            coneflat.flatten(*mesh, charts=charts, quantise=np.pi / 2 if charts == "one" else None)


def _resident(name: str) -> float:
    """Return the resident memory of the process, or its peak since the last call, in MB; 0 if unknown."""
    try:
        match = re.search(rf"{name}:\s+(\d+) kB", Path("/proc/self/status").read_text())
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        return 0.0
    return int(match[1]) / 1e3 if match else 0.0


def _mesh(rng: Random, outcome: Outcome) -> None:
    """Flatten a random mesh with random options; one in three results is also written."""
    import coneflat

    vertices, faces, made = make_mesh(rng)
    options = make_options(rng, vertices, faces)
    outcome.recipe = f"{made}; {in_short(options)}"
    _flatten(rng, outcome, lambda: coneflat.flatten(vertices, faces, **options), options, (vertices, faces))


def _tiny(rng: Random, outcome: Outcome) -> None:
    """Flatten a mesh of few triangles with many options at once; one in four cases makes quads of it."""
    import coneflat

    vertices, faces, made = make_tiny(rng)
    if rng.random() < 0.25:
        options = {"sharp_angle": float(rng.choice([0.3, 0.8, 2.0]))} if rng.random() < 0.4 else {}
        options["quads"] = int(rng.choice([1, 7, 40, 900]))
        grid_of_mesh(rng, outcome, vertices, faces, made, size=None, **options)
        return
    options = cross_options(rng, vertices, faces)
    outcome.recipe = f"{made}; {in_short(options)}"
    _flatten(rng, outcome, lambda: coneflat.flatten(vertices, faces, **options), options, (vertices, faces))


def _many_components(rng: Random, outcome: Outcome) -> None:
    """Flatten a mesh of many tiny components with random options, or unwrap it."""
    import coneflat

    vertices, faces, made = make_many(rng)
    if rng.random() < 0.4:
        texture_mesh(rng, outcome, vertices, faces, made)
        return
    options = {"repair": True, **make_options(rng, vertices, faces), "resolution": 8192}
    outcome.recipe = f"{made}; {in_short(options)}"
    _flatten(rng, outcome, lambda: coneflat.flatten(vertices, faces, **options), options, (vertices, faces))


def _flatten(
    rng: Random,
    outcome: Outcome,
    flatten: Callable[[], Any],
    options: dict[str, Any],
    mesh: tuple[np.ndarray, np.ndarray],
) -> None:
    result = None
    with outcome.guarded(
        expects_nan=not np.isfinite(mesh[0]).all() or bool(re.search(r"\b(nan|inf)\b", in_short(options)))
    ):
        result = flatten()
    if result is None:
        return
    check(outcome, result, options, *mesh)
    if outcome.kind == "file" or rng.random() < 0.3:
        path = Path(f"out{rng.choice(list(READERS))}")
        outcome.recipe += f"; written as {path}"
        with outcome.guarded("writing: "):
            result.save(path)
        if path.exists():
            check_file(outcome, result.as_written(path.suffix), path)


def _file(rng: Random, outcome: Outcome) -> None:
    """Read and flatten an intact or damaged file, in Python or by the command line."""
    import coneflat

    path, recipe = make_file(rng, Path())
    outcome.recipe = recipe
    weld = [None, None, True, False][int(rng.integers(4))]
    repair = bool(rng.random() < 0.7)
    if path.suffix == ".npz":
        result = None
        with outcome.guarded(expects_nan=True):
            result = coneflat.read_flattening(path)
        if result is not None and "damaged" not in recipe:
            check(outcome, result, {}, result.vertices, result.faces[np.argsort(result.face_origin)])
        if result is not None:
            again = Path("again.obj")
            with outcome.guarded("writing: "):
                result.save(again)
        return
    if rng.random() < 0.35:
        _file_by_command(rng, outcome, path, weld, repair)
        return
    options = {"charts": str(rng.choice(["atlas", "atlas", "one"])), "repair": repair, "max_cones": 12}
    if rng.random() < 0.2:
        options["up"] = (0, 0, 1)
    mesh = None
    with outcome.guarded(expects_nan=True):
        mesh = coneflat.read_mesh(path, weld=weld)
    if mesh is None or len(mesh.corners) > 3 * LARGEST_FILE:
        return
    outcome.recipe += f"; weld={weld}; {in_short(options)}"
    faces = None
    with outcome.guarded(expects_nan=True):
        faces = coneflat.geometry.triangulate.triangulate(mesh.vertices, mesh.corners, mesh.offsets)[0]
    if faces is not None:
        _flatten(rng, outcome, lambda: coneflat.flatten(mesh, **options), options, (mesh.vertices, faces))


def _file_by_command(rng: Random, outcome: Outcome, path: Path, weld: bool | None, repair: bool) -> None:
    line = [
        "flatten",
        str(path),
        "-o",
        f"out{rng.choice(['.obj', '.glb', '.ply'])}",
        "--report",
        "report.json",
    ]
    line += ["--repair"] if repair else []
    line += {None: [], True: ["--weld"], False: ["--no-weld"]}[weld]
    _run(outcome, line)
    report = Path("report.json")
    if outcome.status == "ok":
        told = json.loads(
            report.read_text(), parse_constant=lambda word: outcome.breach("report: not JSON", word)
        )
        check_report(outcome, told, Path(line[3]))


def _argument(rng: Random, outcome: Outcome) -> None:
    """Call a public function with odd arguments; low-level ones may raise any error, but must not crash or hang."""
    global _calls
    if _calls is None:
        _calls = Calls(Path(tempfile.mkdtemp()))
    name, arguments, outcome.recipe = _calls.make(rng)
    result = None
    if name not in DOORS:
        with contextlib.suppress(Exception), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            _calls.function(name)(**arguments)
        return
    with outcome.guarded(expects_nan=True):
        result = _calls.function(name)(**arguments)
    # The result cannot be compared with a boundary that only the function could read.
    is_read = "boundary" not in arguments or "boundary" in _plain(arguments)
    if (
        name == "flatten"
        and is_read
        and result is not None
        and arguments["faces"] is _calls.good["flatten"]["faces"]
    ):
        options = {key: value for key, value in arguments.items() if key not in ("mesh", "faces")}
        with outcome.guarded("checking: "):
            check(outcome, result, _plain(options), arguments["mesh"], arguments["faces"])


_calls: Calls | None = None


def _plain(options: dict[str, Any]) -> dict[str, Any]:
    """Return the options that the checks can use directly; others were consumed or have several types."""
    values = {
        name: value.item() if isinstance(value, (np.ndarray, np.generic)) and not value.ndim else value
        for name, value in options.items()
    }
    plain = {
        name: value
        for name, value in values.items()
        if isinstance(value, (bool, int, float, str, list, dict))
    }
    lists = ("cones", "boundary", "required_cones", "forbidden_cones")
    return {
        name: value for name, value in plain.items() if name not in lists or isinstance(value, (list, dict))
    }


def _command(rng: Random, outcome: Outcome) -> None:
    """Run a command line with odd options."""
    _run(outcome, make_command(rng, Path()))


def _process(rng: Random, outcome: Outcome) -> None:
    """Run a command in its own process, with closed streams, or ended by a signal at a random time or as it writes."""
    if rng.random() < 0.3:
        run_without_streams(rng, outcome)
    else:
        interrupt_command(rng, outcome)


def _run(outcome: Outcome, line: list[str]) -> None:
    """Run a command, which must succeed, or print one line on stderr and return a nonzero exit code."""
    outcome.recipe += f"; coneflat {' '.join(map(repr, line))}"
    code, _, err = run_command(line)
    if "Traceback" in err or "internal error" in err:
        cause = re.search(r"internal error, please report it: (\w+)", err)
        outcome.breach(f"command: {'traceback' if cause is None else cause[1]}", err[-LONGEST_MESSAGE:])
    if code == 0:
        return
    errors = [text for text in err.splitlines() if "error" in text.lower()]
    if code not in (1, 2):
        outcome.breach(f"command: exit code {code}", err)
    if line and not errors and "Usage" not in err:
        outcome.breach("command: fails without a message", err)
    outcome.refuse(errors[-1] if errors else "usage", expects_nan=True)


def _crash(rng: Random, outcome: Outcome) -> None:
    os.kill(os.getpid(), signal.SIGSEGV)


def _hang(rng: Random, outcome: Outcome) -> None:
    while True:
        pass


def _swell(rng: Random, outcome: Outcome) -> None:
    np.ones(200_000_000)


#: The kinds of cases, and their shares. The last three put the workers to the test.
KINDS: dict[str, Callable[[Random, Outcome], None]] = {
    "mesh": _mesh,
    "file": _file,
    "argument": _argument,
    "command": _command,
    "tiny": _tiny,
    "many": _many_components,
    "process": _process,
    "texture": texture_case,
    "transfer": transfer_case,
    "attribute": attribute_case,
    "offset": offset_case,
    "doubled": doubled_case,
    "grid": grid_case,
    "few": few_case,
    "crash": _crash,
    "hang": _hang,
    "swell": _swell,
}
SHARES = {
    "mesh": 14, "tiny": 6, "many": 1, "texture": 8, "doubled": 4, "file": 6, "argument": 3, "command": 2, "process": 1,
    "transfer": 2, "attribute": 2, "offset": 2,
}  # fmt: skip


def cases(count: int, first: int, kinds: tuple[str, ...] = tuple(SHARES)) -> list[tuple[str, int]]:
    """Return a number of cases of the named kinds in fixed proportions, with consecutive seeds."""
    cycle = [kind for kind in kinds for _ in range(SHARES[kind])]
    order = np.random.default_rng(0).permutation(len(cycle))
    return [(cycle[order[seed % len(cycle)]], seed) for seed in range(first, first + count)]
