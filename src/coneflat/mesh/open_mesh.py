"""Cutting a mesh open along seams."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.arrays import BoolArray, IntArray, rows_of
from ..base.jit import compiled
from ..base.text import plural
from ..errors import MetricError
from .connectivity import TriangleMesh, label_components


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
        MetricError: a component of the cut mesh is not a disk.
    """
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
    """Return a mesh cut open along given edges (k,); the copies of vertices are in the order of the vertices."""
    on_seam = np.zeros(len(mesh.vertices), dtype=bool)
    on_seam[mesh.edges[seams]] = True
    is_seam = np.zeros(len(mesh.edges), dtype=bool)
    is_seam[seams] = True
    copies, faces = np.where(on_seam, 0, 1), np.zeros(mesh.faces.shape, dtype=np.int64)
    number_copies(mesh.faces, mesh.halfedge_edges, mesh.edge_halfedges, is_seam, copies, faces)
    faces += (np.cumsum(copies) - copies)[mesh.faces]
    origin = np.repeat(np.arange(len(copies)), copies)
    return CutMesh(TriangleMesh(rows_of(mesh.vertices, origin), faces), origin)


@compiled
def number_copies(
    faces: IntArray,
    edge_of: IntArray,
    sides: IntArray,
    is_seam: BoolArray,
    copies: IntArray,
    number: IntArray,
) -> None:
    """Number the copies of each vertex on a seam, from 0, in the order of their first corners.

    Args:
        faces: (m, 3), consistently oriented.
        edge_of, sides: (3m,) the edge of each half-edge, and (e, 2) the half-edges of each edge.
        is_seam: (e,) the edges across which faces are not joined.
        copies: (n,) 0 at the vertices on seams and 1 elsewhere on entry; the number of copies on return.
        number: (m, 3) 0 on entry; the copy at each corner on return.
    """
    is_done = np.empty(3 * len(faces), np.bool_)
    for c in range(len(is_done)):
        is_done[c] = copies[faces[c // 3, c % 3]] == 1
    for first in range(len(is_done)):
        if is_done[first]:
            continue
        vertex = faces[first // 3, first % 3]
        # Walk around the vertex in one direction up to a seam or boundary, then in the other direction.
        for turn in (1, 2):
            here = first
            while here >= 0 and (here == first or not is_done[here]):
                is_done[here] = True
                number[here // 3, here % 3] = copies[vertex]
                h = here - here % 3 + (here % 3 + turn) % 3
                pair = sides[edge_of[h]]
                other = pair[1] if pair[0] == h else pair[0]
                is_end = other < 0 or is_seam[edge_of[h]]
                here = -1 if is_end else other - other % 3 + (other % 3 + turn) % 3
                if here == first:
                    break
        copies[vertex] += 1
