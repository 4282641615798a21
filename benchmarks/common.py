"""Meshes and time measurement shared by the benchmarks."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

import chromium  # noqa: E402, F401 - for benchmarks that open a page
import polyhedra  # noqa: E402, F401 - for benchmarks of patterns
import shapes  # noqa: E402
import stored_meshes  # noqa: E402

from coneflat import ConeflatError, Flattening, check_mesh, flatten, read_mesh  # noqa: E402
from coneflat.mesh.connectivity import TriangleMesh  # noqa: E402
from coneflat.options import Options, declarations, parse_angle  # noqa: E402

#: The folder of models: `../shared/meshes`, or those of `tests/data`.
MODELS = stored_meshes.model_folder()


def models(repair: bool = False) -> Iterator[tuple[str, TriangleMesh]]:
    """Yield the names and meshes of the models that are manifolds, or that a repair makes so."""
    for path in sorted(MODELS.glob("*.*")):
        if path.suffix == ".md":
            continue
        source = read_mesh(path)
        with suppress(ConeflatError):
            yield path.stem, check_mesh(source.vertices, source.triangles, repair=repair).mesh


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


def parse_options(words: Iterable[str]) -> dict[str, object]:
    """Return the options of `coneflat.flatten` in texts such as "max_cones=20"; those it does not have are texts."""
    return {name: _parse_value(name, text) for name, _, text in (word.partition("=") for word in words)}


def _parse_value(name: str, text: str) -> object:
    """Return what the text of an option means."""
    declaration = declarations(Options).get(name)
    if declaration is None:
        return text
    if getattr(declaration.kind, "is_angle", False):
        return parse_angle(text)
    try:
        return float(text) if "." in text else int(text)
    except ValueError:
        return text


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
