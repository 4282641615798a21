"""Time and memory of a whole flattening: `python benchmarks/whole.py` prints Markdown tables.

Flattening to one chart in memory (check, cones, exact metric, cut, layout, measures), by stage, against one bare
analysis and factorization of the same mesh's Laplacian by the same solver, and against what can be installed with
pip: the LSCM of libigl on our cut mesh, xatlas, uvunwrap. Each mesh has a process of its own, which compiles and loads
everything before the clock starts; its peak memory is that of the process with our flattening alone. Models of
`../shared/meshes`, where they are, and a bumpy sphere, split in four over and over up to --largest triangles.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from functools import partial
from importlib.util import find_spec
from typing import Any

import numpy as np
from common import best_time, cases, model, peak_memory, shapes
from comparisons.atlases import ATLAS_BASELINES, installed_baselines
from scipy.sparse import csc_matrix

from coneflat import Flattening, TriangleMesh, flatten
from coneflat.geometry import (
    cotangent_laplacian,
    cotangents,
    double_areas,
    edge_lengths,
    signed_double_areas,
)
from coneflat.linalg import factorize

STAGES = ("check", "cones", "metric", "cut", "layout", "measure")
FITTED_FROM = 90_000  # Triangles from which on the growth of large meshes is fitted.


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--models", default="fandisk,bunny,horse")
    parser.add_argument("--largest", type=int, default=1_600_000, help="triangles")
    parser.add_argument(
        "--baselines", type=int, default=100_000, help="triangles up to which baselines run, too"
    )
    parser.add_argument("--runs", type=int, default=2, help="the best counts")
    parser.add_argument("--one", nargs=2, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one:
        print(
            json.dumps(measured(arguments.one[0], int(arguments.one[1]), arguments.runs, arguments.baselines))
        )
        return
    rows = []
    print(
        f"| model | triangles | cones | solver | factorization, s | total, s | ratio | {' | '.join(STAGES)} | MB |"
    )
    print("| --- " * (len(STAGES) + 8) + "|")
    for name, rounds in cases(arguments.models.split(","), arguments.largest):
        command = [sys.executable, __file__, "--one", name, str(rounds)]
        command += ["--runs", str(arguments.runs), "--baselines", str(arguments.baselines)]
        rows.append(json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout))
        print(line(rows[-1]), flush=True)
    print(f"\nStages in units of the factorization.{growth(rows)}\n")
    print_baselines([row for row in rows if row["baselines"]])


def measured(name: str, rounds: int, runs: int, largest_of_baselines: int) -> dict:
    """Return the row of a mesh."""
    vertices, faces = model(name, rounds)
    flatten(*shapes.sphere(2))  # This compiles or loads the kernels.
    lengths = edge_lengths(vertices, faces)
    laplacian = csc_matrix(cotangent_laplacian(faces, cotangents(lengths), len(vertices))[1:][:, 1:])
    solver = type(factorize(laplacian)).__name__.removesuffix("Factor").lower()  # This loads the solver.
    bare = best_time(lambda: factorize(laplacian), runs)
    results: list[Flattening] = []
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        results.append(flatten(vertices, faces, charts="one"))
        times.append(time.perf_counter() - start)
    best = results[int(np.argmin(times))]
    return {
        "model": name,
        "triangles": len(faces),
        "cones": len(best.cones),
        "solver": solver,
        "bare": bare,
        "total": min(times),
        "stages": best.seconds,
        "memory": peak_memory(),
        "baselines": baseline_seconds(best) if len(faces) <= largest_of_baselines else {},
    }


def baseline_seconds(best: Flattening) -> dict[str, float]:
    """Return the seconds of the installed baselines for the same mesh."""
    runs = {name: ATLAS_BASELINES[name].run for name in installed_baselines()}
    if find_spec("igl") is not None:
        runs["libigl LSCM"] = libigl_lscm
    return {name: best_time(partial(run, best), 1) for name, run in runs.items()}


def libigl_lscm(base: Flattening) -> np.ndarray:
    """Return the LSCM of each chart with two distant points pinned; charts keep their areas and are placed in a row."""
    import igl

    points = np.empty((len(base.uv), 3))
    points[base.uv_faces] = base.vertices[base.faces]
    corner_uv, right = np.empty((len(base.faces), 3, 2)), 0.0
    for chart, _, faces in TriangleMesh(points, base.uv_faces).split_components():
        pins = np.array([0, int(np.argmax(((chart.vertices - chart.vertices[0]) ** 2).sum(axis=1)))])
        answer: Any = igl.lscm(chart.vertices, chart.faces, pins, np.array([[0.0, 0.0], [1.0, 0.0]]))
        uv = np.asarray(answer[0] if isinstance(answer, tuple) else answer, dtype=np.float64)[chart.faces]
        space = double_areas(edge_lengths(chart.vertices, chart.faces)).sum()
        uv *= np.sqrt(space / np.abs(signed_double_areas(uv)).sum())
        corner_uv[faces] = uv + np.array([right - uv[..., 0].min(), 0.0])
        right += float(np.ptp(uv[..., 0]))
    return corner_uv


def line(row: dict) -> str:
    stages = " | ".join(f"{row['stages'][name] / row['bare']:.2f}" for name in STAGES)
    return (
        f"| {row['model']} | {row['triangles']:,} | {row['cones']} | {row['solver']} | {row['bare']:.3f} | "
        f"{row['total']:.2f} | {row['total'] / row['bare']:.1f} | {stages} | {row['memory']:.0f} |"
    )


def growth(rows: list[dict]) -> str:
    """Return the exponents of growth of models with at least two large sizes."""
    exponents = []
    for name in dict.fromkeys(row["model"] for row in rows):
        large = [row for row in rows if row["model"] == name and row["triangles"] >= FITTED_FROM]
        if len(large) > 1:
            sizes, times = (np.log([row[key] for row in large]) for key in ("triangles", "total"))
            exponents.append(f"{name} {np.polyfit(sizes, times, 1)[0]:.2f}")
    return (
        f" Time grows with the number of triangles to the power of: {', '.join(exponents)}."
        if exponents
        else ""
    )


def print_baselines(rows: list[dict]) -> None:
    names = list(dict.fromkeys(name for row in rows for name in row["baselines"]))
    if not names:
        return
    print(f"| model | triangles | coneflat, s | {', s | '.join(names)}, s |")
    print("| --- " * (len(names) + 3) + "|")
    for row in rows:
        seconds = " | ".join(
            f"{row['baselines'][name]:.2f}" if name in row["baselines"] else "" for name in names
        )
        print(f"| {row['model']} | {row['triangles']:,} | {row['total']:.2f} | {seconds} |")


if __name__ == "__main__":
    main()
