"""Choices among equals that depend on the shape, not on the numbering."""

from __future__ import annotations

import numpy as np

from .._arrays import FloatArray

# Relative to the range of the values: far above what rounding makes of equal ones, far below what tells others
# apart.
EQUAL = 1e-9


def tie_key(vertices: FloatArray) -> FloatArray:
    """Return (n,) a number for each vertex that rigid motions, scale and numbering do not change.

    Distances from the centre alone would not tell mirror images apart. Two vectors that belong to the shape span its
    plane of mirror symmetry, if it has one, and their cross product tells the sides of it.
    """
    centred = vertices - vertices.mean(axis=0)
    size = float(np.sqrt((centred**2).sum(axis=1).max()))
    if size == 0:
        return np.zeros(len(vertices))
    centred = centred / size
    squares = (centred**2).sum(axis=1)
    one, two = squares @ centred, squares**2 @ centred
    across = np.cross(one, two)
    lengths = np.linalg.norm(one), np.linalg.norm(two), np.linalg.norm(across)
    key: FloatArray = squares.copy()
    # A shape with more symmetry has no such vectors; what rounding leaves of them means nothing.
    if lengths[0] > 1e-6 * len(vertices):
        key += 0.3 * (centred @ one) / lengths[0]
    if lengths[2] > 1e-6 * max(lengths[0] * lengths[1], 1e-12 * len(vertices) ** 2):
        key += 0.1 * (centred @ across) / lengths[2]
    # On symmetric shapes many vertices are alike. Which of them come first does not matter, but from there on the
    # others must follow alike: by their distances from the first, the second, the third.
    for weight in (0.05, 0.02, 0.01):
        first = np.argmax(key >= key.max() - EQUAL)
        key += weight * np.linalg.norm(centred - centred[first], axis=1)
    return key


def argmax_tied(values: FloatArray, key: FloatArray) -> int:
    """Return where a value is largest; among those that are equal but for rounding, where the key is."""
    top = values.max()
    tied = np.flatnonzero(values >= top - EQUAL * max(top - values.min(), np.finfo(float).tiny))
    return int(tied[np.argmax(key[tied])])
