"""The curvature of a prescribed boundary: straight sides between corners, or round loops."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.arrays import FloatArray, IntArray
from ..base.defaults import TYPED_TOLERANCE
from ..errors import CurvatureError
from ..mesh.connectivity import TriangleMesh


@dataclass(frozen=True, eq=False)
class BoundaryCurvature:
    """Prescribed curvature of the boundary of a connected mesh.

    Attributes:
        mesh: the mesh.
        corners: (n,) curvature at corners, 0 elsewhere; loops with corners have straight sides.
        round_total: (loops,) total curvature of each round loop; NaN for loops with corners.
    """

    mesh: TriangleMesh
    corners: FloatArray
    round_total: FloatArray

    @property
    def has_round_loops(self) -> bool:
        """Whether there is a round loop, so that the target depends on the metric."""
        return bool(np.isfinite(self.round_total).any())

    def target(self, lengths: FloatArray, log_scale: FloatArray) -> FloatArray:
        """Return (n,) target curvature, radians; on round loops it is uniform along the length in the scaled metric.

        Args:
            lengths: (m, 3) side lengths before scaling.
            log_scale: (n,) phi.
        """
        mesh = self.mesh
        sides = mesh.edges[mesh.is_boundary_edge]
        flat = lengths.ravel()[mesh.edge_halfedges[mesh.is_boundary_edge, 0]]
        # A common factor does not change the target, and steps of a solver can be too large for exp.
        flat = flat * np.exp((log_scale - log_scale[sides].max(initial=0.0))[sides].sum(axis=1) / 2)
        count, loop = mesh.boundary_loops
        share = np.bincount(sides.ravel(), np.repeat(flat / 2, 2), minlength=len(loop))
        on_round = np.flatnonzero(loop >= 0)
        on_round = on_round[np.isfinite(self.round_total[loop[on_round]])]
        around = np.bincount(loop[on_round], share[on_round], minlength=count)[loop[on_round]]
        target = self.corners.copy()
        target[on_round] = self.round_total[loop[on_round]] * share[on_round] / np.maximum(around, 1e-300)
        return target


def straight_boundary(mesh: TriangleMesh, target: FloatArray) -> BoundaryCurvature:
    """Return a boundary with straight sides between corners; `target` (n,) is the curvature at corners, else 0."""
    corners = np.where(mesh.is_boundary_vertex, target, 0.0)
    return BoundaryCurvature(mesh, corners, np.full(mesh.boundary_loops[0], np.nan))


def prescribed_boundary(
    mesh: TriangleMesh,
    lengths: FloatArray,
    cone_total: float,
    corners: IntArray,
    curvatures: FloatArray,
    names: IntArray,
) -> BoundaryCurvature:
    """Return the boundary curvature that makes a disk, or a polygon with the given corners.

    The outer loop has the corners, or is the longest loop if there are none. Its total curvature is 2 pi chi minus
    those of the cones and the holes. Every other loop becomes a round hole of total curvature -2 pi.

    Args:
        mesh: connected, with a boundary.
        lengths: (m, 3) side lengths.
        cone_total: sum of the curvatures of the cones, radians.
        corners, curvatures: (c,) boundary vertices and their curvatures, radians; all NaN to distribute the curvature
            equally. Empty for a disk.
        names: (n,) vertex numbers of the input, for messages.

    Raises:
        CurvatureError: corners are on several loops, the curvatures do not have the required sum, or a corner has a
            curvature of pi or more.
    """
    count, loop = mesh.boundary_loops
    sides = mesh.edges[mesh.is_boundary_edge]
    side_lengths = lengths.ravel()[mesh.edge_halfedges[mesh.is_boundary_edge, 0]]
    outer = int(np.argmax(np.bincount(loop[sides[:, 0]], side_lengths, minlength=count)))
    if len(corners):
        on = np.unique(loop[corners])
        if len(on) > 1:
            raise CurvatureError(
                f"the corners lie on {len(on)} boundary loops; they must all lie on one, the outer one"
            )
        outer = int(on[0])
    round_total = np.full(count, -2 * np.pi)
    needed = 2 * np.pi * (mesh.euler_characteristic + count - 1) - cone_total
    values = np.zeros(len(mesh.vertices))
    round_total[outer] = np.nan if len(corners) else needed
    if len(corners):
        values[corners] = np.where(np.isnan(curvatures), needed / len(corners), curvatures)
        total = float(values.sum())
        if abs(total - needed) > TYPED_TOLERANCE:
            raise CurvatureError(
                f"the corners' curvatures must sum to {needed / np.pi:.6g} pi, but sum to {total / np.pi:.6g} pi"
            )
        values[corners] += (needed - total) / len(corners)
        worst = corners[np.argmax(values[corners])]
        if values[worst] >= np.pi:
            advice = "give more corners" if np.isnan(curvatures).all() else "choose smaller curvatures"
            raise CurvatureError(
                f"corner {names[worst]} would have a curvature of {values[worst] / np.pi:.4g} pi, but a corner of "
                f"a flat surface has less than pi; {advice}"
            )
    return BoundaryCurvature(mesh, values, round_total)
