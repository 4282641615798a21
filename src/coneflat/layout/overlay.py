"""Where the edges of a mesh and those of a flipped triangulation of it cross."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._arrays import FloatArray, IntArray
from ..errors import MetricError
from ..geometry.intrinsic import IntrinsicTriangulation


@dataclass(frozen=True, eq=False)
class Overlay:
    """A triangulation and its flipped edges, drawn tight: x crossings. Flat half-edges are those after the flips.

    Attributes:
        counts: (3m,) the number of crossings on each flat half-edge, -1 if its edge was there before the flips.
        first: (3m,) the half-edge before the flips that each flat one is or, around the vertex it starts from,
            precedes immediately.
        offset: (3m,) where the places of the edge of each half-edge begin in `number`, -1 if it has none.
        number: (x,) the crossing at each place along each flat edge, counted from the tail of its half-edge
            of smaller index.
        crossed: (x,) the flat half-edge through which an edge from before the flips leaves a triangle; crossings
            on one such edge follow each other.
        leaving: (x,) the half-edge before the flips that runs in this direction.
        on_crossed: (x, 2) barycentric coordinates on the flat half-edge, its tail first.
        on_leaving: (x, 2) barycentric coordinates on the half-edge before the flips, its tail first.
        log_scale: (x,) log conformal factor.
    """

    counts: IntArray
    first: IntArray
    offset: IntArray
    number: IntArray
    crossed: IntArray
    leaving: IntArray
    on_crossed: FloatArray
    on_leaving: FloatArray
    log_scale: FloatArray


def overlay(
    given: IntrinsicTriangulation, flat: IntrinsicTriangulation, flips: IntArray, log_scale: FloatArray
) -> Overlay:
    """Return the crossings of the edges of two triangulations with the same discrete conformal structure.

    Args:
        given: the triangulation before the flips; its lengths are not used.
        flat: the one after, with flat lengths l_ij exp((phi_i + phi_j) / 2).
        flips: half-edges, Ptolemy flips all, in order.
        log_scale: (n,) phi.

    Raises:
        MetricError: the flips do not lead from one to the other.

    Notes:
        In Minkowski space let v_i be light cone vectors with <v_i, v_j> = -l_ij^2 / 2, so that the l are Penner's
        lambda lengths. The geodesic from s to e meets that from a to b in the direction of

            l_sb l_eb v_a + l_sa l_ea v_b  =  (l_ab / l_se) (l_ea l_eb v_s + l_sa l_sb v_e)

        (pair both sides with v_s and with v_e, and use Ptolemy's relation). In a Euclidean triangle with the
        lengths l, whose circumcircle is the absolute of the Klein model, these coefficients are barycentric
        coordinates (Springborn, Schroeder, Pinkall, "Conformal equivalence of triangle meshes", 2008). Flat
        lengths belong to the vectors exp(phi_i) v_i: taken with them, the left side gives the place on the flat
        edge ab, and the right side, with factors exp(phi_s) and exp(phi_e), that on the edge se before the
        flips. The sum of the latter coefficients over that of the former is the conformal factor.
    """
    counts, first = _count(given, flat, flips)
    offset, number, crossed, leaving, near, far = _trace(given, flat, counts, first)
    (near_a, near_b), (far_a, far_b) = near.T, far.T
    on_crossed = np.stack([near_b * far_b, near_a * far_a], axis=1)
    on_leaving = np.stack([far_a * far_b, near_a * near_b], axis=1)
    on_leaving *= (flat.length[crossed] ** 2 / (near_a * far_b + near_b * far_a))[:, None]
    phi = np.stack([log_scale[given.tail[leaving]], log_scale[given.tail[given.twin[leaving]]]], axis=1)
    largest = phi.max(axis=1, keepdims=True)
    on_leaving *= np.exp(phi - largest)
    flat_sum, sum_before = on_crossed.sum(axis=1), on_leaving.sum(axis=1)
    return Overlay(
        counts,
        first,
        offset,
        number,
        crossed,
        leaving,
        on_crossed / flat_sum[:, None],
        on_leaving / sum_before[:, None],
        np.log(sum_before / flat_sum) + largest[:, 0],
    )


def _count(
    given: IntrinsicTriangulation, flat: IntrinsicTriangulation, flips: IntArray
) -> tuple[IntArray, IntArray]:
    """Return the number of crossings on each flat half-edge, and its place among the given ones."""
    from .overlay_kernel import replay_flips

    flipped = given.copy()
    counts = np.full(len(given.twin), -1, dtype=np.int64)
    first = np.arange(len(given.twin))
    arrays = flipped.twin, flipped.tail, flipped.length
    fits = len(given.twin) == len(flat.twin) and replay_flips(given.twin, *arrays, flips, counts, first)
    if not (fits and np.array_equal(flipped.twin, flat.twin) and np.array_equal(flipped.tail, flat.tail)):
        raise MetricError(
            f"the {len(flips)} flips do not lead from this mesh of {given.face_count} triangles to the flat "
            f"triangulation, which has {flat.face_count}: they are of different meshes"
        )
    return counts, first


def _trace(
    given: IntrinsicTriangulation, flat: IntrinsicTriangulation, counts: IntArray, first: IntArray
) -> tuple[IntArray, IntArray, IntArray, IntArray, FloatArray, FloatArray]:
    """Return the crossings along both sets of edges and the lambda lengths around them."""
    from .overlay_kernel import trace_edges

    found = np.flatnonzero(counts > 0)
    lower = found[found < flat.twin[found]]
    total = int(counts[lower].sum())
    offset = np.full(len(counts), -1, dtype=np.int64)
    offset[lower] = np.cumsum(counts[lower]) - counts[lower]
    offset[flat.twin[lower]] = offset[lower]
    number, crossed, leaving = np.empty((3, total), dtype=np.int64)
    near, far = np.empty((2, total, 2))
    touched = np.unique(found // 3)
    arrays = counts, first, touched, offset, number, crossed, leaving, near, far
    trace_edges(given.twin, flat.twin, flat.length, *arrays)
    return offset, number, crossed, leaving, near, far
