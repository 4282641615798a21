"""Intrinsic Delaunay triangulations by edge flips, with a record from which the flips can be undone."""

from __future__ import annotations

import numpy as np

from .._arrays import FloatArray, IntArray
from ..mesh import TriangleMesh
from .intrinsic import IntrinsicTriangulation, intrinsic_triangulation

# Flips per edge after which flipping stops. Finite by theory; in floating point this catches what the
# tolerance of the test does not.
FLIPS_PER_EDGE = 50


def make_delaunay(
    triangulation: IntrinsicTriangulation,
    log_scale: FloatArray | None = None,
    radii: FloatArray | None = None,
    has_lengths: bool = True,
    suspects: IntArray | None = None,
) -> IntArray:
    """Flip a triangulation, in place, until it is Delaunay; return the half-edges flipped, in order.

    Args:
        triangulation: changed in place.
        log_scale: None for the triangulation's own metric and Euclidean flips. With (n,) log scale factors
            phi, the metric l_ij exp((phi_i + phi_j) / 2) is made Delaunay by Ptolemy flips of the lengths l,
            which keep the discrete conformal class (Springborn 2019; Gillespie, Springborn, Crane 2021).
        radii: (n,) of circles at the vertices, to make the triangulation weighted Delaunay for.
        has_lengths: False if the triangulation has the circles' inversive distances for lengths: flips then keep these
            (Bobenko, Lutz 2023).
        suspects: half-edges of the edges that may fail the condition at first; None: all.

    Notes:
        Where nothing fails the condition the cost is one pass over the edges. The condition is meaningful
        also where scaled lengths break the triangle inequality.
    """
    from .flips import EUCLIDEAN, PACKED, SCALED, WEIGHTED, find_violations, flip_until_delaunay

    if radii is not None:
        kind, scale = WEIGHTED if has_lengths else PACKED, radii
    elif log_scale is None:
        kind, scale = EUCLIDEAN, np.ones(triangulation.vertex_count)
    else:
        kind = SCALED
        # Only ratios within a triangle matter, so the middle may go to 1, which keeps off overflow.
        scale = np.exp((log_scale - (log_scale.max() + log_scale.min()) / 2) / 2)
    arrays = triangulation.twin, triangulation.tail, triangulation.length
    stack = np.empty(len(triangulation.twin), dtype=np.int64)
    if suspects is None:
        top = find_violations(*arrays, scale, kind, stack)
    else:
        top = len(suspects)
        stack[:top] = suspects
    if top == 0:
        return np.empty(0, dtype=np.int64)
    queued = np.zeros(len(stack), dtype=np.bool_)
    queued[stack[:top]] = True
    left = FLIPS_PER_EDGE * len(stack) // 2 + 1000
    records: list[IntArray] = []
    while top > 0 and left > 0:
        record = np.empty(min(left, 4 * top + 1000), dtype=np.int64)
        top, count = flip_until_delaunay(*arrays, scale, kind, stack, top, queued, record)
        records.append(record[:count])
        left -= count
    return np.concatenate(records)


def intrinsic_delaunay(mesh: TriangleMesh, lengths: FloatArray) -> tuple[IntrinsicTriangulation, IntArray]:
    """Return the intrinsic Delaunay triangulation of a mesh and the half-edges flipped, in order.

    Args:
        mesh: the mesh.
        lengths: (m, 3) side lengths, model units, with the triangle inequality.
    """
    triangulation = intrinsic_triangulation(mesh, lengths)
    return triangulation, make_delaunay(triangulation)
