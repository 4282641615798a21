"""Layouts in which both sides of every seam are equally long."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, eye

from ....base import BoolArray, FloatArray, IntArray, has_any
from ....errors import MetricError
from ....geometry import signed_double_areas
from ....linalg import factorize
from .strain import FlatEdges

# Steps that make both sides of seams equally long; each squares the relative difference.
CLOSING_STEPS, CLOSED = 12, 1e-12


def with_equal_sides(
    edges: FlatEdges, corners: IntArray, points: FloatArray, is_free: BoolArray | None = None
) -> FloatArray:
    """Return points (n, 2) nearest to those given for which both sides of every seam edge are equally long.

    Args:
        edges: the edges of the layout.
        corners: (m, 3) the points of its triangles.
        points: (n, 2) places in which they are nearly so, without flipped triangles.
        is_free: (n,) the points that move, at whose edges the sides differ; None for all.

    Raises:
        MetricError: there are none nearby, or a triangle would be flipped.

    Notes:
        Newton's method on the differences, each step the smallest one in the squared change of all lengths.
    """
    if is_free is not None:
        is_triangle = has_any(is_free, corners)
        edges, corners = edges.around(is_free, is_triangle), corners[is_triangle]
    else:
        is_free = np.ones(len(points), dtype=bool)
    if not len(edges.partners):
        return points
    is_unknown, points = np.repeat(is_free, 2), points.copy()
    first, second = edges.partners.T
    lengths = edges.lengths[first]
    for _ in range(CLOSING_STEPS):
        vectors = edges.vectors(points)
        norms = np.linalg.norm(vectors, axis=1)
        gaps = (norms[first] - norms[second]) / lengths
        if np.abs(gaps).max() <= CLOSED:
            if (signed_double_areas(points[corners]) > 0).all():
                return points
            break
        along = vectors / norms[:, None]
        change = _edge_jacobian(edges.ends, along / edges.lengths[:, None], len(points))[:, is_unknown]
        closing = change[first] - change[second]
        points[is_free] += _smallest_step(change, closing, gaps).reshape(-1, 2)
    raise MetricError("the two sides of seams could not be made equally long")


def _smallest_step(change: csr_matrix, closing: csr_matrix, gaps: FloatArray) -> FloatArray:
    """Return the step whose change of lengths is smallest among those that close the gaps, to first order.

    The multipliers of the gaps are found with a penalty that is raised: the matrix remains positive definite.
    """
    stiffness = change.T @ change
    penalty = 1e6
    matrix = csc_matrix(
        stiffness
        + penalty * (closing.T @ closing)
        + 1e-6 * stiffness.diagonal().mean() * eye(closing.shape[1])
    )
    matrix.sort_indices()
    factor = factorize(matrix)
    step, multipliers = np.zeros(closing.shape[1]), np.zeros(len(gaps))
    for _ in range(3):
        step = -factor.solve(closing.T @ (multipliers + penalty * gaps))
        multipliers = multipliers + penalty * (closing @ step + gaps)
    return step


def _edge_jacobian(ends: IntArray, along: FloatArray, count: int) -> csr_matrix:
    """Return (k, 2 count) the derivative of a quantity of edges that changes by `along` (k, 2) times their vector."""
    columns = (2 * ends[:, :, None] + np.arange(2)).reshape(-1)
    values = np.stack([-along, along], axis=1).reshape(-1)
    return csr_matrix((values, columns, np.arange(0, len(values) + 1, 4)), shape=(len(ends), 2 * count))
