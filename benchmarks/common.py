"""Meshes and time measurement shared by the benchmarks."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
MODELS = ROOT.parent / "shared" / "meshes"
sys.path.insert(0, str(ROOT / "tests"))

import chromium  # noqa: E402, F401 - for benchmarks that open a page
import shapes  # noqa: E402

from coneflat import Flattening, check_mesh, flatten, read_mesh  # noqa: E402
from coneflat.mesh.connectivity import TriangleMesh  # noqa: E402


def meshes(names: list[str], largest: int) -> Iterator[tuple[str, TriangleMesh]]:
    """Yield a sphere and the named models that exist, each subdivided (each triangle into four) up to a size."""
    sources = [("sphere", shapes.sphere(5))]
    for name in names:
        for path in sorted(MODELS.glob(f"{name}.*")):
            model = read_mesh(path)
            sources.append((name, (model.vertices, model.triangles)))
    for name, (vertices, faces) in sources:
        while len(faces) <= largest:
            yield name, check_mesh(vertices, faces).mesh
            vertices, faces = shapes.subdivide(vertices, faces)


def cases(names: list[str], largest: int) -> Iterator[tuple[str, int]]:
    """Yield models and their numbers of subdivisions."""
    for name in ("sphere", *names):
        if name != "sphere" and not list(MODELS.glob(f"{name}.*")):
            continue
        count, rounds = len(model(name, 0)[1]), 0
        while count <= largest:
            yield name, rounds
            count, rounds = 4 * count, rounds + 1


def model(name: str, rounds: int) -> tuple[np.ndarray, np.ndarray]:
    if name == "sphere":
        vertices, faces = shapes.sphere(5)
    else:
        source = read_mesh(next(iter(sorted(MODELS.glob(f"{name}.*")))))
        vertices, faces = source.vertices, source.triangles
    for _ in range(rounds):
        vertices, faces = shapes.subdivide(vertices, faces)
    return vertices, faces


def with_cones_for(vertices: np.ndarray, faces: np.ndarray, std: float) -> Flattening:
    """Return a flattening with enough cones to bound its area distortion, if a tenth of it as a limit suffices."""
    allowed = std
    while True:
        result = flatten(vertices, faces, distortion=allowed)
        if result.distortion.area_std <= 1.01 * std or allowed < std / 10:
            return result
        allowed *= min(0.97, std / result.distortion.area_std)


def peak_memory() -> float:
    """Return the peak memory of this process so far in MB; nan if unknown."""
    if find_spec("resource") is None:
        return float("nan")
    import resource

    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6


def best_time(run: Callable[[], object], runs: int) -> float:
    """Return the least wall time of several runs in seconds."""
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return min(times)
