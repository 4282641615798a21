"""The motions across the edges of a map to the grid: quarter turns and whole translations."""

from __future__ import annotations

import numpy as np

from .._arrays import FloatArray, IntArray
from ..mesh import NEXT, PREVIOUS, TriangleMesh
from .transitions import UNITS


def find_motions(mesh: TriangleMesh, corner_grid: FloatArray) -> tuple[IntArray, IntArray, float]:
    """Return (3m,) quarter turns and (3m, 2) shifts of half-edges, and by how much they miss, in units of the grid.

    They take the triangle across a half-edge to its own, as those of `IntegerGrid` do: what is nearest to that among
    quarter turns and whole translations. -1 and 0 on the boundary.

    Args:
        mesh: m triangles.
        corner_grid: (m, 3, 2) the place of every triangle corner.
    """
    z = np.ascontiguousarray(corner_grid).view(np.complex128)[..., 0]
    starts, ends = z[:, NEXT].ravel(), z[:, PREVIOUS].ravel()
    turns = np.full(len(starts), -1, dtype=np.int64)
    shifts = np.zeros((len(starts), 2), dtype=np.int64)
    pairs = mesh.edge_halfedges[~mesh.is_boundary_edge]
    off = 0.0
    for h, t in (pairs.T, pairs[:, ::-1].T):
        # The angle of own over other, without dividing by a side of no length.
        turn = (ends[h] - starts[h]) * np.conj(starts[t] - ends[t])
        turns[h] = np.rint(np.angle(turn) / (np.pi / 2)).astype(np.int64) % 4
        motion = UNITS[turns[h]]
        shift = starts[h] - motion * ends[t]
        whole = np.rint(shift)
        shifts[h] = np.stack([whole.real, whole.imag], axis=1).astype(np.int64)
        missed = (starts[h] - motion * ends[t] - whole, ends[h] - motion * starts[t] - whole)
        off = max(off, *(float(np.abs(each).max(initial=0.0)) for each in missed))
    return turns, shifts, off
