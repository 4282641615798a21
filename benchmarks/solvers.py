"""Processor time of the installed solvers of linear systems: `python benchmarks/solvers.py` prints Markdown tables.

First a factorization of a mesh's Laplacian with its analysis, another one of the same pattern, 60 solves one by one and
in blocks, and the memory of these, then whole flattenings and textures. Each row has a process of its own, in which
CONEFLAT_SOLVER names the solver; "default" is what the package chooses by size. Models are those of
`../shared/meshes`; "bunny/16" has 16 triangles for each of the bunny.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable

import numpy as np
from common import model, peak_memory
from scipy.sparse import csc_matrix

from coneflat import flatten, unwrap
from coneflat.base.threads import limit_threads
from coneflat.geometry import cotangent_laplacian, cotangents, edge_lengths
from coneflat.linalg import Factor, factorize
from coneflat.linalg.solvers import PACKAGES, SOLVER_VARIABLE, solver

SOLVES, BLOCK = 60, 16
DEFAULT = "default"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--models", default="rocker-arm,horse,kitten,bunny/16")
    parser.add_argument("--whole", default="flatten bunny,flatten horse,unwrap bunny")
    parser.add_argument("--solvers", default=",".join([*filter(solver, PACKAGES), DEFAULT]))
    parser.add_argument("--runs", type=int, default=3, help="the best counts")
    parser.add_argument("--one", nargs=2, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one:
        work, name = arguments.one
        system = work == "system"
        with limit_threads():
            print(
                json.dumps(
                    systems(name, arguments.runs) if system else timed_work(work, name, arguments.runs)
                )
            )
        return
    names = arguments.solvers.split(",")
    print("| model | unknowns | solver | factorization, s | again | 60 solves | in blocks | MB |")
    print("| --- " * 8 + "|")
    for words in filter(None, arguments.models.split(",")):
        for name in names:
            row = measured(name, "system", words, arguments.runs)
            print(
                f"| {words} | {row[0]:,} | {name} | {' | '.join(f'{x:.3f}' for x in row[1:-1])} | {row[-1]:.0f} |"
            )
    print(f"\n| | {', s | '.join(names)}, s |")
    print("| --- " * (len(names) + 1) + "|")
    for words in filter(None, arguments.whole.split(",")):
        work, _, mesh = words.partition(" ")
        times = [measured(name, work, mesh, arguments.runs)[0] for name in names]
        print(f"| {words} | {' | '.join(f'{t:.2f}' for t in times)} |")


def measured(forced: str, work: str, name: str, runs: int) -> list[float]:
    """Return what a process prints in which a solver is forced."""
    environment = {key: value for key, value in os.environ.items() if key != SOLVER_VARIABLE}
    if forced != DEFAULT:
        environment[SOLVER_VARIABLE] = forced
    command = [sys.executable, __file__, "--one", work, name, "--runs", str(runs)]
    return json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, env=environment).stdout)


def systems(name: str, runs: int) -> list[float]:
    """Return the unknowns of the Laplacian of a mesh without its first vertex, processor times and memory in MB."""
    vertices, faces = split(name)
    laplacian = cotangent_laplacian(faces, cotangents(edge_lengths(vertices, faces)), len(vertices))
    matrix = csc_matrix(csc_matrix(laplacian)[1:][:, 1:])
    size = matrix.shape[0]
    sides = np.random.default_rng(0).normal(size=(SOLVES, size))
    blocks = [sides[start : start + BLOCK].T for start in range(0, SOLVES, BLOCK)]
    factorize(csc_matrix(np.eye(9)), total_size=size).solve(np.ones(9))  # This loads the solver.
    before = peak_memory()
    held: list[Factor] = [factorize(matrix)]
    held[0].solve(blocks[0])
    memory = peak_memory() - before

    def again() -> None:
        held[0] = factorize(matrix, held[0])

    return [
        size,
        processor_time(lambda: factorize(matrix), runs),
        processor_time(again, runs),
        processor_time(lambda: [held[0].solve(side) for side in sides], runs),
        processor_time(lambda: [held[0].solve(block) for block in blocks], runs),
        memory,
    ]


def timed_work(work: str, name: str, runs: int) -> list[float]:
    """Return the processor time of a flattening, or of a texture."""
    vertices, faces = split(name)
    call: Callable[..., object] = flatten if work == "flatten" else unwrap
    call(vertices, faces)  # This compiles or loads the kernels.
    return [processor_time(lambda: call(vertices, faces), runs)]


def split(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return a model; after a slash, the number of triangles into which each of its own is split, a power of 4."""
    stem, _, pieces = name.partition("/")
    return model(stem, round(np.log(int(pieces or 1)) / np.log(4)))


def processor_time(call: Callable[[], object], runs: int) -> float:
    """Return the least processor time of several runs in seconds, of all threads."""
    times = []
    for _ in range(runs):
        start = time.process_time()
        call()
        times.append(time.process_time() - start)
    return min(times)


if __name__ == "__main__":
    main()
