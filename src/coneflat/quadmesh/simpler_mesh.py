"""Meshes of many triangles, holes or components: a grid of a simpler mesh, whose quads move to the given surface."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from ..base import BoolArray, FloatArray, IntArray, Unmet, mask_of, plural
from ..geometry import coarse_mesh, double_areas, edge_lengths
from ..geometry.nearest import Stars, TriangleTree, slide_near
from ..mesh import NEXT, PREVIOUS, CheckedMesh
from ..mesh.connectivity import TriangleMesh, joined_meshes
from .cross_field import sharp_ends
from .features import edge_indices, vertex_graph, without_pillows
from .limits import MAX_SQUARES, NO_LIMIT, SquareLimit
from .quad_mesh import QuadMesh
from .remesh import (
    area_of,
    part_of,
    short_edges,
)
from .smooth import is_on_feature


@dataclass(frozen=True, eq=False)
class SimplerMesh:
    """A simpler mesh of a surface.

    Attributes:
        mesh: the simpler mesh, in model units; vertices in filled holes come last.
        vertex_origin: its other vertices in the given mesh.
        surface: the given mesh, checked.
        is_filling: (m,) whether each of its triangles is in a filled hole.
        side: requested edge length of quads.
        limit: largest number of quads.
        notes: on the given mesh.
    """

    mesh: TriangleMesh
    vertex_origin: IntArray
    surface: TriangleMesh
    is_filling: BoolArray
    side: float
    limit: SquareLimit = NO_LIMIT
    notes: tuple[str, ...] = ()

    @classmethod
    def of(cls, checked: CheckedMesh, side: float, limit: SquareLimit) -> SimplerMesh:
        """Return a mesh itself, for quads with a requested edge length and a limit of their number."""
        mesh = checked.mesh.moved_to(np.ldexp(checked.mesh.vertices, -checked.exponent))
        every, none = np.arange(len(mesh.vertices)), np.zeros(len(mesh.faces), dtype=bool)
        return cls(mesh, every, mesh, none, side, limit)

    @property
    def filled_area(self) -> float:
        """The area of the filled holes, in model units."""
        filled = self.mesh.faces[self.is_filling]
        return float(double_areas(edge_lengths(self.mesh.vertices, filled)).sum()) / 2

    def moved(self, quads: QuadMesh) -> QuadMesh:
        """Return quads of the simpler mesh, or of a refinement of it, on the given mesh.

        Vertices slide along the surface, so that they do not jump to another sheet. Those on the boundary and on sharp
        edges of the simpler mesh move to the nearest point on the boundary, or on sharp edges within half the mean
        length of the edges there, of the same component. Quads over filled holes are left out.
        """
        is_over = np.zeros(len(quads.quads), dtype=bool)
        if self.is_filling.any():
            tree = TriangleTree(self.mesh.vertices, self.mesh.faces)
            is_over = self.is_filling[tree.nearest(quads.vertices[quads.quads].mean(axis=1))[0]]
        mesh, simple, points = self.surface, quads.surface, quads.vertices
        label, part = mesh.components[1], simple.components[1]
        off, which = cKDTree(self.mesh.vertices[: len(self.vertex_origin)]).query(simple.vertices)
        # Where components touch, the vertex found may be of another one; most are not.
        is_common, home_of_vertex = off == 0, label[self.vertex_origin[which]]
        votes = csr_matrix((is_common.astype(np.int64), (part, home_of_vertex)))
        homes = np.asarray(votes.argmax(axis=1)).ravel()[part]
        stars, common = (
            Stars.of(mesh.vertices, mesh.faces),
            np.flatnonzero(is_common & (home_of_vertex == homes)),
        )
        faces, weights = _placed(simple, common, self.vertex_origin[which], stars)
        corners = simple.faces[quads.faces, quads.barycentric.argmax(axis=1)]
        faces, weights = faces[corners], weights[corners]
        slide_near(stars, points, faces, weights)
        # Components are moved apart, so that the nearest edge is one of the same, or out of reach.
        apart = np.ptp(mesh.vertices, axis=0)
        places = mesh.vertices + 2 * np.outer(label, apart)
        targets = points + 2 * np.outer(homes[corners], apart)
        lengths = np.linalg.norm(np.diff(points[quads.edges], axis=1)[:, 0], axis=1)
        half = np.bincount(quads.edges.ravel(), lengths.repeat(2)) / quads.valences / 2
        sharp = edge_indices(mesh, sharp_ends(mesh)), half
        border = np.flatnonzero(mesh.is_boundary_edge), np.full(len(points), np.linalg.norm(apart))
        is_on = is_on_feature(quads, sharp_ends(simple)), quads.is_boundary_vertex
        for moves, (edges, reach) in zip(is_on, (sharp, border), strict=True):
            if len(edges) and moves.any():
                on_edges, faces_there, weights_there = nearest_on_edges(
                    mesh, edges, places, targets[moves], reach[moves]
                )
                at = np.flatnonzero(moves)[on_edges]
                faces[at], weights[at] = faces_there, weights_there
        places = stars.at(faces, weights)
        moved = replace(quads, vertices=places, faces=faces, barycentric=weights, surface=mesh)
        return moved.without(is_over & ~is_over.all()) if is_over.any() else moved

    def completed(self, quads: QuadMesh) -> QuadMesh:
        """Return quads with three more for each triangle of components of the given mesh without any.

        Those of many triangles are simplified before. Long edges are split.
        """
        mesh = self.surface
        label = mesh.components[1][mesh.faces[:, 0]]
        # Nothing of a component without area can be seen.
        is_bare = np.bincount(label, double_areas(edge_lengths(mesh.vertices, mesh.faces))) > 0
        is_bare[label[quads.faces]] = False
        if not is_bare.any():
            return quads
        faces, (bare_mesh, _) = np.flatnonzero(is_bare[label]), part_of(mesh, is_bare[label])
        side = max(self.side, float(np.sqrt(area_of(bare_mesh) / MAX_SQUARES)))
        # For about twice the quads that their areas need: these are less regular.
        count = 2 / 3 / side**2
        parts = [
            coarse_mesh(part, max(16, int(count * area_of(part)))).mesh
            for part, _, _ in bare_mesh.split_components()
        ]
        small = without_pillows(joined_meshes(parts))
        # More would be refused.
        small = short_edges(small, 4 * side, self.limit.squares / 3)[0]
        n, middles = len(small.vertices), small.halfedge_edges.reshape(-1, 3)
        points = [small.vertices, *(small.vertices[ends].mean(axis=1) for ends in (small.edges, small.faces))]
        centres = n + len(small.edges) + np.arange(len(small.faces))
        corners = [
            (small.faces[:, i], n + middles[:, i - 1], centres, n + middles[:, (i + 1) % 3]) for i in range(3)
        ]
        added = np.concatenate([np.stack(corners_of_quads, axis=1) for corners_of_quads in corners])
        on, weights = TriangleTree(bare_mesh.vertices, bare_mesh.faces).nearest(np.concatenate(points))
        places = np.einsum("qi,qix->qx", weights, bare_mesh.vertices[bare_mesh.faces[on]])
        bare = plural(int(is_bare.sum()), "component")
        note = Unmet(f"Made three quads of each triangle of {bare} without a grid.")
        return replace(
            quads,
            vertices=np.concatenate([quads.vertices, places]),
            quads=np.concatenate([quads.quads, len(quads.vertices) + added]),
            faces=np.concatenate([quads.faces, faces[on]]),
            barycentric=np.concatenate([quads.barycentric, weights]),
            notes=(*quads.notes, note),
        )


def nearest_on_edges(
    mesh: TriangleMesh, edges: IntArray, places: FloatArray, targets: FloatArray, reach: FloatArray
) -> tuple[BoolArray, IntArray, FloatArray]:
    """Return (k,) which targets have a point on edges within reach, and for these the triangles and the coordinates.

    Args:
        mesh: the mesh.
        edges: its edges.
        places: (n, 3) where its vertices are taken to be.
        targets: (k, 3) the targets.
        reach: (k,) largest distances from them.
    """
    halfedges = mesh.edge_halfedges[edges, 0]
    tails, heads = mesh.ends_of(halfedges)
    # Each edge is a triangle without area.
    tree = TriangleTree(places, np.stack([tails, heads, heads], axis=1))
    on, (share, *_) = (columns.T for columns in tree.nearest(targets))
    nearest = places[heads[on]] + share[:, None] * (places[tails[on]] - places[heads[on]])
    is_near = np.linalg.norm(nearest - targets, axis=1) <= reach
    halfedge, share = halfedges[on[is_near]], share[is_near]
    weights, row = np.zeros((len(share), 3)), np.arange(len(share))
    weights[row, np.take(NEXT, halfedge % 3)] = share
    weights[row, np.take(PREVIOUS, halfedge % 3)] = 1 - share
    return is_near, halfedge // 3, weights


def _placed(
    simple: TriangleMesh, common: IntArray, origin: IntArray, surface: Stars
) -> tuple[IntArray, FloatArray]:
    """Return (n,) the triangles and (n, 3) barycentric coordinates of vertices of a simpler mesh on the given one.

    Each vertex starts where the one before it has arrived, on the shortest path from a vertex that both meshes have:
    in one long step it could end at a nearer fold.

    Args:
        simple: the simpler mesh.
        common: (k,) its vertices that the given mesh has, too.
        origin: (n,) their numbers there; any for the others.
        surface: the given mesh.
    """
    previous = dijkstra(vertex_graph(simple), indices=common, return_predecessors=True, min_only=True)[1]
    # Common vertices come after themselves.
    previous = np.where(previous < 0, np.arange(len(origin)), previous)
    faces, is_placed = surface.star[surface.start[origin]], mask_of(len(origin), common)
    weights = (surface.faces[faces] == origin[:, None]).astype(np.float64)
    while len(ready := np.flatnonzero(~is_placed & is_placed[previous])):
        on, at = faces[previous[ready]], weights[previous[ready]]
        slide_near(surface, simple.vertices[ready], on, at)
        faces[ready], weights[ready], is_placed[ready] = on, at, True
    return faces, weights
