"""Cutting a mesh along seams."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .._arrays import IntArray, has_any, rows_of
from ..errors import MetricError
from ..mesh import TriangleMesh, corner_fans, label_components
from ..text import plural


@dataclass(frozen=True, eq=False)
class CutMesh:
    """A mesh opened along seams.

    Attributes:
        mesh: the cut mesh; its faces are those of the mesh before the cut, in the same order.
        origin: (c,) the vertex before the cut of each of its vertices; ascending.
        pieces: into how many disks it falls; more than one where seams close curves. 0 if that was not asked.
    """

    mesh: TriangleMesh
    origin: IntArray
    pieces: int = 0


def cut_open(mesh: TriangleMesh, seams: IntArray) -> CutMesh:
    """Cut a connected mesh along edges to disks.

    Args:
        mesh: the mesh.
        seams: (k,) edges, none of them on the boundary.

    Raises:
        MetricError: the seams do not open the mesh to disks.
    """
    cut = open_along(mesh, seams)
    sides = np.concatenate(
        [mesh.edge_halfedges[seams].ravel(), mesh.edge_halfedges[mesh.is_boundary_edge, 0]]
    )
    border, ends = np.unique(cut.mesh.ends_of(sides), return_inverse=True)
    loops, _ = label_components(len(border), *ends.reshape(2, -1))
    # Pieces all have borders, so there is one if there is one border.
    pieces = cut.mesh.components[0] if loops > 1 else 1
    euler = len(cut.origin) - (len(mesh.edges) + len(seams)) + len(mesh.faces)
    # A slit of one edge has the same vertices on both sides, which makes it none.
    if euler != pieces or loops != pieces or len(sides) == 2:
        raise MetricError(
            f"cutting along {plural(len(seams), 'edge')} leaves no disk: Euler characteristic {euler}, "
            f"{plural(loops, 'boundary loop')}"
        )
    return replace(cut, pieces=pieces)


def open_along(mesh: TriangleMesh, seams: IntArray) -> CutMesh:
    """Return a mesh whose faces are not joined at given edges (k,); vertices are numbered as before, in their order."""
    on_seam = np.zeros(len(mesh.vertices), dtype=bool)
    on_seam[mesh.edges[seams]] = True
    # Only the fans of vertices on seams fall apart.
    is_near = has_any(on_seam, mesh.faces)
    glued = has_any(on_seam, mesh.edges) & ~mesh.is_boundary_edge
    glued[seams] = False
    pairs = mesh.edge_halfedges[glued]
    near = mesh.faces[is_near]
    _, fan = corner_fans(near, *(3 * (np.cumsum(is_near) - 1)[pairs // 3] + pairs % 3).T)
    at_seam = on_seam[near]
    owner = near[at_seam]
    fans, first, which = np.unique(fan[at_seam], return_index=True, return_inverse=True)
    order = np.lexsort((first, owner[first]))
    copies = np.ones(len(mesh.vertices), dtype=np.int64)
    copies[on_seam] = np.bincount(owner[first], minlength=len(copies))[on_seam]
    origin = np.repeat(np.arange(len(copies)), copies)
    number = np.empty(len(fans), dtype=np.int64)
    number[order] = np.flatnonzero(on_seam[origin])
    faces = (np.cumsum(copies) - copies)[mesh.faces]
    corners = faces[is_near]
    corners[at_seam] = number[which]
    faces[is_near] = corners
    return CutMesh(TriangleMesh(rows_of(mesh.vertices, origin), faces), origin)
