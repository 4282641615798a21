"""Around the boundary of a disk."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import breadth_first_order

from .._arrays import IntArray
from ..mesh import TriangleMesh


def walk_boundary(disk: TriangleMesh) -> IntArray:
    """Return (b,) the half-edges of the boundary loop of a disk in the order of a walk with the disk to the left."""
    sides = disk.edge_halfedges[disk.is_boundary_edge, 0]
    leaving = np.empty(len(disk.vertices), dtype=np.int64)
    leaving[disk.tails[sides]] = np.arange(len(sides))
    follows = (np.ones(len(sides)), (np.arange(len(sides)), leaving[disk.heads[sides]]))
    order: IntArray = sides[
        breadth_first_order(csr_matrix(follows, shape=(len(sides),) * 2), 0, return_predecessors=False)
    ]
    return order
