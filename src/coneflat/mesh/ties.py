"""Choices among equals that depend on the shape, not on the numbering."""

from __future__ import annotations

import math

import numpy as np

from ..base.arrays import FloatArray, dots
from .connectivity import TriangleMesh

# Relative to the range of the values: far above what rounding makes of equal ones, far below what tells others
# apart.
EQUAL_TOLERANCE = 1e-9


def _shape_vectors(centred: FloatArray) -> tuple[FloatArray | None, FloatArray | None]:
    """Return two unit vectors that turn with the shape, None for those that it is too symmetric to have.

    Args:
        centred: (n, 3) vertices relative to their centre, at most 1 from it.
    """
    squares = dots(centred, centred)
    one, two = squares @ centred, squares**2 @ centred
    (a, b, c), (d, e, f) = one.tolist(), two.tolist()
    across = np.array([b * f - c * e, c * d - a * f, a * e - b * d])
    lengths = [math.sqrt(vector @ vector) for vector in (one, two, across)]
    # What rounding leaves of vectors that vanish means nothing.
    has_one = lengths[0] > 1e-6 * len(centred)
    has_across = lengths[2] > 1e-6 * max(lengths[0] * lengths[1], 1e-12 * len(centred) ** 2)
    return one / lengths[0] if has_one else None, across / lengths[2] if has_across else None


def _centred(vertices: FloatArray) -> FloatArray:
    """Return (n, 3) vertices relative to their centre, the farthest at 1; or all at 0."""
    centred = vertices - vertices.mean(axis=0)
    size = float(np.sqrt(dots(centred, centred).max()))
    return centred / size if size > 0 else centred


def shape_axes(vertices: FloatArray) -> FloatArray:
    """Return three orthonormal axes, rows, that turn with the shape.

    Those that it is too symmetric to have are taken from the coordinate axes.
    """
    axes: list[FloatArray] = []
    for vector in (*_shape_vectors(_centred(vertices)), *np.eye(3)):
        if vector is not None and len(axes) < 2:
            rest = vector - sum(axis * (axis @ vector) for axis in axes)
            if np.linalg.norm(2 * rest) > 1:
                axes.append(rest / np.linalg.norm(rest))
    return np.stack([axes[0], axes[1], np.cross(axes[0], axes[1])])


def tie_key(vertices: FloatArray) -> FloatArray:
    """Return (n,) a number for each vertex that rigid motions, scale and numbering do not change.

    Distances from the centre alone would not tell mirror images apart. Two vectors that belong to the shape span its
    plane of mirror symmetry, if it has one, and their cross product tells the sides of it.
    """
    centred = _centred(vertices)
    one, across = _shape_vectors(centred)
    key: FloatArray = dots(centred, centred)
    if one is not None:
        key += 0.3 * (centred @ one)
    if across is not None:
        key += 0.1 * (centred @ across)
    # On symmetric shapes many vertices are alike. Which of them come first does not matter, but from there on the
    # others must follow alike: small parts of the distances from the first vertex by it, the second, the third.
    for weight in (0.05, 0.02, 0.01):
        away = centred - centred[np.argmax(key >= key.max() - EQUAL_TOLERANCE)]
        key += weight * np.sqrt(dots(away, away))
    return key


def mesh_tie_key(mesh: TriangleMesh) -> FloatArray:
    """Return the key (n,) of a mesh, which is not computed again."""
    known = mesh.__dict__
    if "_tie_key" not in known:
        known["_tie_key"] = tie_key(mesh.vertices)
    key: FloatArray = known["_tie_key"]
    return key


def argmax_tied(values: FloatArray, key: FloatArray) -> int:
    """Return where a value is largest; among those that are equal but for rounding, where the key is."""
    top = values.max()
    tied = np.flatnonzero(values >= top - EQUAL_TOLERANCE * max(top - values.min(), np.finfo(float).tiny))
    return int(tied[np.argmax(key[tied])])
