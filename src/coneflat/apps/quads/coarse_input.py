"""Meshes of many triangles: the grid is computed on a coarse mesh, and its quads move to the given surface."""

from __future__ import annotations

from dataclasses import dataclass, replace
from numbers import Real

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from ... import Flattening, TriangleMesh
from ...base import FloatArray, IntArray
from ...geometry import coarse_mesh, double_areas, edge_lengths
from ...mesh import NEXT, PREVIOUS
from ...options import declarations
from .aligned_cones import COARSE
from .cross_field import sharp_ends
from .features import edge_indices, vertex_graph
from .integer_grid import GridSearch
from .nearest import Stars, TriangleTree, slide_near
from .options import QUADS, QuadOptions
from .quad_mesh import QuadMesh
from .smooth import is_on_feature


@dataclass(frozen=True, eq=False)
class CoarseInput:
    """A coarse mesh of a surface.

    Attributes:
        mesh: the coarse mesh, in model units.
        kept: its vertices in the given mesh.
        given: the given mesh, checked.
        sizes: relative sizes of quads at its vertices, or None.
        notes: on the given mesh.
    """

    mesh: TriangleMesh
    kept: IntArray
    given: TriangleMesh
    sizes: FloatArray | None
    notes: tuple[str, ...]

    def moved(self, quads: QuadMesh) -> QuadMesh:
        """Return quads of the coarse mesh, or of a refinement of it, on the given mesh.

        Vertices slide along the surface from a nearby vertex that both meshes have, so that they do not jump to another
        sheet. Those on the boundary and on sharp edges of the coarse mesh move to the nearest point on the boundary, or
        on sharp edges within half the mean length of the edges there, of the same component.
        """
        mesh, surface, points = self.given, quads.surface, quads.vertices
        label, part = mesh.components[1], surface.components[1]
        off, which = cKDTree(self.mesh.vertices).query(surface.vertices)
        # Where components touch, the vertex found may be of another one; most are not.
        is_common, there = off == 0, label[self.kept[which]]
        votes = csr_matrix((is_common.astype(np.int64), (part, there)))
        homes = np.asarray(votes.argmax(axis=1)).ravel()[part]
        graph, common = vertex_graph(surface), np.flatnonzero(is_common & (there == homes))
        _, _, source = dijkstra(graph, indices=common, return_predecessors=True, min_only=True)
        corners = surface.faces[quads.faces, quads.barycentric.argmax(axis=1)]
        stars, start = Stars.of(mesh.vertices, mesh.faces), self.kept[which[source[corners]]]
        faces = stars.star[stars.start[start]]
        weights = (mesh.faces[faces] == start[:, None]).astype(np.float64)
        slide_near(stars, points, faces, weights)
        # Components are moved apart, so that the nearest edge is one of the same, or out of reach.
        apart = np.ptp(mesh.vertices, axis=0)
        places = mesh.vertices + 2 * np.outer(label, apart)
        wanted = points + 2 * np.outer(homes[corners], apart)
        lengths = np.linalg.norm(np.diff(points[quads.edges], axis=1)[:, 0], axis=1)
        half = np.bincount(quads.edges.ravel(), lengths.repeat(2)) / quads.valences / 2
        sharp = edge_indices(mesh, sharp_ends(mesh)), half
        border = np.flatnonzero(mesh.is_boundary_edge), np.full(len(points), np.linalg.norm(apart))
        is_on = is_on_feature(quads, sharp_ends(surface)), quads.is_boundary_vertex
        for moves, (edges, reach) in zip(is_on, (sharp, border), strict=True):
            if not (len(edges) and moves.any()):
                continue
            halfedges = mesh.edge_halfedges[edges, 0]
            tails, heads = mesh.ends_of(halfedges)
            # Each edge is a triangle without area.
            tree = TriangleTree(places, np.stack([tails, heads, heads], axis=1))
            on, (share, *_) = (found.T for found in tree.nearest(wanted[moves]))
            near = places[heads[on]] + share[:, None] * (places[tails[on]] - places[heads[on]])
            within = np.linalg.norm(near - wanted[moves], axis=1) <= reach[moves]
            at, halfedge, share = np.flatnonzero(moves)[within], halfedges[on[within]], share[within]
            faces[at], weights[at] = halfedge // 3, 0.0
            weights[at, np.take(NEXT, halfedge % 3)] = share
            weights[at, np.take(PREVIOUS, halfedge % 3)] = 1 - share
        moved = stars.at(faces, weights)
        return replace(quads, vertices=moved, faces=faces, barycentric=weights, surface=mesh)


def coarse_input(search: GridSearch) -> CoarseInput | None:
    """Return a coarse mesh for a grid; None if the given one has few triangles, or options refer to it.

    Raises:
        MeshError: the mesh cannot be flattened.
        OptionError: sizes are not positive numbers.
    """
    # Weights, and options that are not simple values, name vertices. Required sharp edges are those of the given mesh.
    quads, options = search.quads, {**search.options, "boundary": search.boundary}
    is_simple = all(one is None or isinstance(one, (str, Real)) or callable(one) for one in options.values())
    is_simple &= options.keys() <= declarations(QuadOptions).keys() - {"weights"}
    is_simple &= search.sharp_angle is None and not isinstance(search.mesh, Flattening)
    if not is_simple or (np.shape(search.source.given.faces) or (0,))[0] <= 2 * COARSE:
        return None
    checked, mesh = search.checked, search.checked.mesh
    if search.size is not None:
        area = float(double_areas(edge_lengths(mesh.vertices, mesh.faces)).sum()) / 2
        quads = area / max(float(np.ldexp(search.size, checked.exponent)), np.finfo(float).tiny) ** 2
    count = COARSE * max(1.0, quads / QUADS)
    if len(mesh.faces) <= 2 * count:
        return None
    coarse, kept, _ = coarse_mesh(mesh, int(count))
    given = mesh.moved_to(np.ldexp(mesh.vertices, -checked.exponent))
    sizes = None if search.scales is None else np.exp(-search.scales[kept])
    return CoarseInput(coarse.moved_to(given.vertices[kept]), kept, given, sizes, checked.notes)
