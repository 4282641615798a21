"""Whole translations of seams and whole places of cones near those of a smooth layout (quantisation)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix, csr_matrix, diags, kron
from scipy.sparse.csgraph import dijkstra

from ...base import BoolArray, ComplexArray, FloatArray, IntArray
from ...errors import GridError
from ...geometry import cotangents
from ...linalg import factorize
from .lattice import Lattice, whole_solutions
from .layout import Layout
from .transitions import TURNS, UNITS, Transitions


class Stiffness:
    """The least Dirichlet energy of a shift of a layout that changes its seams and cones by given amounts.

    A shift is a field of plane vectors whose copies across seams are quarter turns of each other plus the change of the
    translation. Its energy, the integral of its squared derivative, is that of the change of the map, and the same
    wherever the seams run. It tells how near a change comes to flipping triangles, as a distance between
    translations, in which some run around all of the model and some around a finger, does not.
    """

    def __init__(self, layout: Layout, transitions: Transitions) -> None:
        self._shifts = transitions.shifts
        self._energy = kron(_laplacian(layout), np.eye(2)).tocsr()
        self._turned = _turned_copies(transitions)
        system = (self._turned.T @ self._energy @ self._turned).tocsc()
        ridge = 1e-10 * float(system.diagonal().mean()) if system.shape[0] else 0.0
        ridged = csc_matrix(system + diags(np.full(system.shape[0], ridge)))
        ridged.sort_indices()
        self._factor = factorize(ridged)

    def displacement(self, values: FloatArray) -> FloatArray:
        """Return the shifts (2u, k) of least energy for changes (v, k) of the variables."""
        given = self._shifts @ values
        right = -(self._turned.T @ (self._energy @ given))
        shifts: FloatArray = given + self._turned @ self._factor.solve(np.ascontiguousarray(right))
        return shifts

    def gram(self, basis: IntArray) -> FloatArray:
        """Return (d, d) the energies of changes that columns of a basis (v, d) span, as scalar products."""
        count = basis.shape[1]
        gram = np.zeros((count, count))
        # Few points are on seams: as a sparse matrix this stays small.
        pulls = self._energy @ (self._shifts @ csr_matrix(basis))
        for start in range(0, count, 16):
            block = slice(start, start + 16)
            gram[:, block] = pulls.T @ self.displacement(basis[:, block].astype(np.float64))
        # What cones do not hold costs nothing; as a distance it has to cost something.
        return (gram + gram.T) / 2 + 1e-10 * max(float(np.trace(gram)), 1.0) * np.eye(count)


def _laplacian(layout: Layout) -> csr_matrix:
    """Return (u, u) the cotangent Laplacian of the layout."""
    points, (starts, ends) = layout.points, layout.ends
    weights = cotangents(np.abs(points[ends] - points[starts]).reshape(-1, 3)).ravel() / 2
    rows = np.concatenate([starts, ends, starts, ends])
    columns = np.concatenate([ends, starts, starts, ends])
    both = np.concatenate([-weights, -weights, weights, weights])
    return coo_matrix((both, (rows, columns)), shape=(len(points), len(points))).tocsr()


def _turned_copies(transitions: Transitions) -> csr_matrix:
    """Return (2u, b) how the shifts of points follow those of the ones that they are given by, if loose."""
    count = len(transitions.base)
    turns, axes = TURNS[transitions.turn], np.arange(2)
    rows = np.broadcast_to(2 * np.arange(count)[:, None, None] + axes[:, None], turns.shape)
    columns = np.broadcast_to(2 * transitions.base[:, None, None] + axes, turns.shape)
    every = coo_matrix((turns.ravel(), (rows.ravel(), columns.ravel())), shape=(2 * count, 2 * count)).tocsc()
    every.eliminate_zeros()
    is_base = transitions.base == np.arange(count)
    return every[:, np.flatnonzero((is_base[:, None] & ~transitions.held).ravel())].tocsr()


# Units: cones that are farther from each other along the surface are not rounded onto each other.
NEAR_CONE_DISTANCE = 3.0
# Radians by which the vector between such cones may turn, and pairs that are kept apart at once, None for all, as long
# as cones can be kept apart so; if not, the next of these.
SEPARATIONS = ((np.pi / 3, None), (np.pi / 2, None), (np.pi / 3, 1), (np.pi / 2, 1))
# Places of the search tree visited for the nearest one alone, of which only that cones fall together is asked.
QUICK_VISITS = 2_000


@dataclass(frozen=True, eq=False)
class ConePairs:
    """Vectors between cones that are near each other, along the surface.

    Attributes:
        rows: (p, 2, d) the vector from the one to the other, by coordinates of the lattice.
        before: (p, 2) as it is in the smooth layout.
        ends: (p, 2) the two cones, by their numbers.
    """

    rows: IntArray
    before: FloatArray
    ends: IntArray

    def apart(self, pairs: IntArray) -> IntArray:
        """Return those of some pairs that have no cone in common with one before."""
        seen: set[int] = set()
        kept = []
        for pair in pairs.tolist():
            ends = set(self.ends[pair].tolist())
            if not ends & seen:
                kept.append(pair)
                seen |= ends
        return np.array(kept, dtype=np.int64)

    def collapsed(self, coordinates: IntArray, turned: float) -> IntArray:
        """Return the pairs that a lattice point puts on one place, or turns by so much, the nearest ones first."""
        after = self.rows @ coordinates
        along = (after * self.before).sum(axis=1)
        sizes = np.linalg.norm(after, axis=1) * np.linalg.norm(self.before, axis=1)
        is_bad = along <= np.cos(turned) * sizes + np.finfo(float).eps
        order = np.argsort((self.before**2).sum(axis=1), kind="stable")
        bad: IntArray = order[is_bad[order]]
        return bad


@dataclass(frozen=True, eq=False)
class Rounding:
    """The lattice of whole solutions, and where in it the smooth layout is.

    Attributes:
        basis: (v, d) of the lattice.
        start: (d,) coordinates of the smooth layout.
        metric: scalar products (d, d) of the basis.
        pairs: of cones that must not fall together.
        stiffness: what that is from.
        layout: the smooth one.
    """

    basis: IntArray
    start: FloatArray
    metric: FloatArray
    pairs: ConePairs
    stiffness: Stiffness
    layout: Layout

    @property
    def smooth(self) -> FloatArray:
        """(v,) the variables of the smooth layout, made to satisfy the equations."""
        values: FloatArray = self.basis @ self.start
        return values

    def candidates(self) -> list[IntArray]:
        """Return whole values (v,) of the variables near the smooth ones that put no two cones on one place.

        First those that flip no triangle as far as the second order tells, each kind the nearest first.

        Raises:
            GridError: cones cannot be kept apart.
        """
        size = len(self.start)
        whole = Lattice(np.zeros(size, dtype=np.int64), np.eye(size, dtype=np.int64), self.metric)
        lattice = whole.reduced()
        apart: list[IntArray] = []
        for turned, at_once in SEPARATIONS:
            try:
                apart = self._apart(lattice, turned, at_once)
                break
            except GridError:
                if (turned, at_once) == SEPARATIONS[-1]:
                    raise
        values = [np.asarray(self.basis @ each) for each in apart]
        areas = self._turned_over(np.stack(values, axis=1) - self.smooth[:, None])
        return [values[i] for i in np.argsort(areas, kind="stable")]

    def _apart(self, lattice: Lattice, turned: float, at_once: int | None) -> list[IntArray]:
        """Return near vectors of a lattice that keep all cones apart, and turn those near each other by less."""
        while True:  # each time the lattice loses a dimension at least
            bad = self.pairs.collapsed(lattice.nearest(self.start, 1, QUICK_VISITS)[0], turned)
            if not len(bad):
                break
            for pair in self.pairs.apart(bad)[:at_once].tolist():
                part = self._kept_apart(pair, lattice)
                if part is None and pair == bad[0]:
                    distance = float(np.hypot(*self.pairs.before[pair]))
                    raise GridError(
                        f"two cones {distance:.2g} units from each other cannot be kept apart: ask for more quads"
                    )
                lattice = lattice if part is None else part
            lattice = lattice.reduced()
        # The nearest of all may be another than that of the quick search.
        found = np.concatenate(
            [lattice.nearest(self.start, 64), lattice.nearest(self.start, 1, QUICK_VISITS)]
        )
        return [each for each in found if not len(self.pairs.collapsed(each, turned))][:16]

    def _turned_over(self, changes: FloatArray) -> FloatArray:
        """Return (k,) the area of triangles that the shifts of least energy turn over, for changes (v, k)."""
        shifts = self.stiffness.displacement(changes)
        moved = self.layout.points[:, None] + shifts[0::2] + 1j * shifts[1::2]
        a, b, c = (moved[self.layout.corners[:, i]] for i in range(3))
        doubled = (np.conj(b - a) * (c - a)).imag
        areas: FloatArray = -np.minimum(doubled, 0.0).sum(axis=0)
        return areas

    def _kept_apart(self, pair: int, lattice: Lattice) -> Lattice | None:
        """Return the part of a lattice where two cones are as far apart along an axis as they were, a unit at least.

        Where they are already, their vector gets the direction that it had, as nearly as may be. None if it is given.
        """
        before, rows = self.pairs.before[pair], self.pairs.rows[pair]
        main = int(np.argmax(np.abs(before)))
        distance = max(1, round(abs(before[main])))
        ratio = distance / max(abs(before[main]), np.finfo(float).tiny)
        away = [round(ratio * before[0]), round(ratio * before[1])]
        is_free = (rows @ lattice.basis).any(axis=1)
        aside = 1 if before[1 - main] >= 0 else -1
        for axis, value in ((main, away[main]), (1 - main, away[1 - main]), (1 - main, aside)):
            part = lattice.where(rows[axis], value) if is_free[axis] else None
            if part is not None:
                return part
        return None


def find_rounding(layout: Layout, transitions: Transitions) -> Rounding:
    """Return the lattice that a layout's translations and cones are to be rounded to."""
    zeros = np.zeros(len(transitions.equations), dtype=np.int64)
    solutions = whole_solutions(transitions.equations, zeros)
    assert solutions is not None
    basis = solutions.basis
    fitted = np.linalg.lstsq(basis.astype(np.float64), transitions.values, rcond=None)[0]
    start = np.asarray(fitted, dtype=np.float64)
    stiffness = Stiffness(layout, transitions)
    pairs = _near_pairs(layout, transitions, basis, start)
    return Rounding(basis, start, stiffness.gram(basis), pairs, stiffness, layout)


def _near_pairs(layout: Layout, transitions: Transitions, basis: IntArray, start: FloatArray) -> ConePairs:
    """Return the vectors between cones along the shortest paths over edges, where these are short."""
    mesh, points, cones, (starts, ends) = layout.mesh, layout.points, layout.whole, layout.ends
    tails, heads = mesh.tails, mesh.heads
    graph = csr_matrix(
        (np.abs(points[ends] - points[starts]), (tails, heads)), shape=(len(mesh.vertices),) * 2
    )
    graph = graph.maximum(graph.T)
    found, before = dijkstra(graph, indices=cones, limit=NEAR_CONE_DISTANCE, return_predecessors=True)
    halfedge = csr_matrix((np.arange(1, len(tails) + 1), (tails, heads)), shape=graph.shape)
    is_cone = np.zeros(len(mesh.vertices), dtype=bool)
    is_cone[cones] = True
    rows, ends_of = [], []

    def joining(path: list[int]) -> PathVector:
        sides = [_side(int(halfedge[a, b]), int(halfedge[b, a]), starts, ends) for a, b in pairwise(path)]
        return _vector(sides, transitions, points)

    for i, j in np.argwhere(np.isfinite(found[:, cones])).tolist():
        if i >= j:
            continue
        path = [int(cones[j])]
        while path[-1] != cones[i]:
            path.append(int(before[i, path[-1]]))
        path.reverse()
        if is_cone[path[1:-1]].any():
            continue
        rows.append(joining(path).rows)
        ends_of.append((i, j))
    cones_apart = np.array(rows, dtype=np.int64).reshape(len(rows), 2, len(basis))
    paths = _paths_to_sides(layout)
    sides_apart, length = _distances_to_sides([joining(path) for path in paths], transitions)
    sides_apart = sides_apart @ basis
    # Those that face each other: nearly half of the way leads straight to the other; and that are not on one line.
    facing = np.abs(sides_apart[:, 0] @ start) > np.maximum(0.45 * length, 1e-6)
    joined = np.concatenate([cones_apart @ basis, sides_apart[facing]])
    # Those with sides have no cone in common, as far as is told here.
    ends_of += [(len(cones) + k, len(cones) + k) for k in range(int(facing.sum()))]
    return ConePairs(joined, joined @ start, np.array(ends_of, dtype=np.int64).reshape(-1, 2))


def _side(forth: int, back: int, starts: IntArray, ends: IntArray) -> tuple[int, int]:
    """Return the points at the ends of an edge, in a triangle beside it; half-edges from 1, 0 for none."""
    if forth:
        return int(starts[forth - 1]), int(ends[forth - 1])
    return int(ends[back - 1]), int(starts[back - 1])


def _vector(sides: list[tuple[int, int]], transitions: Transitions, points: ComplexArray) -> PathVector:
    """Return the vector along a path, given by the points at the ends of its edges.

    The places of vertices on the way cancel: of two copies of one, i^turn base + shift each, the difference is left
    between their shifts, seen from one frame.
    """

    def shift(point: int) -> IntArray:
        rows: IntArray = transitions.shifts[2 * point : 2 * point + 2].toarray()
        return rows

    turn, total = 0, -shift(sides[0][0])
    place = points[sides[0][1]] - points[sides[0][0]]
    for (_, here), (there, end) in pairwise(sides):
        if here != there:
            across = int(transitions.turn[here] - transitions.turn[there]) % 4
            total = total + TURNS[turn] @ (shift(here) - TURNS[across] @ shift(there))
            turn = (turn + across) % 4
        place += UNITS[turn] * (points[end] - points[there])
    last = total + TURNS[turn] @ shift(sides[-1][1])
    # Along one edge there is nothing between, however far off the straight way its end may be.
    length = float(abs(place)) if len(sides) > 1 else 0.0
    return PathVector(last, length, sides[0][0], sides[-1][1], turn)


def _paths_to_sides(layout: Layout) -> list[list[int]]:
    """Return short paths of vertices between sides, or a side and a cone, that pass no other side or cone.

    Of all that join the same two, the shortest one; cones are joined by others.
    """
    mesh, sides, cones, (starts, ends) = layout.mesh, layout.sides, layout.whole, layout.ends
    side_count = len(sides.axis)
    if not side_count:
        return []
    # What lies on sides has the number of one, cones have their own.
    label = np.full(len(mesh.vertices), -1)
    label[cones] = side_count + np.arange(len(cones))
    on_side = layout.vertex[sides.points]
    inner = ~np.isin(on_side, cones)
    label[on_side[inner]] = sides.side[inner]
    # Edges along sides join nothing.
    both = label[mesh.edges]
    at_end = np.isin(mesh.edges, np.intersect1d(cones, on_side)).any(axis=1)
    along = (both >= 0).all(axis=1) & (at_end | (both[:, 0] == both[:, 1]))
    lengths = np.abs(layout.points[ends] - layout.points[starts])
    kept = ~along[mesh.halfedge_edges]
    graph = csr_matrix((lengths[kept], (mesh.tails[kept], mesh.heads[kept])), shape=(len(label),) * 2)
    graph = graph.maximum(graph.T)
    distance, before, source = dijkstra(
        graph,
        indices=np.flatnonzero(label >= 0),
        limit=NEAR_CONE_DISTANCE,
        min_only=True,
        return_predecessors=True,
    )
    one, two = mesh.edges[~along & np.isfinite(distance)[mesh.edges].all(axis=1)].T
    total = distance[one] + distance[two] + np.asarray(graph[one, two]).ravel()
    pairs = np.sort(label[source[np.stack([one, two], axis=1)]], axis=1)
    near = np.flatnonzero(
        (total <= NEAR_CONE_DISTANCE) & (pairs[:, 0] != pairs[:, 1]) & (pairs[:, 0] < side_count)
    )
    near = near[np.lexsort((total[near], pairs[near, 1], pairs[near, 0]))]
    _, first = np.unique(pairs[near], axis=0, return_index=True)

    def to_root(vertex: int) -> list[int]:
        path = [vertex]
        while before[path[-1]] >= 0:
            path.append(int(before[path[-1]]))
        return path

    return [[*to_root(int(one[k]))[::-1], *to_root(int(two[k]))] for k in near[first]]


class PathVector(NamedTuple):
    """The vector between the ends of a path, in the frame of its first edge.

    Attributes:
        rows: (2, v) of it, by the variables, as far as these tell where the ends are.
        length: of it, in the layout; 0 along a single edge.
        first, last: the points at the ends.
        turn: by how many quarter turns the frame of the last edge is turned.
    """

    rows: IntArray
    length: float
    first: int
    last: int
    turn: int


def _distances_to_sides(vectors: list[PathVector], transitions: Transitions) -> tuple[IntArray, FloatArray]:
    """Return (p, 2, v) the coordinate that separates the ends of vectors, with 0 for the other, and (p,) lengths."""
    found, lengths = [], []
    for one in vectors:
        known = _known_axes(transitions, one.first) & np.roll(
            _known_axes(transitions, one.last), one.turn % 2
        )
        for axis in np.flatnonzero(known).tolist():
            if one.rows[axis].any():
                found.append(np.stack([one.rows[axis], np.zeros_like(one.rows[axis])]))
                lengths.append(one.length)
    size = transitions.shifts.shape[1]
    return np.array(found, dtype=np.int64).reshape(len(found), 2, size), np.array(lengths)


def _known_axes(transitions: Transitions, point: int) -> BoolArray:
    """Return (2,) whether the variables tell a coordinate of a point."""
    held: BoolArray = transitions.held[transitions.base[point]]
    return np.roll(held, int(transitions.turn[point]) % 2)
