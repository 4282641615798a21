"""Quad meshes compared with those of other packages: `python benchmarks/quads.py` prints a Markdown table.

Every model of `../shared/meshes` that is a manifold, by coneflat, and by what can be installed with pip: QuadriFlow
(`pyquadriflow`) and Instant Meshes (`pynanoinstantmeshes`), with their defaults, at several counts of quads. With
`--dial`, ours once more with the least `stretch` of some whose edge lengths vary at most 1.2 times as much as those of
Instant Meshes. Everybody's meshes are written as OBJ and measured on the file by the same program, `--tool`, which is
not ours. Each runs in a process of its own; seconds are of the call alone, without start-up.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from common import MODELS, shapes

from coneflat import check_mesh, quads, read_mesh
from coneflat.errors import ConeflatError
from coneflat.mesh.connectivity import TriangleMesh

TOOL = MODELS.parent / "tools" / "quads.py"
STRETCHES = (0.1, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 1.0)
#: Largest ratio of the variation of edge lengths to that of Instant Meshes.
EVEN = 1.2

Polygons = tuple[np.ndarray, list[list[int]]]
Maker = Callable[[np.ndarray, np.ndarray, int], Polygons]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--models", default="", help="of all, those whose names are given; with commas")
    parser.add_argument("--quads", default="1000,5000,20000", help="how many are asked for; with commas")
    parser.add_argument("--methods", default="coneflat,QuadriFlow,Instant Meshes", help="with commas")
    parser.add_argument("--dial", action="store_true", help="ours with edges as even as Instant Meshes', too")
    parser.add_argument("--tool", type=Path, default=TOOL, help="measures quads in an OBJ file")
    arguments = parser.parse_args()
    if not arguments.tool.exists():
        sys.exit(f"{arguments.tool} is not there: name a program that measures quads with --tool")
    methods = arguments.methods.split(",")
    print("| model | asked | method | quads | others | irregular | off 90 | edge cv | least J | Euler | s |")
    print("| --- " * 11 + "|")
    for name, mesh in models([word for word in arguments.models.split(",") if word]):
        for count in map(int, arguments.quads.split(",")):
            even = float("nan")
            for method, make in makers(methods):
                measures, text = trial(mesh, count, make, arguments.tool)
                print(f"| {name} | {count:,} | {method} | {text}", flush=True)
                even = measures["edge_cv"] if method == "Instant Meshes" and measures else even
            if arguments.dial and even == even:
                stretch, text = as_even(mesh, count, EVEN * even, arguments.tool)
                print(f"| {name} | {count:,} | coneflat, stretch {stretch:g} | {text}", flush=True)


def models(names: list[str]) -> Iterator[tuple[str, TriangleMesh]]:
    for path in sorted(MODELS.glob("*.*")):
        if path.suffix == ".md" or (names and path.stem not in names):
            continue
        source = read_mesh(path)
        try:
            yield path.stem, check_mesh(source.vertices, source.triangles).mesh
        except ConeflatError:
            continue


def makers(names: list[str]) -> Iterator[tuple[str, Maker]]:
    """Yield the named methods whose packages are installed."""
    for name in names:
        module, make = METHODS[name]
        if find_spec(module) is not None:
            yield name, make


def as_even(mesh: TriangleMesh, count: int, cv: float, tool: Path) -> tuple[float, str]:
    """Return the least stretch for which edge lengths vary little enough, or the last one, and its result."""
    text = ""
    for stretch in STRETCHES:
        measures, text = trial(mesh, count, partial(by_coneflat, stretch=stretch), tool)
        if measures and measures["edge_cv"] <= cv:
            return stretch, text
    return STRETCHES[-1], text


def trial(mesh: TriangleMesh, count: int, make: Maker, tool: Path) -> tuple[dict[str, Any], str]:
    """Return the measures of a method on a mesh, and the end of its row; a failure is reported there."""
    with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor(1) as pool:
        path = Path(folder) / "quads.obj"
        try:
            pool.submit(be_silent).result()
            pool.submit(warm_up, make).result()
            seconds = pool.submit(write, path, mesh, count, make).result()
            found = json.loads(subprocess.check_output([sys.executable, tool, path]))
        except BrokenProcessPool:
            return {}, "crashed | " + "| " * 7
        except Exception as error:  # Other packages raise any type.
            return {}, f"{type(error).__name__}: {str(error)[:120]} | " + "| " * 7
    wanted = mesh.euler_characteristic
    euler = "right" if found["euler"] == wanted else f"{found['euler']}, not {wanted}"
    if found["nonmanifold"]:
        euler += f"; {found['nonmanifold']} edges of three"
    return found, (
        f"{found['quads']:,} | {found['faces'] - found['quads']:,} | {found['irregular']} | "
        f"{found['angle_mean']:.2f} | {found['edge_cv']:.3f} | {found['jacobian_min']:.2f} | {euler} | {seconds:.1f} |"
    )


def be_silent() -> None:
    """Discard what other packages print from compiled code."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)


def warm_up(make: Maker) -> None:
    """Load the packages of a method."""
    vertices, faces = shapes.sphere(3)
    make(vertices, faces, 200)


def write(path: Path, mesh: TriangleMesh, count: int, make: Maker) -> float:
    """Write the result of a method on a mesh as OBJ, and return its seconds."""
    start = time.perf_counter()
    vertices, polygons = make(mesh.vertices, mesh.faces, count)
    seconds = time.perf_counter() - start
    with path.open("w") as file:
        file.writelines(f"v {x!r} {y!r} {z!r}\n" for x, y, z in vertices.tolist())
        file.writelines(f"f {' '.join(str(corner + 1) for corner in each)}\n" for each in polygons)
    return seconds


def by_coneflat(vertices: np.ndarray, faces: np.ndarray, count: int, stretch: float = 0.0) -> Polygons:
    found = quads(vertices, faces, quads=count, stretch=stretch)
    return found.vertices, found.quads.tolist()


def by_quadriflow(vertices: np.ndarray, faces: np.ndarray, count: int) -> Polygons:
    from pyQuadriFlow.pyQuadriFlow import pyquadriflow

    found = pyquadriflow(count, 0, vertices.tolist(), faces.tolist(), False, False, False, False, False)
    return np.array(found["vertices"]), found["faces"]


def by_instant_meshes(vertices: np.ndarray, faces: np.ndarray, count: int) -> Polygons:
    """Convert the number: the package counts vertices before it splits all faces into quads, usually four."""
    import pynanoinstantmeshes

    points, found = pynanoinstantmeshes.remesh(
        vertices.astype(np.float32), faces.astype(np.uint32), vertex_count=count // 4, deterministic=True
    )
    return points.astype(np.float64), found.tolist()


METHODS: dict[str, tuple[str, Maker]] = {
    "coneflat": ("coneflat", by_coneflat),
    "QuadriFlow": ("pyQuadriFlow", by_quadriflow),
    "Instant Meshes": ("pynanoinstantmeshes", by_instant_meshes),
}

if __name__ == "__main__":
    main()
