"""Ahead-of-time compilation of the kernels: `python -m coneflat.apps.ahead`.

Kernels are compiled at the first call and cached next to their sources (see `coneflat.base.jit`), which takes half
a minute in the first flattening of an installation. The build runs this module in advance (hatch_build.py).
"""

from __future__ import annotations

import numpy as np

from .. import flatten, sample_path
from ..base import FloatArray, IntArray
from ..geometry import visible_share
from .quads.quads import quads
from .quads.quality import measure_quads


def compile_kernels() -> None:
    """Flatten small meshes of several types, so that every kernel is compiled."""
    flatten(sample_path(), charts="atlas")
    flatten(sample_path(), cones="greedy", method="linear")
    for mesh in (_tube(closed=True), _tube(closed=False)):
        flatten(*mesh)
        flatten(*mesh, cones="greedy")
    points, faces = _tube(closed=True)
    flatten(points * [10, 1, 1], faces)  # This has edges to be flipped.
    # This has triangles to be split: six of them cannot hold an angle of 7 pi.
    flatten(points, faces, cones={0: -5 * np.pi, **dict.fromkeys(range(100, 600, 100), np.pi)})
    # This is large enough for the kernels of fine meshes.
    flatten(*_tube(closed=True, around=120, across=60), cones={0: np.pi / 2, 3630: -np.pi / 2})
    flatten(*_tube(closed=True), quantise=np.pi / 2)
    measure_quads(quads(*_tube(closed=True), quads=300))
    visible_share(*_tube(closed=True))
    flatten(*_tube(closed=False), boundary="disk")


def _tube(closed: bool, around: int = 40, across: int = 24) -> tuple[FloatArray, IntArray]:
    """Return a torus with bumps, or the part of it over a rectangle of its parameters, which is a disk."""
    u, v = np.meshgrid(np.arange(around), np.arange(across), indexing="ij")
    a, b = 2 * np.pi * u / around, 2 * np.pi * v / across
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
