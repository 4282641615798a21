"""Exact unfolding of polyhedra into as few pieces as possible that do not overlap."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import minimum_spanning_tree

from .... import TriangleMesh
from ....base import BoolArray, FloatArray, IntArray
from ....errors import MeshError
from ....geometry import dihedral_angles, double_areas, edge_lengths, face_normals, unit_vectors
from ....mesh import label_components
from ..pieces.cut_surface import CutSurface
from ..pieces.development import Development, find_folds
from .net_kernels import Faces, Placement
from .net_moves import Workspace, place_and_collide, place_pieces, workspace_of
from .net_search import cut_collisions, join_at, join_longest, untangle
from .polyhedron import DIGITS, Polyhedron

# Largest number of plane faces. Nobody folds as many; the search would take minutes.
MAX_FACES = 10_000
# Comparisons of boxes per triangle, about ten nanoseconds each: for untangling one tree of all faces, for each attempt
# to join two pieces, for all of these attempts, and for exchanging joined hinges for longer ones.
TREE_BUDGET, JOIN_BUDGET, ALL_JOINS_BUDGET, EXCHANGE_BUDGET = 250_000, 30_000, 600_000, 600_000
# Spanning trees from which the search starts, one after the other, until no collision remains.
STARTS = 4
# Triangles above which budgets do not grow.
MAX_BUDGET_TRIANGLES = 2000
# Depth up to which triangles touch and do not overlap, relative to the root of the area of the surface; and the largest
# one if edges are divided, where it is twice the gap that the rounding of the coordinates of the model leaves there.
TOUCHING, MAX_TOUCHING = 1e-11, 1e-6
# Collisions with which two pieces may be joined before they are untangled.
JOINED_COLLISIONS = 12
# Hinges between two pieces at which they are joined and untangled.
TRIED_JOINTS = 6
# Largest gap between the two sides of an edge that are joined, relative to its length.
JOIN_GAP = 1e-10
# Directions for which steep edges are cut.
STEEP_DIRECTIONS = 6


def unfold_net(mesh: TriangleMesh) -> Development:
    """Return a polyhedron unfolded into as few pieces as were found that do not overlap; among these, short seams.

    Faces may touch along sides. Lengths and angles are exact: each face is placed rigidly.

    Args:
        mesh: a mesh of any topology whose triangles have area. Coplanar triangles form faces, which are not cut.

    Raises:
        MeshError: there are more than MAX_FACES faces.

    Notes:
        Trees of faces are searched by simulated annealing on the number of overlapping triangles, where a subtree is
        cut off and attached at another edge (similar to L. Zawallich, R. Pajarola, "Unfolding polyhedra via tabu
        search", 2024), starting from the best of several spanning trees: that of the longest joined edges, of the
        flattest ones, and those with the steepest edges cut (W. Schlickenrieder, "Nets of polyhedra", 1997). If
        collisions remain, the tree is cut, and the same search joins pieces.
    """
    polyhedron = Polyhedron.of(mesh)
    count = int(polyhedron.face.max()) + 1
    if count > MAX_FACES:
        raise MeshError(
            f"a net of {count:,} plane faces, more than {MAX_FACES:,}, cannot be folded: simplify the mesh to 100 to "
            "1,500 triangles first"
        )
    unit = np.sqrt(double_areas(edge_lengths(mesh.vertices, mesh.faces)).sum() / 2)
    faces, order = _faces(polyhedron, unit)
    lengths = np.round(polyhedron.hinge_lengths / unit, DIGITS)
    weights = list(_weights(polyhedron))
    touching = float(np.clip(2 * polyhedron.division_gap / unit, TOUCHING, MAX_TOUCHING))
    net = _Search(faces._replace(touching=touching), lengths).fewest_pieces(weights)
    places = np.empty((len(order), 3, 2))
    places[order] = net.triangles.reshape(-1, 3, 2) * unit
    hinge = polyhedron.hinge_of_edge
    is_unfolded = (hinge >= 0) & np.append(net.is_joined, False)[hinge]
    gaps = np.where(is_unfolded, touching * unit, 0.0)
    surface = _joined(mesh, places, net.piece[polyhedron.face], gaps)
    folds, angles = find_folds(surface)
    return Development(surface, folds, angles)


def _faces(polyhedron: Polyhedron, unit: float) -> tuple[Faces, IntArray]:
    """Return the faces in units of a length, and the triangles in their order."""
    order = np.argsort(polyhedron.face, kind="stable")
    count = int(polyhedron.face.max()) + 1
    places = polyhedron.places[order] / unit
    sides = np.linalg.norm(places[:, [1, 2, 0]] - places, axis=2)
    hinge_faces = polyhedron.hinge_faces
    starts = np.concatenate([[0], np.cumsum(np.bincount(polyhedron.face, minlength=count))])
    flat = hinge_faces.ravel()
    hinge_starts = np.concatenate([[0], np.cumsum(np.bincount(flat, minlength=count))])
    hinges = np.argsort(flat, kind="stable") // 2
    ends = (polyhedron.hinge_ends / unit).reshape(-1, 2, 4)
    return Faces(
        starts, places.reshape(-1, 6), sides, hinge_faces, ends, hinge_starts, hinges, TOUCHING
    ), order


def _weights(polyhedron: Polyhedron) -> Iterator[FloatArray]:
    """Yield (h,) orders of hinges, the smallest first: those that spanning trees join."""
    mesh, hinges = polyhedron.mesh, polyhedron.hinges
    yield -polyhedron.hinge_lengths
    yield np.abs(dihedral_angles(mesh)[hinges])
    ends = mesh.vertices[mesh.edges[hinges]]
    along = unit_vectors(ends[:, 1] - ends[:, 0])
    normals = unit_vectors(face_normals(mesh.vertices, mesh.faces))
    first = np.unique(polyhedron.face, return_index=True)[1]
    for triangle in first[np.linspace(0, len(first) - 1, STEEP_DIRECTIONS).astype(int)]:
        # A little off the normal of a face, so that edges in its plane are not equally steep.
        side = mesh.vertices[mesh.faces[triangle, 1]] - mesh.vertices[mesh.faces[triangle, 0]]
        yield np.abs(along @ (normals[triangle] + 0.3 * side / np.linalg.norm(side)))


class _Search:
    """The search for a net.

    Args:
        faces: the faces.
        lengths: (h,) lengths of the hinges.
    """

    def __init__(self, faces: Faces, lengths: FloatArray) -> None:
        f, m, h = len(faces.starts) - 1, len(faces.triangles), len(lengths)
        self.faces, self.lengths = faces, lengths
        self.scale = min(m, MAX_BUDGET_TRIANGLES)
        self.work: Workspace = workspace_of(faces)
        self.net = Placement(
            np.zeros(h, dtype=bool),
            np.zeros(f, dtype=np.int64),
            np.empty((f, 4)),
            np.empty((m, 6)),
            np.empty((m, 4)),
        )
        self.component_count = label_components(f, *faces.hinge_faces.T)[0]

    def fewest_pieces(self, weights: Sequence[FloatArray]) -> Placement:
        """Return the placement with the fewest pieces that was found."""
        trees = [self._spanning_forest(weight) for weight in weights]
        counts = [self._placed(tree) for tree in trees]
        ranked = [trees[i] for i in np.argsort(counts, kind="stable")[:STARTS]]
        number = self._placed(ranked[0])
        if number:
            number = self._placed(self._untangled(ranked))
            while number:  # Once, unless there are too many to list.
                cut_collisions(self.faces, self.net, self.lengths, number, self.work)
                number = place_and_collide(self.faces, self.net, self.work)
            self._exchange(1)
            self._join_pieces()
        self._exchange(10)
        place_pieces(self.faces, self.net, self.work.walk)
        return self.net

    def _untangled(self, trees: Sequence[BoolArray]) -> BoolArray:
        """Return (h,) the joined hinges with the fewest collisions, from several trees one after the other."""
        best, fewest = trees[0], None
        for tree in trees:
            number, result = self._placed(tree), np.empty_like(tree)
            budget = self.scale * TREE_BUDGET
            number, _ = untangle(self.faces, self.net, self.lengths, number, budget, self.work, result)
            if fewest is None or number < fewest:
                best, fewest = result, number
            if number == 0:
                break
        return best

    def _spanning_forest(self, weight: FloatArray) -> BoolArray:
        """Return (h,) the hinges of the spanning forest that joins those of small weight."""
        rank = np.empty(len(weight))
        rank[np.lexsort([-self.lengths, np.round(weight, DIGITS)])] = np.arange(1, len(weight) + 1)
        count = len(self.net.piece)
        matrix = csr_matrix((rank, self.faces.hinge_faces.T), shape=(count, count))
        tree = np.zeros(len(weight), dtype=bool)
        tree[np.argsort(rank)[minimum_spanning_tree(matrix).data.astype(int) - 1]] = True
        return tree

    def _placed(self, tree: BoolArray) -> int:
        """Place the faces joined at given hinges; return the number of pairs of triangles that overlap."""
        self.net.is_joined[:] = tree
        return place_and_collide(self.faces, self.net, self.work)

    def _exchange(self, rounds: int) -> None:
        order = np.lexsort([np.arange(len(self.lengths)), -self.lengths])
        spent = 0
        for _ in range(rounds):
            changes, comparisons = join_longest(
                self.faces, self.net, self.lengths, order, self.scale * EXCHANGE_BUDGET - spent, self.work
            )
            spent += comparisons
            if not changes:
                break

    def _join_pieces(self) -> None:
        """Join pieces, the smallest first, and untangle them, until none can be joined any more or time is up."""
        spent, failed = 0, set[int]()
        while spent < self.scale * ALL_JOINS_BUDGET:
            piece = self._smallest_piece(failed)
            if piece is None:
                return
            before = self.net.is_joined.copy()
            face = int(np.flatnonzero(self.net.piece == piece)[0])
            is_done, comparisons = self._join_piece(piece)
            spent += comparisons
            if is_done:
                failed = set()
            else:
                self.net.is_joined[:] = before
                failed.add(face)
            place_pieces(self.faces, self.net, self.work.walk)

    def _smallest_piece(self, failed: set[int]) -> int | None:
        """Return the smallest piece that has neighbours and does not have a face that failed."""
        pieces = self.net.piece[self.faces.hinge_faces]
        candidates = np.unique(pieces[pieces[:, 0] != pieces[:, 1]])
        candidates = candidates[~np.isin(candidates, self.net.piece[list(failed)])]
        if not len(candidates):
            return None
        sizes = np.bincount(self.net.piece)[candidates]
        return int(candidates[sizes.argmin()])

    def _join_piece(self, piece: int) -> tuple[bool, int]:
        """Join a piece with a neighbour; return whether no triangles overlap then, and the comparisons made."""
        before = self.net.is_joined.copy()
        pieces = self.net.piece[self.faces.hinge_faces]
        hinges = np.flatnonzero((pieces[:, 0] != pieces[:, 1]) & (pieces == piece).any(axis=1))
        spent, counts = 0, list[int]()
        for hinge in hinges.tolist():
            number, comparisons = join_at(self.faces, self.net, hinge, JOINED_COLLISIONS, self.work)
            spent += comparisons
            if number == 0:
                return True, spent
            counts.append(number)
            if number < JOINED_COLLISIONS:
                self.net.is_joined[:] = before
                place_pieces(self.faces, self.net, self.work.walk)
        result = np.empty_like(before)
        for i in np.lexsort([-self.lengths[hinges], np.array(counts)])[:TRIED_JOINTS].tolist():
            if counts[i] == JOINED_COLLISIONS:
                break
            number, _ = join_at(self.faces, self.net, int(hinges[i]), JOINED_COLLISIONS, self.work)
            number, comparisons = untangle(
                self.faces, self.net, self.lengths, number, self.scale * JOIN_BUDGET, self.work, result
            )
            spent += comparisons
            if number == 0:
                self.net.is_joined[:] = result
                return True, spent
            self.net.is_joined[:] = before
            place_pieces(self.faces, self.net, self.work.walk)
        return False, spent


def _joined(mesh: TriangleMesh, places: FloatArray, piece: IntArray, gaps: FloatArray) -> CutSurface:
    """Return the cut surface of placed triangles: edges of a piece whose two sides coincide are joined.

    Args:
        mesh: the mesh.
        places: (m, 3, 2) the corners of its triangles in the plane.
        piece: (m,) the piece of each triangle.
        gaps: (e,) gaps that are closed in any case.
    """
    halfedges = mesh.edge_halfedges
    triangle, corner = halfedges // 3, halfedges % 3
    starts, ends = places[triangle, (corner + 1) % 3], places[triangle, (corner + 2) % 3]
    gap = np.maximum(
        np.linalg.norm(starts[:, 0] - ends[:, 1], axis=1), np.linalg.norm(ends[:, 0] - starts[:, 1], axis=1)
    )
    lengths = np.linalg.norm(ends[:, 0] - starts[:, 0], axis=1)
    is_joined = (piece[mesh.edge_faces[:, 0]] == piece[mesh.edge_faces[:, 1]]) & (
        gap <= np.maximum(JOIN_GAP * lengths, gaps)
    )
    seams = np.flatnonzero(~is_joined & ~mesh.is_boundary_edge)
    closed = CutSurface(mesh, mesh.faces, np.zeros((len(mesh.vertices), 2)))
    return closed.cut_along(seams, places)
