"""Compilation of all kernels before they are needed: `coneflat warm-up`.

Otherwise kernels are compiled in the first call that needs them, and cached (`coneflat.base.kernel_cache`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from .. import TriangleMesh, flatten, sample_path, unwrap
from ..base import FloatArray, IntArray, inner_calls
from ..geometry import visible_share
from ..quadmesh import measure_quads, quads
from .patterns.net.net import unfold_net
from .patterns.sheet.thickness import thickness_of


def steps() -> Iterator[tuple[str, Callable[[], object]]]:
    """Yield computations, each with a name, on small meshes of several types: together they need every kernel."""
    sample, torus, disk = sample_path(), _tube(closed=True), _tube(closed=False)
    points, faces = torus
    yield "flatten", partial(flatten, sample, charts="atlas")
    yield "the method of the paper", partial(flatten, sample, cones="greedy", method="linear")
    for mesh in (torus, disk):
        yield "given topologies", partial(flatten, *mesh)
        yield "given topologies", partial(flatten, *mesh, cones="greedy")
    flat = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]])
    yield "flat components", partial(flatten, *flat)
    yield "edge flips", partial(flatten, points * [10, 1, 1], faces)
    # Six triangles cannot hold an angle of 7 pi, so they are split.
    cones = {0: -5 * np.pi, **dict.fromkeys(range(100, 600, 100), np.pi)}
    yield "split triangles", partial(flatten, points, faces, cones=cones)
    # This is large enough for the kernels of fine meshes.
    fine = _tube(closed=True, around=120, across=60)
    yield "fine meshes", partial(flatten, *fine, cones={0: np.pi / 2, 3630: -np.pi / 2})
    yield "quantised cones", partial(flatten, *torus, quantise=np.pi / 2)
    yield "boundaries", partial(flatten, *disk, boundary="disk")
    yield "unwrap", partial(unwrap, sample)
    yield "quads", lambda: measure_quads(quads(*torus, quads=300))
    yield "short loops", partial(quads, *torus, quads=2000, loops=True)
    yield "visibility", partial(visible_share, *torus)
    tower = TriangleMesh(*_tower())
    yield "nets", partial(unfold_net, tower)
    yield "thickness", partial(thickness_of, tower)


def compile_kernels(report: Callable[[str, float], object] = lambda name, done: None) -> None:
    """Compile all kernels that are not cached; `report` is called with the name of a step and the fraction done."""
    todo = list(steps())
    with inner_calls():  # The results do not matter.
        for i, (name, compute) in enumerate(todo):
            report(name, i / len(todo))
            compute()


def _tube(closed: bool, around: int = 40, across: int = 24) -> tuple[FloatArray, IntArray]:
    """Return a torus with bumps, or the part of it over a rectangle of its parameters, which is a disk."""
    u, v = np.meshgrid(np.arange(around), np.arange(across), indexing="ij")
    a, b = 2 * np.pi * u / around, 2 * np.pi * v / across
    radius = 0.4 + 0.05 * np.sin(3 * a) * np.cos(2 * b)
    ring = 1 + radius * np.cos(b)
    points = np.stack([ring * np.cos(a), ring * np.sin(a), radius * np.sin(b)], axis=-1).reshape(-1, 3)
    if not closed:
        u, v = u[:-1, : across // 2], v[:-1, : across // 2]
    corners = [
        ((u + i) % around * across + (v + j) % across).ravel() for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))
    ]
    faces = np.concatenate([np.stack(corners[:3], 1), np.stack([corners[0], corners[2], corners[3]], 1)])
    vertices, faces = np.unique(faces, return_inverse=True)
    return points[vertices], faces.reshape(-1, 3)


def _tower() -> tuple[FloatArray, IntArray]:
    """Return a box on a larger box, whose net has two pieces, so that the search for nets needs all its kernels."""
    ring = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    levels = [(3.0, 0.0), (3.0, 2.0), (1.0, 2.0), (1.0, 4.0)]
    points = np.concatenate([np.column_stack([size * ring, np.full(4, height)]) for size, height in levels])
    first = np.arange(12)
    second = first // 4 * 4 + (first + 1) % 4
    walls = [np.stack([first, second, second + 4], 1), np.stack([first, second + 4, first + 4], 1)]
    caps = np.array([[0, 2, 1], [0, 3, 2], [12, 13, 14], [12, 14, 15]])
    return points, np.concatenate([caps, *walls])


if __name__ == "__main__":
    compile_kernels()
