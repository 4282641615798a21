"""Least squares reconstruction from angles (ABF++, Sheffer et al. 2005; Section 4.3 of the paper)."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from ..base.arrays import ComplexArray, FloatArray, IntArray, mask_of
from ..errors import MetricError
from ..geometry import corner_angles, is_broken
from ..geometry.planar import as_pairs
from ..linalg import HermitianFactor
from ..linalg.shortest_paths import MultiGraph
from ..mesh.connectivity import NEXT, PREVIOUS, TriangleMesh
from ..mesh.ties import argmax_tied, tie_key


def least_squares_layout(disk: TriangleMesh, lengths: FloatArray) -> FloatArray:
    """Return the layout of a disk whose angles fit those of a nearly flat metric in the least squares sense.

    Args:
        disk: a topological disk.
        lengths: (m, 3) side lengths of the metric.

    Returns:
        (n, 2) points, up to a similarity.

    Raises:
        MetricError: the system has no finite solution.
    """
    if not np.isfinite(lengths).all():
        raise MetricError(f"{int((~np.isfinite(lengths)).sum())} of the metric's lengths are not finite")
    points = pinned_least_squares(_equations(disk, lengths), far_pins(disk, lengths))
    if not np.isfinite(points).all():
        raise MetricError(
            f"the layout of {len(disk.faces)} triangles has no finite solution: "
            f"{int(is_broken(lengths).sum())} of them violate the triangle inequality"
        )
    return as_pairs(points)


def pinned_least_squares(equations: csr_matrix, pins: IntArray) -> ComplexArray:
    """Return (n,) the z that minimises |equations z| with z = 0 at the first pin and 1 at the second.

    Args:
        equations: (m, n) complex matrix.
        pins: (2,) columns with prescribed values.
    """
    normal = csr_matrix(equations.conj().T @ equations)
    free = ~mask_of(equations.shape[1], pins)
    factor = HermitianFactor(normal[free][:, free])
    z = np.zeros(len(free), dtype=np.complex128)
    z[pins[1]] = 1.0
    # The second iteration refines the solution, as the normal equations have a squared condition number.
    for _ in range(2):
        z[free] -= factor.solve((equations.conj().T @ (equations @ z))[free])
    return z


def _equations(disk: TriangleMesh, lengths: FloatArray) -> csr_matrix:
    """Return the complex (m, n) matrix whose row for a triangle gives 0 if the triangle has its (m, 3) side lengths.

    The equation of a triangle with longest side p1 p2 is p3 - p1 = (l13 / l12) e^(i a1) (p2 - p1). Where the triangle
    inequality is violated, the angles are the real parts of the complex ones: p3 is on the side p1 p2 and divides it as
    l13 : l32.
    """
    rows = np.arange(len(lengths))
    third = np.argmax(lengths, axis=1)
    first, second = NEXT[third], PREVIOUS[third]
    l13, l32 = lengths[rows, second], lengths[rows, first]
    l12 = np.minimum(lengths[rows, third], l13 + l32)  # a side that is too long is shortened
    turn = l13 / l12 * np.exp(1j * corner_angles(lengths)[rows, first])
    columns = disk.faces[rows[:, None], np.stack([first, second, third], axis=1)]
    values = np.stack([turn - 1, -turn, np.ones(len(rows))], axis=1)
    return csr_matrix(
        (values.ravel(), (np.repeat(rows, 3), columns.ravel())), shape=(len(rows), len(disk.vertices))
    )


def far_pins(disk: TriangleMesh, lengths: FloatArray) -> IntArray:
    """Return (2,) two distant vertices that are not in triangles that violate the triangle inequality.

    Two pins that are close together, or in a triangle without a valid shape, make the system nearly singular.

    Args:
        disk: a topological disk.
        lengths: (m, 3) side lengths.
    """
    graph = MultiGraph(len(disk.vertices), disk.edges, lengths.ravel()[disk.edge_halfedges[:, 0]])
    allowed = ~mask_of(len(disk.vertices), disk.faces[is_broken(lengths)])
    if allowed.sum() < 2:
        allowed[:] = True
    key = tie_key(disk.vertices)
    # A start that does not depend on the numbering: a vertex with a large key, and an inner one, as the two copies of
    # a seam vertex have equal keys.
    inside = allowed & ~disk.is_boundary_vertex
    pins = [int(np.argmax(np.where(inside if inside.any() else allowed, key, -np.inf)))]
    for _ in range(2):  # the farthest from there, then the farthest from that
        distance = graph.shortest_paths(np.array(pins[-1:])).distance
        distance[~allowed] = -1
        distance[pins[-1]] = -1
        pins.append(argmax_tied(distance, key))
    return np.array(pins[1:])
