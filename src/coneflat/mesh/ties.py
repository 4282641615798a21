"""Tie-breaking by the shape of the mesh, independent of the numbering of its vertices."""

from __future__ import annotations

import math

import numpy as np

from ..base.arrays import FloatArray, dots
from .connectivity import TriangleMesh

# Values that differ by less than this fraction of their range are equal. It is far above rounding errors, and far below
# the differences of distinct values.
EQUAL_TOLERANCE = 1e-9


def _shape_vectors(centred: FloatArray) -> tuple[FloatArray | None, FloatArray | None]:
    """Return two unit vectors that rotate with the shape; None for a vector that its symmetry leaves undefined.

    Args:
        centred: (n, 3) vertices relative to their centre, at a distance of at most 1.
    """
    squares = dots(centred, centred)
    first_moment, second_moment = squares @ centred, squares**2 @ centred
    (a, b, c), (d, e, f) = first_moment.tolist(), second_moment.tolist()
    across = np.array([b * f - c * e, c * d - a * f, a * e - b * d])
    lengths = [math.sqrt(vector @ vector) for vector in (first_moment, second_moment, across)]
    # Vectors that vanish up to rounding have no meaningful direction.
    has_moment = lengths[0] > 1e-6 * len(centred)
    has_across = lengths[2] > 1e-6 * max(lengths[0] * lengths[1], 1e-12 * len(centred) ** 2)
    return first_moment / lengths[0] if has_moment else None, across / lengths[2] if has_across else None


def _centred(vertices: FloatArray) -> FloatArray:
    """Return (n, 3) vertices relative to their centre, scaled to a largest distance of 1 (0 if all coincide)."""
    centred = vertices - vertices.mean(axis=0)
    size = float(np.sqrt(dots(centred, centred).max()))
    return centred / size if size > 0 else centred


def shape_axes(vertices: FloatArray) -> FloatArray:
    """Return (3, 3) orthonormal axes, as rows, that rotate with the shape.

    Axes that the symmetry of the shape leaves undefined are taken from the coordinate axes.
    """
    axes: list[FloatArray] = []
    for vector in (*_shape_vectors(_centred(vertices)), *np.eye(3)):
        if vector is not None and len(axes) < 2:
            remainder = vector - sum(axis * (axis @ vector) for axis in axes)
            if np.linalg.norm(2 * remainder) > 1:
                axes.append(remainder / np.linalg.norm(remainder))
    return np.stack([axes[0], axes[1], np.cross(axes[0], axes[1])])


def tie_key(vertices: FloatArray) -> FloatArray:
    """Return (n,) a number for each vertex that is invariant under rigid motions, scaling and renumbering.

    Distances from the centre alone would not distinguish mirror images. Two vectors that are computed from the shape
    span its plane of mirror symmetry, if there is one, and their cross product distinguishes the two sides.

    vertices: (n, 3) positions.

    Args:
        vertices: (n, 3) positions.
    """
    centred = _centred(vertices)
    moment, across = _shape_vectors(centred)
    key: FloatArray = dots(centred, centred)
    if moment is not None:
        key += 0.3 * (centred @ moment)
    if across is not None:
        key += 0.1 * (centred @ across)
    # On symmetric shapes many vertices are equivalent. Which of them comes first does not matter, but the order of the
    # others must be determined by it. So small multiples of the distances from the first vertex by the key are added,
    # then of those from the first by the new key, and once more.
    for weight in (0.05, 0.02, 0.01):
        away = centred - centred[np.argmax(key >= key.max() - EQUAL_TOLERANCE)]
        key += weight * np.sqrt(dots(away, away))
    return key


def mesh_tie_key(mesh: TriangleMesh) -> FloatArray:
    """Return the tie key (n,) of a mesh, which is cached with the mesh."""
    cache = mesh.__dict__
    if "_tie_key" not in cache:
        cache["_tie_key"] = tie_key(mesh.vertices)
    return cache["_tie_key"]


def argmax_tied(values: FloatArray, key: FloatArray) -> int:
    """Return the index of the largest value; among values that are equal up to rounding, of the largest key.

    values, key: (n,).
    """
    top = values.max()
    tied = np.flatnonzero(values >= top - EQUAL_TOLERANCE * max(top - values.min(), np.finfo(float).tiny))
    return int(tied[np.argmax(key[tied])])
