"""Charts of points in the plane at the corners of a mesh, their seams, and cutting a mesh open along seams."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from ..base.arrays import BoolArray, ComplexArray, FloatArray, IntArray, Numbers, rows_of
from ..base.jit import compiled
from ..base.text import plural
from ..errors import MetricError, SeamError
from .connectivity import TriangleMesh, end_corners, label_components, split_vertices
from .edge_kernels import ends_of_side

# Largest UV distance, relative to the UV edge length, at which the two sides of an edge count as joined.
JOIN_TOLERANCE = 1e-6

Values = TypeVar("Values", FloatArray, IntArray, ComplexArray)


def both_sides(mesh: TriangleMesh, edges: IntArray, at_corners: Values) -> tuple[Values, Values]:
    """Return the values (k, 2, ...) at the ends of inner edges in the first and in the second face of each edge.

    Both have the same order of ends.

    Args:
        mesh: the mesh.
        edges: (k,) inner edges.
        at_corners: (m, 3, ...) values at the corners.
    """
    flat = at_corners.reshape(-1, *at_corners.shape[2:])
    first_face, second_face = (end_corners(mesh.edge_halfedges[edges, side]) for side in (0, 1))
    return flat[np.stack(first_face, axis=1)], flat[np.stack(second_face[::-1], axis=1)]


def open_sides(edge_halfedges: IntArray, at_corners: Numbers, group: IntArray | None = None) -> BoolArray:
    """Return (3m,) which half-edges are open: their twin does not have exactly the same values at its ends.

    Args:
        edge_halfedges: (e, 2) the half-edges of each edge, see `TriangleMesh`; those that are missing are open.
        at_corners: (m, 3) or (m, 3, k) values at the corners, such as places in the plane.
        group: (m,) group of each face; edges between groups are open, and so are those of negative groups. None: all
            faces are in one group.
    """
    values = np.ascontiguousarray(at_corners).reshape(3 * len(at_corners), -1)
    groups = np.zeros(len(at_corners), dtype=np.int64) if group is None else group
    return find_open_sides(edge_halfedges, values, groups)


def point_seams(mesh: TriangleMesh, corners: IntArray, among: IntArray | None = None) -> IntArray:
    """Return the inner edges whose two sides have different points.

    Args:
        mesh: the mesh.
        corners: (m, 3) the point at each corner.
        among: edges to choose from; None: all.
    """
    halfedges = mesh.edge_halfedges if among is None else mesh.edge_halfedges[among]
    seams = np.flatnonzero(open_sides(halfedges, corners)[halfedges[:, 0]] & (halfedges[:, 1] >= 0))
    return seams if among is None else among[seams]


def point_vertices(faces: IntArray, corners: IntArray, count: int) -> IntArray:
    """Return (count,) the vertex of each point; faces, corners: (m, 3) the vertex and the point at each corner."""
    vertex = np.zeros(count, dtype=np.int64)
    vertex[corners.ravel()] = faces.ravel()
    return vertex


def uv_seams(mesh: TriangleMesh, corner_uv: FloatArray) -> IntArray:
    """Return the inner edges whose two sides do not coincide in the plane; `corner_uv` is (m, 3, 2)."""
    return np.flatnonzero(~joined_edges(mesh, corner_uv) & ~mesh.is_boundary_edge)


def joined_edges(mesh: TriangleMesh, corner_uv: FloatArray) -> BoolArray:
    """Return (e,) True for inner edges whose two sides coincide in the plane; `corner_uv` is (m, 3, 2)."""
    uv = np.ascontiguousarray(corner_uv, dtype=np.float64)
    joined = ~open_sides(mesh.edge_halfedges, uv)[mesh.edge_halfedges[:, 0]]
    unequal = np.flatnonzero(~joined & ~mesh.is_boundary_edge)
    first_side, second_side = both_sides(mesh, unequal, uv.view(np.complex128)[..., 0])
    gap = np.abs(first_side - second_side).max(axis=1, initial=0.0)
    length = np.maximum(
        np.abs(first_side[:, 1] - first_side[:, 0]), np.abs(second_side[:, 1] - second_side[:, 0])
    )
    joined[unequal] = gap <= JOIN_TOLERANCE * length
    return joined


def label_charts(mesh: TriangleMesh, joined: BoolArray) -> tuple[int, IntArray]:
    """Return the number of charts, and (m,) the chart of each triangle; `joined` (e,) is True for edges in charts."""
    return label_components(len(mesh.faces), *mesh.edge_faces[joined].T)


@dataclass(frozen=True, eq=False)
class CutMesh:
    """A mesh that was cut open along seams.

    Attributes:
        mesh: the cut mesh; its faces are those of the original mesh, in the same order.
        origin: (c,) the vertex of the original mesh of each vertex; ascending.
    """

    mesh: TriangleMesh
    origin: IntArray


def cut_open(mesh: TriangleMesh, seams: IntArray, holes: int = 0) -> CutMesh:
    """Return a connected mesh cut along edges into disks, or into one disk with holes.

    Args:
        mesh: the mesh.
        seams: (k,) edges, none of them on the boundary.
        holes: largest number of holes; with holes, the result is connected.

    Raises:
        SeamError: an index is not that of an edge.
        MetricError: a component of the cut mesh is not a disk, or it is not a disk with holes.
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
    is_disk = pieces == loops == euler or (pieces == 1 and loops == 2 - euler <= 1 + holes)
    if not is_disk or len(sides) == 2:
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


@compiled
def find_open_sides(edge_halfedges: IntArray, values: Numbers, group: IntArray) -> BoolArray:
    """Return the result of `open_sides` for values (3m, k)."""
    is_open = np.ones(len(values), np.bool_)
    for e in range(len(edge_halfedges)):
        h, t = edge_halfedges[e, 0], edge_halfedges[e, 1]
        if t < 0 or group[h // 3] < 0 or group[h // 3] != group[t // 3]:
            continue
        start, end = ends_of_side(h)
        twin_start, twin_end = ends_of_side(t)
        is_equal = True
        for x in range(values.shape[1]):
            if values[start, x] != values[twin_end, x] or values[end, x] != values[twin_start, x]:
                is_equal = False
        if is_equal:
            is_open[h] = is_open[t] = False
    return is_open
