"""Time per component of meshes of many: `python benchmarks/components.py` prints a Markdown table.

CPU seconds of `coneflat.flatten`, `coneflat.unwrap`, and of xatlas and uvunwrap where they are installed, each in a
process of its own that has loaded everything, for 100 to 100,000 components, all different: leaf cards of two
triangles, single triangles, and, at most 1,000, bent cards of eight triangles and bumpy spheres of 80. The last column
is the time per component relative to that with a tenth of the components: 1 if the time is linear.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Callable
from importlib.util import find_spec
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
from common import peak_memory, shapes
from comparisons.atlases import ATLAS_BASELINES

import coneflat

#: The components, and their largest number.
KINDS = {"triangles": 100_000, "cards": 100_000, "bent cards": 1_000, "spheres": 1_000}
#: Functions that are measured, and the largest number of components with which those of others are.
METHODS = {"flatten": 100_000, "unwrap": 100_000, "xatlas": 10_000, "uvunwrap": 10_000}
#: Components in a row, and the distance between them.
ROW, DISTANCE = 100, 3.0


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--counts", default="100,1000,10000,100000")
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--methods", default=",".join(METHODS))
    parser.add_argument("--one", nargs=3, help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.one:
        method, kind, count = chosen.one
        print(json.dumps(measured(method, kind, int(count))))
        return
    print("| components | triangles of each | number | function | processor, s | ms each | MB | ratio |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for kind in chosen.kinds.split(","):
        for method in chosen.methods.split(","):
            if method not in ("flatten", "unwrap") and find_spec(method) is None:
                continue
            previous = 0.0
            for count in map(int, chosen.counts.split(",")):
                if count > min(KINDS[kind], METHODS[method]):
                    continue
                command = [sys.executable, __file__, "--one", method, kind, str(count)]
                seconds, memory, triangles = json.loads(
                    subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout
                )
                milliseconds = 1000 * seconds / count
                cells = (
                    kind,
                    triangles,
                    f"{count:,}",
                    method,
                    f"{seconds:.1f}",
                    f"{milliseconds:.2f}",
                    f"{memory:.0f}",
                )
                ratio = f"{milliseconds / previous:.2f}" if previous else ""
                print(f"| {' | '.join(map(str, cells))} | {ratio} |", flush=True)
                previous = milliseconds


def measured(name: str, kind: str, count: int) -> tuple[float, float, int]:
    """Return the CPU seconds of a function for a number of components, its memory in MB, and triangles of each."""
    run = function(name)
    run(*components(kind, 40))  # This compiles or loads the kernels.
    vertices, faces = components(kind, count)
    start = time.process_time()
    run(vertices, faces)
    return time.process_time() - start, peak_memory(), len(faces) // count


def function(name: str) -> Callable[[Any, Any], object]:
    """Return a function of vertices and faces."""
    if name in ATLAS_BASELINES and name != "unwrap":
        run = ATLAS_BASELINES[name].run
        return lambda vertices, faces: run(cast(Any, SimpleNamespace(vertices=vertices, faces=faces)))
    return getattr(coneflat, name)


def components(kind: str, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices and faces of different components, side by side."""
    pieces = [component(kind, np.random.default_rng(seed)) for seed in range(count)]
    places = [(DISTANCE * (i % ROW), DISTANCE * (i // ROW), 0.0) for i in range(count)]
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in pieces)])
    vertices = np.concatenate([vertices + place for (vertices, _), place in zip(pieces, places, strict=True)])
    return vertices, np.concatenate(
        [faces + start for (_, faces), start in zip(pieces, starts, strict=False)]
    )


def component(kind: str, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return a random component of a kind."""
    size = random.uniform(0.2, 2.0, 3)
    if kind == "triangles":
        return random.uniform(-1, 1, (3, 3)) * size, np.array([[0, 1, 2]])
    if kind == "cards":
        corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0.1], [0, 1, 0]])
        return corners * size, np.array([[0, 1, 2], [0, 2, 3]])
    if kind == "bent cards":
        vertices, faces = shapes.grid(2, 2)
        return (vertices + 0.2 * random.normal(size=vertices.shape) * [0, 0, 1]) * size, faces
    vertices, faces = shapes.sphere(1, seed=int(random.integers(2**31)))
    return np.asarray(vertices) * size / 2, np.asarray(faces)


if __name__ == "__main__":
    main()
