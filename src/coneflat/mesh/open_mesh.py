"""Cutting a mesh along seams."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.arrays import BoolArray, IntArray, rows_of
from ..base.compiled import compiled
from ..base.text import plural
from ..errors import MetricError
from .connectivity import TriangleMesh, label_components


@dataclass(frozen=True, eq=False)
class CutMesh:
    """A mesh opened along seams.

    Attributes:
        mesh: the cut mesh; its faces are those of the mesh before the cut, in the same order.
        origin: (c,) the vertex before the cut of each of its vertices; ascending.
    """

    mesh: TriangleMesh
    origin: IntArray


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
    return cut


def open_along(mesh: TriangleMesh, seams: IntArray) -> CutMesh:
    """Return a mesh whose faces are not joined at given edges (k,); vertices are numbered as before, in their order."""
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
        faces: (m, 3), oriented alike.
        edge_of, sides: (3m,) the edge of each half-edge, and (e, 2) the half-edges of each edge.
        is_seam: (e,) the edges across which faces are not joined.
        copies: (n,) 0 at the vertices on seams, 1 elsewhere; gets the number of copies.
        number: (m, 3) 0; gets the copy at each corner.
    """
    is_done = np.empty(3 * len(faces), np.bool_)
    for c in range(len(is_done)):
        is_done[c] = copies[faces[c // 3, c % 3]] == 1
    for first in range(len(is_done)):
        if is_done[first]:
            continue
        vertex = faces[first // 3, first % 3]
        # Around it one way as far as that goes, and then the other way.
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
