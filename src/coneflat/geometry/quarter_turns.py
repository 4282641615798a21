"""Rotations by quarter turns: as units of the complex plane, as integer matrices, and of points without rounding."""

from __future__ import annotations

from typing import TypeVar

import numpy as np

from ..base import ComplexArray, FloatArray, IntArray, compiled
from ..mesh.connectivity import TriangleMesh
from .planar import signed_angles

Vectors = TypeVar("Vectors", FloatArray, IntArray)

#: Counterclockwise rotations by 0 to 3 quarter turns, as complex numbers and as integer matrices.
UNITS = np.array([1, 1j, -1, -1j])
TURNS = np.array([[[1, 0], [0, 1]], [[0, -1], [1, 0]], [[-1, 0], [0, -1]], [[0, 1], [-1, 0]]])


def rotated(turns: IntArray, vectors: Vectors) -> Vectors:
    """Return (k, 2) vectors rotated counterclockwise by quarter turns (k,), without rounding."""
    return np.einsum("kxy,ky->kx", TURNS[turns], vectors)


@compiled
def turn(quarters: int, x: float, y: float) -> tuple[float, float]:
    """Return a point rotated counterclockwise by 0 to 3 quarter turns, without rounding."""
    if quarters == 0:
        return x, y
    if quarters == 1:
        return -y, x
    if quarters == 2:
        return -x, -y
    return y, -x


def quarters_around(mesh: TriangleMesh, sides: ComplexArray) -> IntArray:
    """Return (n,) the angle around each vertex in quarter turns, rounded; `sides` (m, 3) are those in the plane."""
    angles = signed_angles(sides)
    sums = np.bincount(mesh.faces.ravel(), angles.ravel(), len(mesh.vertices))
    return np.rint(sums / (np.pi / 2)).astype(np.int64)
