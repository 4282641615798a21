"""How loops around the handles of a mesh turn, and what turns them.

The turning of a strip of triangles is a sum of corner angles with signs. In a flat metric it is, but for multiples of
a full turn, the rotation between a shape and its copy carried around the loop. Conformal scaling changes it by
harmonic functions with one jump, so that prescribed cones leave nothing to choose: to turn a loop otherwise, the
conformal structure has to change.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix

from .._arrays import FloatArray, IntArray
from ..geometry import cotangents
from ..geometry.intrinsic import halfedge_twins
from ..layout.straighten import FlatTriangles
from ..mesh import TriangleMesh
from ..seams.handles import corner_signs, handle_loops

FULL_TURN = 2 * np.pi


def off_multiple(angles: FloatArray, quantum: float) -> FloatArray:
    """Return what angles are above the nearest multiple of a quantum, radians."""
    return angles - quantum * np.round(angles / quantum)


@dataclass(frozen=True, eq=False)
class Turning:
    """The turning of loops across the handles of a connected mesh.

    Attributes:
        mesh: the mesh.
        loops: the half-edges that each of the 2 genus loops crosses.
        signs: (2 genus, 3m) of the corner angles in the sum.
    """

    mesh: TriangleMesh
    loops: list[IntArray]
    signs: csr_matrix

    def of_flat(self, flat: FlatTriangles) -> FloatArray:
        """Return (2 genus,) the turning in a flat metric, up to full turns."""
        return np.array([np.angle(np.prod(flat.turns[loop])) for loop in self.loops])

    def by_log_lengths(self, lengths: FloatArray) -> csr_matrix:
        """Return (2 genus, e) the derivative by the logs of edge lengths; lengths are (m, 3)."""
        return csr_matrix(self.signs @ _angles_by_log_lengths(self.mesh, lengths))

    def by_log_scale(self, lengths: FloatArray) -> FloatArray:
        """Return (2 genus, n) the derivative by the log scale at the vertices."""
        return np.asarray((self.by_log_lengths(lengths) @ edge_means(self.mesh)).todense())


def open_turning(mesh: TriangleMesh) -> Turning:
    """Return the turning of the loops across a mesh's handles."""
    loops = handle_loops(mesh)
    twin = halfedge_twins(mesh)
    parts = [corner_signs(loop, twin) for loop in loops]
    rows = np.repeat(np.arange(len(loops)), [len(loop) for loop in loops])
    columns = np.concatenate([part[0] for part in parts] or [np.empty(0, dtype=np.int64)])
    values = np.concatenate([part[1] for part in parts] or [np.empty(0)])
    return Turning(mesh, loops, csr_matrix((values, (rows, columns)), shape=(len(loops), len(twin))))


def edge_means(mesh: TriangleMesh) -> csr_matrix:
    """Return (e, n) the means of values at the ends of edges, which scaling by them adds to the logs of lengths."""
    count = len(mesh.edges)
    rows = np.repeat(np.arange(count), 2)
    return csr_matrix(
        (np.full(2 * count, 0.5), (rows, mesh.edges.ravel())), shape=(count, len(mesh.vertices))
    )


def curvature_by_log_lengths(mesh: TriangleMesh, lengths: FloatArray) -> csr_matrix:
    """Return (n, e) the derivative of the angle defects by the logs of edge lengths."""
    corners = np.arange(3 * len(mesh.faces))
    at = csr_matrix(
        (np.full(len(corners), -1.0), (mesh.faces.ravel(), corners)), (len(mesh.vertices), len(corners))
    )
    return csr_matrix(at @ _angles_by_log_lengths(mesh, lengths))


def _angles_by_log_lengths(mesh: TriangleMesh, lengths: FloatArray) -> csc_matrix:
    """Return (3m, e) the derivative of corner angles: cot b + cot c by the opposite side, minus a cotangent else."""
    cots = cotangents(lengths)
    edges = mesh.halfedge_edges.reshape(-1, 3)
    corners = np.arange(3 * len(mesh.faces)).reshape(-1, 3)
    rows, columns, values = [], [], []
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        rows += [corners[:, i]] * 3
        columns += [edges[:, i], edges[:, j], edges[:, k]]
        values += [cots[:, j] + cots[:, k], -cots[:, k], -cots[:, j]]
    shape = (3 * len(mesh.faces), len(mesh.edges))
    return csc_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=shape)
