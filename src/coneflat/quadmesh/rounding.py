"""Rounding of seam translations and cone positions of a smooth layout to integers (quantisation)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.sparse import bmat, coo_matrix, csc_matrix, csr_matrix, diags, kron, vstack
from scipy.sparse.csgraph import dijkstra

from ..base import BoolArray, ComplexArray, FloatArray, IntArray, mask_of
from ..geometry import TURNS, UNITS, as_complex, as_pairs, complex_sums, cotangent_laplacian, cotangents
from ..linalg import factorize
from .features import edge_indices
from .grid_layout import GridLayout
from .lattice import Lattice, ReducedLattice, integer_solutions
from .transitions import Transitions, find_transitions


class Stiffness:
    """The least Dirichlet energy of a displacement field that changes seams and cones by given amounts.

    A displacement field consists of plane vectors whose copies across seams differ by quarter turns and the change of
    the translation. Its energy, the integral of its squared derivative, does not depend on the position of the seams.
    It predicts better how close a change comes to flipping triangles than a distance between translations does, of
    which some belong to loops around the entire model and some to loops around a finger.
    """

    def __init__(self, layout: GridLayout, transitions: Transitions) -> None:
        self._shifts = transitions.shifts
        points, (starts, ends) = layout.points, layout.ends
        lengths = np.abs(points[ends] - points[starts]).reshape(-1, 3)
        laplacian = cotangent_laplacian(layout.corners, cotangents(lengths), len(points))
        self._energy = kron(laplacian, np.eye(2)).tocsr()
        self._turned = _turned_copies(transitions)
        system = (self._turned.T @ self._energy @ self._turned).tocsc()
        ridge = 1e-10 * (system.diagonal().sum() / max(system.shape[0], 1))
        ridged = csc_matrix(system + diags(np.full(system.shape[0], ridge)))
        self._factor = factorize(ridged.sorted_indices())

    def displacement(self, prescribed: FloatArray) -> FloatArray:
        """Return the displacements (2u, k) of least energy for given ones (2u, k) of fixed coordinates and copies."""
        right = -(self._turned.T @ (self._energy @ prescribed))
        return prescribed + self._turned @ self._factor.solve(np.ascontiguousarray(right))

    def gram(self, basis: IntArray) -> FloatArray:
        """Return (d, d) the Gram matrix of the columns of a basis (v, d) in the energy."""
        gram, pulls = np.zeros((basis.shape[1],) * 2), self.pulls(basis)
        for start in range(0, len(gram), 16):
            block = slice(start, start + 16)
            gram[:, block] = pulls.T @ self.displacement(self._shifts @ basis[:, block].astype(np.float64))
        # Changes without energy need a positive value too, so that the energy is a metric.
        return (gram + gram.T) / 2 + 1e-10 * max(float(np.trace(gram)), 1.0) * np.eye(len(gram))

    def pulls(self, basis: IntArray) -> csr_matrix:
        """Return (2u, d) the matrix whose products with displacements are derivatives of the energy by coordinates."""
        # Few points are on seams, so the sparse matrix is small.
        return self._energy @ (self._shifts @ csr_matrix(basis))


def _turned_copies(transitions: Transitions) -> csr_matrix:
    """Return (2u, b) the matrix from the free coordinates of base points to the displacements of all points."""
    count = len(transitions.base)
    turns, axes = TURNS[transitions.turn], np.arange(2)
    rows = np.broadcast_to(2 * np.arange(count)[:, None, None] + axes[:, None], turns.shape)
    columns = np.broadcast_to(2 * transitions.base[:, None, None] + axes, turns.shape)
    every = coo_matrix((turns.ravel(), (rows.ravel(), columns.ravel())), shape=(2 * count, 2 * count)).tocsc()
    every.eliminate_zeros()
    is_base = transitions.base == np.arange(count)
    return every[:, np.flatnonzero((is_base[:, None] & ~transitions.fixed).ravel())].tocsr()


# Grid units: only cones within this distance along the surface are checked for merging.
NEAR_CONE_DISTANCE = 5.0
# Attempts to separate cones, in this order until one succeeds: largest rotation of the vector between near cones in
# radians, number of pairs that are separated at once, None for all, and largest number of rounds. Where more are
# needed, relaxing nearly always fails afterwards.
SEPARATIONS = ((np.pi / 3, None, 100), (np.pi / 2, None, 100), (np.pi / 3, 1, 100), (np.pi / 2, 1, 20))


@dataclass(frozen=True, eq=False)
class ConePairs:
    """Vectors along the surface between cones that are near each other.

    Attributes:
        rows: (2p, d) coefficients of the vector from one cone to the other in the coordinates of the lattice, of all x
            before those of all y.
        before: (p, 2) the vector in the smooth layout.
        ends: (p, 2) the indices of the two cones.
    """

    rows: csr_matrix
    before: FloatArray
    ends: IntArray

    def disjoint(self, pairs: IntArray) -> IntArray:
        """Return the pairs that have no cone in common with previously selected pairs."""
        seen, disjoint = set[int](), list[int]()
        for pair in pairs.tolist():
            ends = set(self.ends[pair].tolist())
            if not ends & seen:
                disjoint.append(pair)
                seen |= ends
        return np.array(disjoint, dtype=np.int64)

    def collapsed(self, coordinates: IntArray, angle: float) -> IntArray:
        """Return the pairs that a lattice point merges or rotates by at least `angle`, the nearest pairs first."""
        after = (self.rows @ coordinates).reshape(2, -1).T
        along = (after * self.before).sum(axis=1)
        sizes = np.linalg.norm(after, axis=1) * np.linalg.norm(self.before, axis=1)
        is_bad = along <= np.cos(angle) * sizes + np.finfo(float).eps
        order = np.argsort((self.before**2).sum(axis=1), kind="stable")
        return order[is_bad[order]]


@dataclass(frozen=True, eq=False)
class Rounding:
    """The lattice of integer solutions, and the position of the smooth layout in it.

    Attributes:
        basis: (v, d) basis of the lattice.
        start: (d,) coordinates of the smooth layout.
        metric: (d, d) Gram matrix of the basis.
        stiffness: the energy that gives the metric.
        layout: the smooth layout.
        transitions: its seams and sides.
        lattice: the integer coordinates that are possible: all, or those of `with_zeros`.
        attempts: how many attempts to separate cones are made; None for all.
    """

    basis: IntArray
    start: FloatArray
    metric: FloatArray
    stiffness: Stiffness
    layout: GridLayout
    transitions: Transitions
    lattice: ReducedLattice
    attempts: int | None = None

    def with_zeros(self, rows: IntArray) -> Rounding:
        """Return the rounding to integer values whose products with rows (j, v) are 0."""
        solutions = integer_solutions(rows @ self.basis, np.zeros(len(rows), dtype=np.int64))
        assert solutions is not None  # zeros are one
        return replace(self, lattice=_lattice(solutions.basis, self.metric))

    def energy(self, values: FloatArray | IntArray) -> float:
        """Return the least energy of a displacement of the layout to integer values (v,)."""
        coordinates = np.linalg.lstsq(self.basis.astype(np.float64), values, rcond=None)[0]
        change = coordinates - self.start
        return float(change @ self.metric @ change)

    def scaled(self, factor: float) -> Rounding:
        """Return the rounding of the layout with the number of squares multiplied by a factor."""
        return replace(self, start=np.sqrt(factor) * self.start, layout=self.layout.scaled(factor))

    @cached_property
    def pairs(self) -> ConePairs:
        """Pairs of cones that must not merge."""
        return _near_pairs(self.layout, self.transitions, self.basis, self.start)

    def nearest(self) -> IntArray | None:
        """Return integer values (v,) of the variables nearest to the smooth ones that merge no two cones.

        None if cones cannot be separated.
        """
        for attempt in SEPARATIONS[: self.attempts]:
            if (coordinates := self._separated(self.lattice, *attempt)) is not None:
                return np.asarray(self.basis @ coordinates)
        return None

    def displaced(self, values: FloatArray | IntArray) -> ComplexArray:
        """Return (u,) the points moved by the displacement of least energy to some values (v,)."""
        points, places = self.layout.points, self.transitions.places
        prescribed = as_pairs(places(points, values) - points).reshape(-1, 1)
        shift = self.stiffness.displacement(prescribed)
        return places(points + as_complex(shift.reshape(-1, 2)), values)

    def _separated(
        self, lattice: ReducedLattice, angle: float, at_once: int | None, rounds: int
    ) -> IntArray | None:
        """Return a near vector of a lattice that separates all cones, and rotates near pairs by less than `angle`.

        None if two cones cannot be separated after others, or more pairs are left than this number of rounds.
        """
        for left in range(rounds, 0, -1):  # each reduces the dimension of the lattice
            remaining: Lattice = lattice
            coordinates = lattice.nearest(self.start)
            if not len(bad := self.pairs.collapsed(coordinates, angle)):
                return coordinates
            pairs = self.pairs.disjoint(bad)
            if at_once and len(pairs) >= left * at_once:
                return None
            for pair in pairs[:at_once].tolist():
                part = self._separate(pair, remaining)
                if part is None and pair == bad[0]:
                    return None
                remaining = remaining if part is None else part
            lattice = remaining.reduced()
        return None

    def _separate(self, pair: int, lattice: Lattice) -> Lattice | None:
        """Return the part of a lattice where two cones keep their distance along an axis, at least a unit.

        If this coordinate is fixed already, the other one is chosen to preserve the direction of their vector as well
        as possible. None if both are fixed.
        """
        before, rows = self.pairs.before[pair], self.pairs.rows[pair :: len(self.pairs.ends)].toarray()
        main = int(np.argmax(np.abs(before)))
        length = abs(before[main])
        away = np.rint(max(1, round(length)) / max(length, np.finfo(float).tiny) * before).astype(np.int64)
        aside = 1 if before[1 - main] >= 0 else -1
        for axis, value in ((main, away[main]), (1 - main, away[1 - main]), (1 - main, aside)):
            if (part := lattice.where(rows[axis], value)) is not None:
                return part
        return None


def find_rounding(layout: GridLayout) -> Rounding:
    """Return the lattice to which the translations and cones of a layout must be rounded.

    Raises:
        SeamError: the sides of a seam are not congruent.
        GridError: the sides of a seam are not related by quarter turns, or the equations between them overflow.
    """
    transitions = find_transitions(layout)
    solutions = integer_solutions(transitions.equations, np.zeros(len(transitions.equations), np.int64))
    assert solutions is not None
    basis = solutions.basis
    start = np.linalg.lstsq(basis.astype(np.float64), transitions.values, rcond=None)[0].astype(np.float64)
    stiffness = Stiffness(layout, transitions)
    metric = stiffness.gram(basis)
    # The least energy, to which sides that are not straight in the layout contribute.
    prescribed = as_pairs(transitions.places(layout.points, basis @ start) - layout.points).reshape(-1, 1)
    shift = stiffness.displacement(prescribed)
    start -= np.linalg.solve(metric, (stiffness.pulls(basis).T @ shift)[:, 0])
    lattice = _lattice(np.eye(len(start), dtype=np.int64), metric)
    return Rounding(basis, start, metric, stiffness, layout, transitions, lattice)


def _lattice(basis: IntArray, metric: FloatArray) -> ReducedLattice:
    """Return the combinations of the columns of a basis (d, k), with integers as coefficients."""
    return Lattice(np.zeros(len(basis), dtype=np.int64), basis, metric).reduced()


def _near_pairs(
    layout: GridLayout, transitions: Transitions, basis: IntArray, start: FloatArray
) -> ConePairs:
    """Return the vectors between near cones along the shortest edge paths."""
    cones, n, graph = layout.nodes, len(layout.mesh.vertices), layout.graph()
    # Paths start at copies of the cones. None goes on from a cone.
    through = diags(1.0 - mask_of(n, cones)) @ graph
    every = csr_matrix(bmat([[through, None], [graph[cones], csr_matrix((len(cones), len(cones)))]]))
    distance, parents = dijkstra(
        every, indices=n + np.arange(len(cones)), limit=NEAR_CONE_DISTANCE, return_predecessors=True
    )
    ends = np.argwhere(np.triu(np.isfinite(distance[:, cones]), 1))
    paths = [[int(cones[i]), *_path_to(int(cones[j]), parents[i])[1:]] for i, j in ends.tolist()]
    count, sided = len(paths), _paths_to_sides(layout)
    vectors_along = PathVectors.of(layout, transitions, [*paths, *sided])
    # Pairs with sides are kept if they face each other: a line crosses both, or they are not nearly collinear. Their
    # negative indices count as having no cone in common with others.
    determined = np.argwhere(vectors_along.determined_axes(transitions)[count:])
    which, axis = determined.T
    facing = [
        len(sided[k]) == 2 or vectors_along.is_beside(count + k, i, layout) for k, i in determined.tolist()
    ]
    min_distance = np.where(facing, 1e-6, 0.45 * np.abs(vectors_along.places[count + which]))
    # Products of sparse matrices of integers are faster than those of dense ones, which no library accelerates.
    products = (vectors_along.rows @ csr_matrix(basis))[np.append(np.arange(count), count + which)]
    is_determined = np.concatenate([np.ones((count, 2)), np.eye(2)[axis]]).T.reshape(-1, 1).astype(np.int64)
    vectors = vstack([products.real, products.imag]).astype(np.int64).multiply(is_determined)
    before = (vectors @ start).reshape(2, -1).T
    is_apart = np.abs(before).max(axis=1) > np.append(np.full(count, -1.0), min_distance)
    indices = np.concatenate([ends, -1 - np.stack([which, which], axis=1)])
    return ConePairs(csr_matrix(vectors)[np.tile(is_apart, 2)], before[is_apart], indices[is_apart])


def _path_to(vertex: int, parents: IntArray) -> list[int]:
    """Return the path to a vertex from the root of a tree of shortest paths, in which `before` (n,) are the parents."""
    path = [vertex]
    while parents[path[-1]] >= 0:
        path.append(int(parents[path[-1]]))
    return path[::-1]


def _paths_to_sides(layout: GridLayout) -> list[list[int]]:
    """Return short vertex paths between two sides, or a side and a cone, that pass no other side or cone.

    Only the shortest path between the same two is returned. Paths between cones are found elsewhere.
    """
    mesh, sides, cones = layout.mesh, layout.sides, layout.nodes
    side_count = len(sides.axis)
    if not side_count:
        return []
    # Vertices on sides have the number of a side as label; each cone has its own label.
    label = np.full(len(mesh.vertices), -1)
    label[cones] = side_count + np.arange(len(cones))
    on_side = layout.vertex[sides.points]
    inner = ~np.isin(on_side, cones)
    label[on_side[inner]] = sides.side[inner]
    # Edges along sides are not part of paths.
    labels = label[mesh.edges]
    at_end = np.isin(mesh.edges, np.intersect1d(cones, on_side)).any(axis=1)
    along = (labels >= 0).all(axis=1) & (at_end | (labels[:, 0] == labels[:, 1]))
    graph, at = layout.graph(~along[mesh.halfedge_edges]), np.flatnonzero(label >= 0)
    distance, parents, source = dijkstra(
        graph, indices=at, limit=NEAR_CONE_DISTANCE, min_only=True, return_predecessors=True
    )
    tails, heads = mesh.edges[~along & np.isfinite(distance)[mesh.edges].all(axis=1)].T
    total = distance[tails] + distance[heads] + np.asarray(graph[tails, heads]).ravel()
    pairs = np.sort(label[source[np.stack([tails, heads], axis=1)]], axis=1)
    short = np.flatnonzero(
        (total <= NEAR_CONE_DISTANCE) & (pairs[:, 0] != pairs[:, 1]) & (pairs[:, 0] < side_count)
    )
    short = short[np.lexsort((total[short], pairs[short, 1], pairs[short, 0]))]
    _, first = np.unique(pairs[short], axis=0, return_index=True)
    return [
        [*_path_to(int(tails[k]), parents), *_path_to(int(heads[k]), parents)[::-1]] for k in short[first]
    ]


@dataclass(frozen=True, eq=False)
class PathVectors:
    """The vectors between the ends of p paths, each in the frame of its first edge.

    Attributes:
        rows: (p, v) coefficients of the vectors, as complex numbers, in the variables, as far as these determine their
            ends.
        places: (p,) the vectors in the layout.
        ends: (p, 2) the points at the ends.
        turns: (p, 2) the rotations of the frames of the first edge, which is 0, and of the last, in quarter turns.
    """

    rows: csr_matrix
    places: ComplexArray
    ends: IntArray
    turns: IntArray

    @classmethod
    def of(cls, layout: GridLayout, transitions: Transitions, paths: list[list[int]]) -> PathVectors:
        """Return the vectors along paths of vertices.

        The positions of vertices on a path cancel: two copies of a vertex, i^turn base + shift each, leave the
        difference of their shifts in a common frame.
        """
        mesh, (starts, ends), count = layout.mesh, layout.ends, len(paths)
        owner = np.repeat(np.arange(count), [len(path) - 1 for path in paths])
        pairs = np.array([pair for path in paths for pair in pairwise(path)], dtype=np.int64).reshape(-1, 2)
        # The points at the ends of each edge, in the triangle on its left if there is one.
        at, opposite = mesh.edge_halfedges[edge_indices(mesh, pairs)].T
        at = np.where((opposite >= 0) & (mesh.tails[opposite] == pairs[:, 0]), opposite, at)
        is_forth = mesh.tails[at] == pairs[:, 0]
        starts_at, ends_at = np.where(is_forth, [starts[at], ends[at]], [ends[at], starts[at]])
        firsts = np.flatnonzero(np.diff(owner, prepend=-1))
        lasts = np.flatnonzero(np.diff(owner, append=count))
        point_before = np.roll(ends_at, 1)
        point_before[firsts] = starts_at[firsts]
        total = np.cumsum(transitions.turn[point_before] - transitions.turn[starts_at])
        turn = (total - total[firsts][owner]) % 4
        joints = np.flatnonzero(point_before != starts_at)
        edges = np.concatenate([firsts, joints - 1, joints, lasts])
        points = np.concatenate([starts_at[firsts], point_before[joints], starts_at[joints], ends_at[lasts]])
        signs = np.repeat([-1, 1, -1, 1], [count, len(joints), len(joints), count])
        rows = csr_matrix((signs * UNITS[turn[edges]], (owner[edges], points)), (count, len(layout.points)))
        places = complex_sums(owner, UNITS[turn] * (layout.points[ends_at] - layout.points[starts_at]), count)
        shifts = transitions.shifts[::2] + 1j * transitions.shifts[1::2]
        turns = np.stack([turn[firsts], turn[lasts]], axis=1)
        return cls(rows @ shifts, places, np.stack([starts_at[firsts], ends_at[lasts]], axis=1), turns)

    def determined_axes(self, transitions: Transitions) -> BoolArray:
        """Return (p, 2) whether the variables determine each coordinate of both ends."""
        is_odd = (transitions.turn[self.ends] + self.turns) % 2 == 1
        fixed = transitions.fixed[transitions.base[self.ends]]
        return np.asarray(np.where(is_odd[:, :, None], fixed[:, :, ::-1], fixed).all(axis=1))

    def is_beside(self, k: int, axis: int, layout: GridLayout) -> bool:
        """Return whether a line along an axis crosses both sides, or the side and the cone, at the ends of path k."""
        sides, spans = layout.sides, []
        for point, turn, place in zip(self.ends[k], self.turns[k], (0.0, self.places[k]), strict=True):
            side = sides.side[sides.points == point]
            side = side[sides.axis[side] == (axis + turn) % 2]
            on = np.append(sides.points[np.isin(sides.side, side)], point)
            places = as_pairs(UNITS[turn] * (layout.points[on] - layout.points[point]) + place)
            spans.append(places[:, 1 - axis])
        return bool(max(span.min() for span in spans) <= min(span.max() for span in spans))
