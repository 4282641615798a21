"""Meshes of many triangles, holes or components: a grid of a simpler mesh, whose quads move to the given surface."""

from __future__ import annotations

from dataclasses import dataclass, replace
from numbers import Real

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from ..base import BoolArray, FloatArray, IntArray, Unmet, mask_of, plural
from ..geometry import angle_defect, coarse_mesh, corner_angles, double_areas, edge_lengths, mollify
from ..geometry.nearest import Stars, TriangleTree, slide_near
from ..io import as_input
from ..mesh import NEXT, PREVIOUS, tie_key
from ..mesh.connectivity import TriangleMesh
from ..optimise import joined
from ..options import declarations
from ..source import Source
from .aligned_cones import COARSE
from .cross_field import sharp_ends
from .features import edge_indices, lengths_along, split_edges, vertex_graph, without_pillows
from .grid_search import GridSearch
from .limits import MAX_SQUARES, NO_LIMIT, SquareLimit
from .options import QUADS, QuadOptions
from .quad_mesh import QuadMesh
from .sizes import extended
from .smooth import is_on_feature

# Largest numbers of components, of holes, and of corners of the longest boundary, for which grids are found in some
# seconds.
MAX_COMPONENTS, MAX_HOLES, MAX_CORNERS = 64, 32, 400
# A triangle is thin if its area is less than THIN times that of one with equal sides. If more than a tenth of them are,
# as in files of CAD programs, few grids are found, so the surface is remeshed.
THIN = 0.3
# Largest number of new triangles for each thin one, in meshes of more than COARSE: the plane parts of a surface are not
# better the finer they are.
MAX_REFINEMENT = 100


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
    def of(cls, search: GridSearch) -> SimplerMesh:
        """Return the mesh of a search itself."""
        checked, mesh = search.checked, search.checked.mesh
        mesh = mesh.moved_to(np.ldexp(mesh.vertices, -checked.exponent))
        every, none = np.arange(len(mesh.vertices)), np.zeros(len(mesh.faces), dtype=bool)
        return cls(mesh, every, mesh, none, search.size, search.limit)

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
            if not (len(edges) and moves.any()):
                continue
            halfedges = mesh.edge_halfedges[edges, 0]
            tails, heads = mesh.ends_of(halfedges)
            # Each edge is a triangle without area.
            tree = TriangleTree(places, np.stack([tails, heads, heads], axis=1))
            on, (share, *_) = (rows.T for rows in tree.nearest(targets[moves]))
            on_edges = places[heads[on]] + share[:, None] * (places[tails[on]] - places[heads[on]])
            within = np.linalg.norm(on_edges - targets[moves], axis=1) <= reach[moves]
            at, halfedge, share = np.flatnonzero(moves)[within], halfedges[on[within]], share[within]
            faces[at], weights[at] = halfedge // 3, 0.0
            weights[at, np.take(NEXT, halfedge % 3)] = share
            weights[at, np.take(PREVIOUS, halfedge % 3)] = 1 - share
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
        faces, (bare_mesh, _) = np.flatnonzero(is_bare[label]), _part(mesh, is_bare[label])
        side = max(self.side, float(np.sqrt(_area(bare_mesh) / MAX_SQUARES)))
        # For about twice the quads that their areas need: these are less regular.
        count = 2 / 3 / side**2
        parts = [
            coarse_mesh(part, max(16, int(count * _area(part))))[0]
            for part, _, _ in bare_mesh.split_components()
        ]
        small = without_pillows(joined(parts, np.cumsum([0, *(len(part.vertices) for part in parts)])))
        # More would be refused.
        small = _short_edges(small, 4 * side, self.limit.squares / 3)[0]
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


def simplified(search: GridSearch) -> tuple[GridSearch, SimplerMesh | None]:
    """Return the search for the grid of a simpler mesh, and this mesh.

    The search is the given one if its options name vertices, or if the mesh has few triangles, holes and components.

    Raises:
        MeshError: the mesh cannot be flattened.
        OptionError: sizes are not positive numbers.
    """
    # Weights, and options that are not simple values, name vertices. Required sharp edges are those of the given mesh.
    options = {**search.options, "boundary": search.boundary}
    is_simple = all(
        choice is None or isinstance(choice, (str, Real)) or callable(choice) for choice in options.values()
    )
    is_simple &= options.keys() <= declarations(QuadOptions).keys() - {"weights"}
    if not is_simple or search.sharp_angle is not None or search.result:
        return search, None
    checked, mesh = search.checked, search.checked.mesh
    side = float(np.ldexp(search.size, checked.exponent))
    is_kept, walks, is_jagged = _manageable(mesh, side)
    walks, is_jagged = (walks, is_jagged) if search.boundary == "auto" else ([], False)
    part, part_vertices = _part(mesh, is_kept)
    loops = [np.searchsorted(part_vertices, mesh.tails[walk]) for walk in walks]
    filled = _filled(part, loops)
    quads, notes = _area(filled) / side**2, list(checked.notes)
    count = COARSE * max(1.0, quads / QUADS)
    simple, vertex_origin, face_origin = filled, np.arange(len(filled.vertices)), np.arange(len(filled.faces))
    if is_jagged:
        search = replace(search, boundary="free")
        notes.append(Unmet(f"The boundary cuts squares, because it has more than {MAX_CORNERS} corners."))
    if _is_thin(filled).mean() > 0.1 and len(without_pillows(filled).faces) == len(face_origin):
        finest = min(count, max(COARSE, MAX_REFINEMENT * len(face_origin)))
        simple, vertex_origin, face_origin = _retriangulated(
            filled, int(np.clip(4 * quads, COARSE // 6, finest))
        )
    if len(simple.faces) > 2 * count:
        simple, vertex_origin, face_origin = coarse_mesh(filled, int(count))
    elif simple is filled and is_kept.all() and not (loops or is_jagged):
        return search, None
    if loops:
        notes.append(
            f"Filled {plural(len(loops), 'hole')}: small ones, and those beyond the {MAX_HOLES} longest."
        )
    shared, unchanged = (
        part_vertices[vertex_origin[vertex_origin < len(part_vertices)]],
        SimplerMesh.of(search),
    )
    sizes = None if search.scales is None else np.exp(extended(-search.scales[shared], simple))
    simple = simple.moved_to(np.ldexp(simple.vertices, -checked.exponent))
    search = replace(search, source=Source(as_input(simple)), sizes=sizes)
    return search, replace(
        unchanged,
        mesh=simple,
        vertex_origin=shared,
        is_filling=face_origin >= len(part.faces),
        notes=tuple(notes),
    )


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


def _is_thin(mesh: TriangleMesh) -> BoolArray:
    """Return (m,) whether the areas of triangles are small compared with those of equal sides of this length."""
    lengths = edge_lengths(mesh.vertices, mesh.faces)
    return 6 * double_areas(lengths) <= THIN * 3**0.5 * (lengths**2).sum(axis=1)


def _short_edges(
    mesh: TriangleMesh, longest: float, max_triangles: float = np.inf, marked: BoolArray | None = None
) -> tuple[TriangleMesh, IntArray]:
    """Return a mesh with marked edges (e,), and all longer ones, split, and the triangle here of each of its own.

    Splitting ends with more than `most` triangles.
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


def _retriangulated(mesh: TriangleMesh, count: int) -> tuple[TriangleMesh, IntArray, IntArray]:
    """Return a mesh of about `count` triangles that are less thin, and its vertices (k,) and triangles here.

    Edges longer than three times the root of the mean area are split, and edges collapse; then so do the longest
    edges of thin triangles, three times. Of the mesh and all rounds, that with the smallest share of thin triangles is
    returned; rounds end where it hardly gets smaller. New vertices come last, with an index beyond those of the mesh.
    """
    n, total = len(mesh.vertices), lengths_along(mesh, np.arange(len(mesh.edges))).sum()
    # Where the area is almost none, edges are split into about four times as many pieces as triangles are requested.
    longest = max(3 * (_area(mesh) / count) ** 0.5, total / (4 * count))
    remeshed, vertex_origin, face_origin = best = mesh, np.arange(n), np.arange(len(mesh.faces))
    smallest_share, share, step = np.inf, _is_thin(mesh).mean(), 0
    while step < 4 and share < 0.9 * smallest_share:
        smallest_share = share
        sides = remeshed.halfedge_edges.reshape(-1, 3)[np.flatnonzero(_is_thin(remeshed) & (step > 0))]
        origin = lengths_along(remeshed, sides.ravel()).reshape(-1, 3).argmax(axis=1)[:, None]
        marked = mask_of(len(remeshed.edges), np.take_along_axis(sides, origin, axis=1))
        # More are needed only for very thin triangles, which stay so.
        remeshed, origin = _short_edges(remeshed, longest, 3 * count, marked)
        face_origin, vertex_origin = (
            face_origin[origin],
            np.append(vertex_origin, np.full(len(remeshed.vertices) - len(vertex_origin), n)),
        )
        remeshed, remaining, origin = coarse_mesh(remeshed, count)
        vertex_origin, face_origin, step, share = (
            vertex_origin[remaining],
            face_origin[origin],
            step + 1,
            _is_thin(remeshed).mean(),
        )
        best = (remeshed, vertex_origin, face_origin) if share < smallest_share else best
    if best[0] is mesh:
        return best
    remeshed, vertex_origin, face_origin = best
    order = np.argsort(vertex_origin, kind="stable")
    return (
        TriangleMesh(remeshed.vertices[order], np.argsort(order)[remeshed.faces]),
        vertex_origin[order],
        face_origin,
    )


def _area(mesh: TriangleMesh) -> float:
    return float(double_areas(edge_lengths(mesh.vertices, mesh.faces)).sum()) / 2


def _part(mesh: TriangleMesh, is_in: BoolArray) -> tuple[TriangleMesh, IntArray]:
    """Return some triangles (m,) of a mesh, and their vertices there."""
    vertices, faces = np.unique(mesh.faces[is_in], return_inverse=True)
    return TriangleMesh(mesh.vertices[vertices], faces.reshape(-1, 3)), vertices


def _filled(mesh: TriangleMesh, loops: list[IntArray]) -> TriangleMesh:
    """Return a mesh with some boundaries filled, given as their vertices, by triangles around their centroids."""
    n = len(mesh.vertices)
    centres = [mesh.vertices[loop].mean(axis=0, keepdims=True) for loop in loops]
    fans = [np.stack([np.roll(loop, -1), loop, 0 * loop + n + k], axis=1) for k, loop in enumerate(loops)]
    return TriangleMesh(np.concatenate([mesh.vertices, *centres]), np.concatenate([mesh.faces, *fans]))


def _manageable(mesh: TriangleMesh, side: float) -> tuple[BoolArray, list[IntArray], bool]:
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
