"""Cutting a mesh along seams."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._arrays import IntArray
from ..errors import MetricError
from ..mesh import TriangleMesh, corner_fans, sort_by_counting


@dataclass(frozen=True, eq=False)
class CutMesh:
    """A mesh opened along seams.

    Attributes:
        mesh: the cut mesh; its faces are those of the mesh before the cut, in the same order.
        origin: (c,) the vertex before the cut of each of its vertices.
    """

    mesh: TriangleMesh
    origin: IntArray


def cut_open(mesh: TriangleMesh, seams: IntArray) -> CutMesh:
    """Cut a connected mesh along edges.

    Args:
        mesh: the mesh.
        seams: (k,) edges, none of them on the boundary.

    Raises:
        MetricError: the seams do not open the mesh to a disk.
    """
    cut = open_along(mesh, seams)
    disk = cut.mesh
    loops = disk.boundary_loops[0]
    if disk.euler_characteristic != 1 or loops != 1:
        raise MetricError(
            f"cutting along {len(seams)} edges leaves no disk: Euler characteristic "
            f"{disk.euler_characteristic}, {loops} boundary loops"
        )
    return cut


def open_along(mesh: TriangleMesh, seams: IntArray) -> CutMesh:
    """Return a mesh whose faces are not joined at given edges (k,); vertices are numbered as before, in their order."""
    glued = ~mesh.is_boundary_edge
    glued[seams] = False
    count, fans = corner_fans(mesh.faces, *mesh.edge_halfedges[glued].T)
    origin = np.empty(count, dtype=np.int64)
    origin[fans] = mesh.faces
    order = sort_by_counting(origin, len(mesh.vertices))
    number = np.empty(count, dtype=np.int64)
    number[order] = np.arange(count)
    origin = origin[order]
    return CutMesh(TriangleMesh(mesh.vertices[origin], number[fans]), origin)
