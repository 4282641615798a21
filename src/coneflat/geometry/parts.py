"""Parts of a mesh as meshes of their own, whose edges are known from the whole."""

from __future__ import annotations

import numpy as np

from .._arrays import IntArray
from ..compiled import compiled
from ..mesh import TriangleMesh


def part_of(mesh: TriangleMesh, members: IntArray) -> TriangleMesh:
    """Return some triangles (k,), in ascending order, as a mesh; vertices and edges stay in order.

    It is what pairing its half-edges would find, but nothing has to be sorted.
    """
    faces, used, *pairing = pick_triangles(
        mesh.faces, mesh.edges, mesh.edge_halfedges, members, len(mesh.vertices)
    )
    part = TriangleMesh(mesh.vertices[used], faces)
    part.__dict__["_pairing"] = tuple(pairing)
    return part


@compiled
def pick_triangles(
    faces: IntArray, edges: IntArray, edge_halfedges: IntArray, members: IntArray, count: int
) -> tuple[IntArray, IntArray, IntArray, IntArray, IntArray]:
    """Return the triangles (k, 3) among `members`, the vertices that they use, and their edges as `pair_sides` does."""
    number, place = np.full(count, -1, dtype=np.int32), np.full(len(faces), -1, dtype=np.int32)
    for i in range(len(members)):
        place[members[i]] = i
        for corner in range(3):
            number[faces[members[i], corner]] = 0
    used = np.flatnonzero(number == 0)
    for i in range(len(used)):
        number[used[i]] = i
    own = np.empty((len(members), 3), dtype=np.int64)
    for i in range(len(members)):
        for corner in range(3):
            own[i, corner] = number[faces[members[i], corner]]
    most = min(len(edges), 3 * len(members))
    ends, sides = np.empty((most, 2), dtype=np.int64), np.empty((most, 2), dtype=np.int64)
    edge_of, new = np.empty(3 * len(members), dtype=np.int64), 0
    for e in range(len(edges)):
        found = 0
        for side in range(2):
            h = edge_halfedges[e, side]
            if h >= 0 and place[h // 3] >= 0:
                sides[new, found] = 3 * np.int64(place[h // 3]) + h % 3
                edge_of[sides[new, found]] = new
                found += 1
        if found == 0:
            continue
        if found == 1:
            sides[new, 1] = -1
        ends[new, 0], ends[new, 1] = number[edges[e, 0]], number[edges[e, 1]]
        new += 1
    return own, used, ends[:new], edge_of, sides[:new]
