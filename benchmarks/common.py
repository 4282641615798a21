"""Meshes and clocks that the benchmarks share."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
MODELS = ROOT.parent / "shared" / "meshes"
sys.path.insert(0, str(ROOT / "tests"))

import shapes  # noqa: E402

from coneflat import check_mesh, read_mesh  # noqa: E402
from coneflat.mesh import TriangleMesh  # noqa: E402


def meshes(names: list[str], largest: int) -> Iterator[tuple[str, TriangleMesh]]:
    """Yield a sphere and the models named, where they are, each split in four over and over up to a size."""
    sources = [("sphere", shapes.sphere(5))]
    for name in names:
        for path in sorted(MODELS.glob(f"{name}.*")):
            model = read_mesh(path)
            sources.append((name, (model.vertices, model.corners.reshape(-1, 3))))
    for name, (vertices, faces) in sources:
        while len(faces) <= largest:
            yield name, check_mesh(vertices, faces).mesh
            vertices, faces = shapes.subdivide(vertices, faces)


def best_time(run: Callable[[], object], runs: int) -> float:
    """Return the least wall time of some runs, seconds."""
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return min(times)
