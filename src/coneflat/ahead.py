"""Compiling the kernels ahead: `python -m coneflat.ahead`.

Kernels are compiled when first called and kept beside their sources from then on (see `coneflat.compiled`), which
makes the first flattening of an installation wait for half a minute. The build does this for it (hatch_build.py).
"""

from __future__ import annotations

import numpy as np

from ._arrays import FloatArray, IntArray
from .geometry.visibility import visible_share
from .grid import measure_quads
from .grid.quads import quads
from .input.polygons import Polygons
from .layout.convex import make_convex
from .pipeline import flatten
from .result.together import pack_together
from .sample import sample_path

TAU = 2 * np.pi


def compile_kernels() -> None:
    """Flatten small meshes of every kind, so that every kernel that flattening uses is compiled."""
    sample = flatten(sample_path(), charts="atlas")
    pack_together([sample, sample])
    flatten(sample_path(), cones="greedy", method="linear")
    for mesh in (_tube(closed=True), _tube(closed=False)):
        flatten(*mesh)
        flatten(*mesh, cones="greedy", refine=True)
    points, faces = _tube(closed=True)
    flatten(points * [10, 1, 1], faces)  # has triangles to be turned over
    # has triangles to be cut: six of them have no room for 7 pi
    flatten(points, faces, cones={0: -5 * np.pi, **dict.fromkeys(range(100, 600, 100), np.pi)})
    # large enough for what fine meshes alone take
    flatten(*_tube(closed=True, around=120, across=60), cones={0: np.pi / 2, 3630: -np.pi / 2})
    for method in ("ricci", "circle-patterns"):
        flatten(*_tube(closed=True), method=method)
    flatten(*_tube(closed=True), quantise=np.pi / 2)
    measure_quads(quads(*_tube(closed=True), quads=300))
    visible_share(*_tube(closed=True))
    flatten(*_tube(closed=False), boundary="disk", best_effort=True)
    _make_a_dart_convex()


def _make_a_dart_convex() -> None:
    """Make quads of a grid in the plane convex, of which one is not."""
    x, y = np.meshgrid(np.arange(4.0), np.arange(4.0))
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    points[6] = 1.5, 1.6
    quads = np.add.outer([0, 1, 2, 4, 5, 6, 8, 9, 10], [0, 1, 5, 4]).ravel()
    corners = np.add.outer(4 * np.arange(9), [[0, 1, 3], [1, 2, 3]]).reshape(-1, 3)
    space = np.column_stack([x.ravel(), y.ravel(), np.zeros(16)])[quads[corners]]
    make_convex(points, quads[corners], Polygons(np.arange(0, 37, 4), corners), space)


def _tube(closed: bool, around: int = 40, across: int = 24) -> tuple[FloatArray, IntArray]:
    """Return a bumpy torus, or the part of it that a rectangle of its parameters covers, bent to a spiral."""
    u, v = np.meshgrid(np.arange(around), np.arange(across), indexing="ij")
    a, b = TAU * u / around, TAU * v / across
    radius = 0.4 + 0.05 * np.sin(3 * a) * np.cos(2 * b)
    ring = 1 + radius * np.cos(b)
    points = np.stack([ring * np.cos(a), ring * np.sin(a), radius * np.sin(b)], axis=-1).reshape(-1, 3)
    if not closed:
        u, v = u[:-1, : across // 2], v[:-1, : across // 2]
    one, two, three, four = (
        ((u + i) % around * across + (v + j) % across).ravel() for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))
    )
    faces = np.concatenate([np.stack([one, two, three], 1), np.stack([one, three, four], 1)])
    used, faces = np.unique(faces, return_inverse=True)
    return points[used], faces.reshape(-1, 3)


if __name__ == "__main__":
    compile_kernels()
