"""Cutting a mesh open along seams."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.arrays import IntArray, rows_of
from ..base.text import plural
from ..errors import MetricError, SeamError
from .connectivity import TriangleMesh, label_components, split_vertices


@dataclass(frozen=True, eq=False)
class CutMesh:
    """A mesh that was cut open along seams.

    Attributes:
        mesh: the cut mesh; its faces are those of the original mesh, in the same order.
        origin: (c,) the vertex of the original mesh of each vertex; ascending.
    """

    mesh: TriangleMesh
    origin: IntArray


def cut_open(mesh: TriangleMesh, seams: IntArray) -> CutMesh:
    """Return a connected mesh cut along edges into disks.

    Args:
        mesh: the mesh.
        seams: (k,) edges, none of them on the boundary.

    Raises:
        SeamError: an index is not that of an edge.
        MetricError: a component of the cut mesh is not a disk.
    """
    if len(seams) and not 0 <= seams.min() <= seams.max() < len(mesh.edges):
        raise SeamError(f"seams must be edges from 0 to {len(mesh.edges) - 1:,}")
    cut = open_along(mesh, seams)
    sides = np.concatenate(
        [mesh.edge_halfedges[seams].ravel(), mesh.edge_halfedges[mesh.is_boundary_edge, 0]]
    )
    border, ends = np.unique(cut.mesh.ends_of(sides), return_inverse=True)
    loops, _ = label_components(len(border), *ends.reshape(2, -1))
    # Every component has a boundary, so a single boundary loop implies a single component.
    pieces = cut.mesh.components[0] if loops > 1 else 1
    euler = len(cut.origin) - (len(mesh.edges) + len(seams)) + len(mesh.faces)
    # A slit of a single edge has the same vertices on both sides, so it does not open the mesh.
    if euler != pieces or loops != pieces or len(sides) == 2:
        raise MetricError(
            f"cutting along {plural(len(seams), 'edge')} does not give disks: Euler characteristic {euler}, "
            f"{plural(loops, 'boundary loop')}"
        )
    return cut


def open_along(mesh: TriangleMesh, seams: IntArray) -> CutMesh:
    """Return a mesh cut open along given edges (k,).

    Each fan of triangles around a vertex has a copy of it, in the order of the vertices; those without triangles have
    none.
    """
    is_glued = ~mesh.is_boundary_edge
    is_glued[seams] = False
    origin, faces = split_vertices(mesh.faces, len(mesh.vertices), *mesh.edge_halfedges[is_glued].T)
    return CutMesh(TriangleMesh(rows_of(mesh.vertices, origin), faces), origin)
