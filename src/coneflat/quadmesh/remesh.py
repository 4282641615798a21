"""Simpler meshes: parts of a mesh, filled holes, short edges, and triangles that are less thin."""

from __future__ import annotations

import numpy as np

from ..base import BoolArray, IntArray, mask_of
from ..geometry import angle_defect, coarse_mesh, corner_angles, double_areas, edge_lengths, mollify
from ..mesh import tie_key
from ..mesh.connectivity import TriangleMesh
from .features import lengths_along, split_edges

# Largest numbers of components, of holes, and of corners of the longest boundary, for which grids are found in some
# seconds.
MAX_COMPONENTS, MAX_HOLES, MAX_CORNERS = 64, 32, 400
# A triangle is thin if its area is less than THIN times that of one with equal sides. If more than a tenth of them are,
# as in files of CAD programs, few grids are found, so the surface is remeshed.
THIN = 0.3


def is_thin(mesh: TriangleMesh) -> BoolArray:
    """Return (m,) whether the areas of triangles are small compared with those of equal sides of this length."""
    lengths = edge_lengths(mesh.vertices, mesh.faces)
    return 6 * double_areas(lengths) <= THIN * 3**0.5 * (lengths**2).sum(axis=1)


def short_edges(
    mesh: TriangleMesh, longest: float, max_triangles: float = np.inf, marked: BoolArray | None = None
) -> tuple[TriangleMesh, IntArray]:
    """Return a mesh with marked edges (e,), and all longer ones, split, and the triangle here of each of its own.

    Splitting ends with more than `max_triangles` triangles.
    """
    face_origin, is_long = (
        np.arange(len(mesh.faces)),
        lengths_along(mesh, np.arange(len(mesh.edges))) > longest,
    )
    is_long |= False if marked is None else marked
    while is_long.any() and len(mesh.faces) <= max_triangles:
        mesh, origin = split_edges(mesh, is_long)
        face_origin, is_long = face_origin[origin], lengths_along(mesh, np.arange(len(mesh.edges))) > longest
    return mesh, face_origin


def remeshed(mesh: TriangleMesh, count: int) -> tuple[TriangleMesh, IntArray, IntArray]:
    """Return a mesh of about `count` triangles that are less thin, and its vertices (k,) and triangles here.

    Edges longer than three times the root of the mean area are split, and edges collapse; then so do the longest
    edges of thin triangles, three times. Of the mesh and all rounds, that with the smallest share of thin triangles is
    returned; rounds end where it hardly gets smaller. New vertices come last, with an index beyond those of the mesh.
    """
    n, total = len(mesh.vertices), lengths_along(mesh, np.arange(len(mesh.edges))).sum()
    # Where the area is almost none, edges are split into about four times as many pieces as triangles are requested.
    longest = max(3 * (area_of(mesh) / count) ** 0.5, total / (4 * count))
    thicker, vertex_origin, face_origin = best = mesh, np.arange(n), np.arange(len(mesh.faces))
    smallest_share, share, step = np.inf, is_thin(mesh).mean(), 0
    while step < 4 and share < 0.9 * smallest_share:
        smallest_share = share
        sides = thicker.halfedge_edges.reshape(-1, 3)[np.flatnonzero(is_thin(thicker) & (step > 0))]
        origin = lengths_along(thicker, sides.ravel()).reshape(-1, 3).argmax(axis=1)[:, None]
        marked = mask_of(len(thicker.edges), np.take_along_axis(sides, origin, axis=1))
        # More are needed only for very thin triangles, which stay so.
        thicker, origin = short_edges(thicker, longest, 3 * count, marked)
        face_origin, vertex_origin = (
            face_origin[origin],
            np.append(vertex_origin, np.full(len(thicker.vertices) - len(vertex_origin), n)),
        )
        coarse = coarse_mesh(thicker, count)
        thicker = coarse.mesh
        vertex_origin, face_origin, step, share = (
            vertex_origin[coarse.vertices],
            face_origin[coarse.faces],
            step + 1,
            is_thin(thicker).mean(),
        )
        best = (thicker, vertex_origin, face_origin) if share < smallest_share else best
    if best[0] is mesh:
        return best
    thicker, vertex_origin, face_origin = best
    order = np.argsort(vertex_origin, kind="stable")
    return (
        TriangleMesh(thicker.vertices[order], np.argsort(order)[thicker.faces]),
        vertex_origin[order],
        face_origin,
    )


def area_of(mesh: TriangleMesh) -> float:
    return float(double_areas(edge_lengths(mesh.vertices, mesh.faces)).sum()) / 2


def part_of(mesh: TriangleMesh, is_in: BoolArray) -> tuple[TriangleMesh, IntArray]:
    """Return some triangles (m,) of a mesh, and their vertices there."""
    vertices, faces = np.unique(mesh.faces[is_in], return_inverse=True)
    return TriangleMesh(mesh.vertices[vertices], faces.reshape(-1, 3)), vertices


def manageable_parts(mesh: TriangleMesh, side: float) -> tuple[BoolArray, list[IntArray], bool]:
    """Return (m,) the triangles of components to search grids for, the half-edges of boundaries of theirs to fill, and
    whether the longest of one has too many corners.

    The components are the largest that have room for two quads, or a quarter of these. Holes are shorter than four
    quads, or not among the longest ones.
    """
    (count, label), key, walks = mesh.components, tie_key(mesh.vertices), mesh.boundary_walks()
    areas = np.bincount(label[mesh.faces[:, 0]], double_areas(edge_lengths(mesh.vertices, mesh.faces)))
    rounded = np.round(areas / max(float(areas.max()), np.finfo(float).tiny), 9)
    order = np.lexsort((np.bincount(label, key), -rounded))[:MAX_COMPONENTS]
    has_room = (areas > 4 * side**2) | mask_of(count, order[: MAX_COMPONENTS // 4])
    is_kept = mask_of(count, order) & (areas > 0) & has_room
    is_kept |= ~is_kept.any()
    seen, holes, filled, is_jagged = set[int](), 0, list[IntArray](), False
    lengths = np.array([lengths_along(mesh, mesh.halfedge_edges[walk]).sum() for walk in walks])
    keys = [key[mesh.tails[walk]].sum() for walk in walks]
    angles = corner_angles(mollify(edge_lengths(mesh.vertices, mesh.faces), mesh)[0])
    quarters = np.rint(angle_defect(mesh.faces, angles, mesh.is_boundary_vertex) / (np.pi / 2))
    for k in np.lexsort((keys, -np.round(lengths / lengths.max(initial=1e-300), 9))):
        component = int(label[mesh.tails[walks[k][0]]])
        if component not in seen:
            seen.add(component)
            is_jagged |= bool(np.abs(quarters[mesh.tails[walks[k]]]).sum() > MAX_CORNERS)
        elif is_kept[component]:
            holes += 1
            filled += [walks[k]] if holes > MAX_HOLES or lengths[k] < 4 * side else []
    return is_kept[label[mesh.faces[:, 0]]], filled, is_jagged
