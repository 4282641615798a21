"""Time and memory of whole processes: `python benchmarks/processes.py` prints Markdown tables.

First a single `coneflat flatten` of a model of 13,000 triangles from the command to its end, beside the work in it that
is left once everything is loaded. Then `coneflat batch` of small meshes with one process and with two, beside the same
meshes one after the other in one process that has loaded everything; and again with a fifth of them, for the memory.
Then single meshes of many components with 80 triangles each, or 4, and what each of them takes, once with all
components copies of one. Seconds of the processor are those of all threads, and tell more where other work is going on
beside: throughput is then that of the cores that were left. `--only batch` takes two minutes on two free cores.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from common import MODELS, shapes

COMMAND = [sys.executable, "-m", "coneflat"]
SINGLE = """
import json, sys, time
from coneflat.apps.batch.child import flatten_file
jobs = [json.loads(line) for line in sys.stdin]
flatten_file(jobs[0])
start, used = time.perf_counter(), time.process_time()
for job in jobs:
    assert flatten_file(job)["status"] == "done"
print(json.dumps([time.perf_counter() - start, time.process_time() - used]))
"""

# The child processes of the workers compute; they end with the workers, which do not wait for them.
DASK = """
import json, sys, time
from pathlib import Path
import psutil
from distributed import LocalCluster
from coneflat.apps.batch import find_jobs, run_batch
if __name__ == "__main__":
    folder, *meshes = sys.argv[1:]
    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        start = time.perf_counter()
        jobs = find_jobs(meshes, Path(folder), ".obj", {}, None)
        found = run_batch(jobs, Path(folder), dask=cluster.scheduler_address)
        taken = time.perf_counter() - start
        assert not found.failed
        own = psutil.Process()
        all_times = [each.cpu_times() for each in (own, *own.children(recursive=True))]
        memory = max(each.memory_info().rss for each in own.children(recursive=True))
        print(json.dumps([taken, sum(each.user + each.system for each in all_times), memory / 1e6]))
"""

COMPONENTS_SCRIPT = """
import sys, time
import numpy as np
import coneflat
meshes = np.load(sys.argv[1])
some = meshes["some"]
coneflat.flatten(meshes["vertices"][: some.max() + 1], some)
start = time.process_time()
coneflat.flatten(meshes["vertices"], meshes["faces"])
print(time.process_time() - start)
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=5, help="of the single command; medians count")
    parser.add_argument("--meshes", type=int, default=250)
    parser.add_argument("--components", type=int, default=1000)
    parser.add_argument("--only", choices=("command", "batch", "components"), help="one of the tables")
    arguments = parser.parse_args()
    # As in an installation: otherwise each process compiles the bytecode again, which takes a quarter of a second.
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    chosen = {arguments.only} if arguments.only else {"command", "batch", "components"}
    with tempfile.TemporaryDirectory() as folder:
        if "command" in chosen:
            print_command(Path(folder), arguments.runs)
        if "batch" in chosen:
            meshes = [write(Path(folder) / f"{i}.obj", small_mesh(i)) for i in range(arguments.meshes)]
            print_batches(meshes, Path(folder))
        if "components" in chosen:
            print_components(arguments.components, Path(folder) / "joined.npz")


def print_command(folder: Path, runs: int) -> None:
    """Print the time and memory of a command."""
    print("| command | wall, s | processor, s | peak, MB |\n| --- | --- | --- | --- |")
    model = next(iter(MODELS.glob("fandisk.*")), None) or write(folder / "sphere.obj", shapes.sphere(5))
    for words in (["--help"], ["flatten", str(model), "-o", str(folder / "flat.obj")]):
        costs([*COMMAND, *words])  # The first run compiles the bytecode.
        columns = zip(*(costs([*COMMAND, *words]) for _ in range(runs)), strict=True)
        wall, processor, memory = (statistics.median(column) for column in columns)
        print(f"| {words[0]} | {wall:.2f} | {processor:.2f} | {memory:.0f} |")


def print_batches(meshes: list[Path], folder: Path) -> None:
    """Print the time and memory of batches of meshes."""
    jobs = [job(mesh, folder / "single.obj") for mesh in meshes]
    alone = subprocess.run(
        [sys.executable, "-c", SINGLE], input="\n".join(jobs), stdout=subprocess.PIPE, text=True
    )
    wall, processor = json.loads(alone.stdout)
    print("\n| meshes | | wall, s | processor, s | each, ms | cores | throughput | peak of a process, MB |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")

    def print_row(count: int, name: str, taken: float, all_used: float, memory: float) -> None:
        gain, each_ms = wall * count / len(meshes) / taken, 1000 * all_used / count
        cells = f"{taken:.1f} | {all_used:.1f} | {each_ms:.1f} | {all_used / taken:.2f} | {gain:.2f} | {memory:.0f}"
        print(f"| {count} | {name} | {cells} |", flush=True)

    print_row(len(meshes), "one after the other, loaded", wall, processor, 0.0)
    for count, processes in ((len(meshes), 1), (len(meshes), 2), (len(meshes) // 5, 2)):
        words = ["batch", *map(str, meshes[:count]), "--out", str(folder / f"{count}-{processes}")]
        print_row(
            count, f"batch, {processes}", *costs([*COMMAND, *words, "--jobs", str(processes), "--quiet"])
        )
    if find_spec("distributed") is not None:
        script = write_script(folder / "cluster.py", DASK)
        words = [sys.executable, str(script), str(folder / "dask"), *map(str, meshes)]
        (folder / "dask").mkdir()
        printed = subprocess.run(words, check=True, stdout=subprocess.PIPE, text=True).stdout
        print_row(len(meshes), "Dask, 2 workers", *json.loads(printed.splitlines()[-1]))


def print_components(count: int, file: Path) -> None:
    """Print the time per component in meshes of many small components."""
    print("\n| components | triangles of each | processor, ms each |\n| --- | --- | --- |")
    for kind in (*PIECES, "copies of a sphere"):
        pieces = [piece(kind, seed) for seed in range(count)]
        starts = np.cumsum([0, *(len(vertices) for vertices, _ in pieces)])
        faces = [part + start for (_, part), start in zip(pieces, starts, strict=False)]
        vertices = np.concatenate([np.add(part, (4.0 * i, 0, 0)) for i, (part, _) in enumerate(pieces)])
        np.savez(file, vertices=vertices, faces=np.concatenate(faces), some=np.concatenate(faces[:5]))
        printed = subprocess.run(
            [sys.executable, "-c", COMPONENTS_SCRIPT, str(file)],
            check=True,
            stdout=subprocess.PIPE,
            text=True,
        )
        milliseconds = 1000 * float(printed.stdout) / count
        print(f"| {count:,} {kind} | {len(faces[0])} | {milliseconds:.1f} |")


PIECES = "sheets", "spheres", "tori", "tetrahedra"


def piece(kind: str, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a sheet with a hill, a bumpy sphere or torus of 80 triangles, or a tetrahedron, all different.

    But for copies, which are turned, and mirrored or not.
    """
    random = np.random.default_rng(seed)
    if kind == "sheets":
        (a, b), c = random.uniform(0.3, 0.7, 2), random.uniform(0.4, 0.8)
        vertices, faces = shapes.grid(8, 5, lambda x, y: c * np.exp(-12 * ((x - a) ** 2 + (y - b) ** 2)))
    elif kind == "spheres":
        vertices, faces = shapes.sphere(1, seed=seed)
    elif kind == "copies of a sphere":
        vertices, faces = shapes.sphere(1, seed=0)
        return vertices @ np.linalg.qr(random.normal(size=(3, 3)))[0].T, faces
    elif kind == "tori":
        vertices, faces = shapes.torus(8, 5, random.uniform(0.3, 0.5))
    else:
        vertices, faces = shapes.tetrahedron()
        vertices = vertices + random.uniform(-0.4, 0.4, vertices.shape)
    return vertices * (1 + random.random(3)), faces


def costs(command: list[str]) -> tuple[float, float, float]:
    """Return the wall time of a command, its CPU time, and the peak memory of its largest process."""
    # An intermediate process is needed, because the system counts only processes that have ended, all together.
    script = (
        "import json, resource, subprocess, sys, time; start = time.perf_counter(); "
        "subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL); taken = time.perf_counter() - start; "
        "used = resource.getrusage(resource.RUSAGE_CHILDREN); "
        "print(json.dumps([taken, used.ru_utime + used.ru_stime, used.ru_maxrss]))"
    )
    printed = subprocess.run([sys.executable, "-c", script, *command], check=True, stdout=subprocess.PIPE)
    wall, processor, memory = json.loads(printed.stdout)
    return wall, processor, memory * (1 if sys.platform == "darwin" else 1024) / 1e6


def small_mesh(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a bumpy torus, sheet or sphere of 300 to 2,000 triangles."""
    random = np.random.default_rng(seed)
    kind = seed % 3
    if kind == 0:
        vertices, faces = shapes.torus(int(random.integers(16, 44)), int(random.integers(10, 22)))
    elif kind == 1:
        vertices, faces = shapes.hill(int(random.integers(14, 40)), int(random.integers(12, 24)))
    else:
        vertices, faces = shapes.sphere(3, seed=seed)
    return vertices * (1 + random.random(3)), faces


def write(path: Path, mesh: tuple[np.ndarray, np.ndarray]) -> Path:
    """Write a mesh as OBJ, and return the path."""
    shapes.write_obj(path, *mesh)
    return path


def write_script(path: Path, text: str) -> Path:
    """Write a script, and return the path."""
    path.write_text(text)
    return path


def job(mesh: Path, output: Path) -> str:
    """Return the job of a batch process for a mesh."""
    return json.dumps(
        {"mesh": os.fspath(mesh), "output": os.fspath(output), "options": {}, "weld": None, "required": []}
    )


if __name__ == "__main__":
    main()
