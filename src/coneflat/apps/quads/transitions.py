"""Seams whose two sides are quarter turns of each other, as equations between whole numbers.

Copies of a vertex in the plane are moved onto each other by the motions of seams, z_right = i^q z_left + t. All that
may vary are the translations t of the chains of seam edges, and the places of cones; around each vertex within the
surface the motions must compose to one that keeps its place, which is an equation between these with the coefficients
0, 1 and -1.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from ... import TriangleMesh
from ...base import BoolArray, ComplexArray, FloatArray, IntArray
from ...errors import GridError
from ...layout import SeamChains, find_chains
from ...mesh import label_components, label_faces, point_vertices
from .sides import QUARTER, Sides

UNITS = np.array([1, 1j, -1, -1j])
# The same as matrices of whole numbers.
TURNS = np.array([[[1, 0], [0, 1]], [[0, -1], [1, 0]], [[-1, 0], [0, -1]], [[0, 1], [-1, 0]]])


@dataclass(frozen=True, eq=False)
class Transitions:
    """The motions of a layout's seams, and what may vary of them.

    The variables are x and y of the translation of each chain, x and y of the place of one copy of each cone, and the
    one coordinate that points of a side have in common, on the boundary or on the left of a chain.

    Attributes:
        chains: the seams.
        quarters: (c,) quarter turns of each chain.
        base: (u,) the copy that each point is given by: i^turn times that plus its shift. Itself where it is the only
            one, or of a cone.
        turn: (u,) from 0 to 3.
        shifts: (2u, v) x and y of the shift of each point, by the variables.
        held: (u, 2) coordinates that are their shifts alone: both of cones, one on sides of the boundary.
        sides: of the boundary.
        equations: (r, v) that make 0 of the variables.
        values: (v,) the variables of the layout as it is, up to rounding.
    """

    chains: SeamChains
    quarters: IntArray
    base: IntArray
    turn: IntArray
    shifts: csr_matrix
    held: BoolArray
    sides: Sides
    equations: IntArray
    values: FloatArray

    def places(self, points: ComplexArray, values: FloatArray) -> ComplexArray:
        """Return (u,) points with seams and cones as variables say; copies follow the ones that they are given by."""
        shift = self.shifts @ values
        loose = np.where(self.held[:, 0], 0, points.real) + 1j * np.where(self.held[:, 1], 0, points.imag)
        moved: ComplexArray = UNITS[self.turn] * loose[self.base] + (shift[0::2] + 1j * shift[1::2])
        return moved


def find_transitions(
    mesh: TriangleMesh, corners: IntArray, points: ComplexArray, cones: IntArray, sides: Sides
) -> Transitions:
    """Return the transitions of a layout.

    Args:
        mesh: the mesh.
        corners: (m, 3) the point at each triangle corner.
        points: (u,) of the plane.
        cones: vertices whose places are variables, corners of sides among them.
        sides: of the boundary, along the axes.

    Raises:
        SeamError: the sides of a seam are no rigid copies of each other.
        GridError: they are no quarter turns of each other.
    """
    chains = find_chains(mesh, corners, points, cones)
    angle = np.angle(chains.rotation) / (np.pi / 2)
    quarters = np.rint(angle).astype(np.int64)
    off = float(np.abs(angle - quarters).max(initial=0.0)) * np.pi / 2
    if off > QUARTER:
        raise GridError(
            f"seams turn by up to {off:.2g} rad beside quarter turns: flatten with quantise=pi/2 and correct_handles, "
            "and a mesh with several boundaries with boundary='straight'"
        )
    builder = _Builder(mesh, corners, points, cones, chains, quarters % 4, sides)
    return builder.transitions()


class _Builder:
    def __init__(
        self,
        mesh: TriangleMesh,
        corners: IntArray,
        points: ComplexArray,
        cones: IntArray,
        chains: SeamChains,
        quarters: IntArray,
        sides: Sides,
    ) -> None:
        self.sides = sides
        self.chains, self.quarters, self.points, self.cones = chains, quarters, points, cones
        self.vertex = point_vertices(mesh.faces, corners, len(points))
        self.base = np.arange(len(points))
        self.turn = np.zeros(len(points), dtype=np.int64)
        self.chain_count = len(quarters)
        self.first_side = 2 * (self.chain_count + len(cones))
        self.size = self.first_side + len(sides.axis)
        self.held = np.zeros((len(points), 2), dtype=bool)
        self.sides_at: dict[int, list[int]] = defaultdict(list)
        self.entries: list[tuple[IntArray, IntArray, IntArray]] = []
        self.equations: list[IntArray] = []
        self.corners = corners

    def transitions(self) -> Transitions:
        """Return the transitions."""
        chains, points = self.chains, self.points
        self.held[np.isin(self.vertex, self.cones)] = True
        on_side = self._add_sides()
        self._add_regular(on_side)
        self._add_nodes()
        self._fix_charts()
        row, column, value = (np.concatenate(parts) for parts in zip(*self.entries, strict=True))
        shifts = coo_matrix((value, (row, column)), shape=(2 * len(points), self.size)).tocsr()
        translation = np.zeros(self.chain_count, dtype=np.complex128)
        off = points[chains.right] - UNITS[self.quarters[chains.chain], None] * points[chains.left]
        np.add.at(translation, chains.chain, off.mean(axis=1))
        translation /= np.maximum(np.bincount(chains.chain, minlength=self.chain_count), 1)
        both = np.concatenate([translation, points[self.cone_points]])
        values = np.concatenate([np.stack([both.real, both.imag], axis=1).ravel(), self._side_values()])
        return Transitions(
            chains,
            self.quarters,
            self.base,
            self.turn,
            shifts,
            self.held,
            self.sides,
            np.array(self.equations, dtype=np.int64).reshape(len(self.equations), self.size),
            values,
        )

    def _side_values(self) -> FloatArray:
        """Return (l,) the mean of the coordinate that points of each side have in common."""
        at, side, count = self.points[self.sides.points], self.sides.side, len(self.sides.axis)
        common = np.where(self.sides.axis[side] == 0, at.real, at.imag)
        mean: FloatArray = np.bincount(side, common, count) / np.maximum(
            np.bincount(side, minlength=count), 1
        )
        return mean

    def _add_regular(self, on_side: IntArray) -> None:
        """Give the right points within chains by the left ones, of which some are (u,) on a side, else -1."""
        chains = self.chains
        inside = ~chains.is_node[chains.vertices]
        right, at = np.unique(chains.right[inside], return_index=True)
        left = chains.left[inside][at]
        chain = np.broadcast_to(chains.chain[:, None], chains.left.shape)[inside][at]
        self.base[right] = left
        self.turn[right] = self.quarters[chain]
        for axis in range(2):
            self.entries.append((2 * right + axis, 2 * chain + axis, np.ones(len(right), dtype=np.int64)))
        held = on_side[left] >= 0
        right, side = right[held], on_side[left[held]]
        factors = TURNS[self.quarters[chain[held]], :, self.sides.axis[side]]
        for axis in range(2):
            self.entries.append((2 * right + axis, self.first_side + side, factors[:, axis]))

    def _add_sides(self) -> IntArray:
        """Give a coordinate of points on sides by that of the side, and remember where seams end.

        Return (u,) the side of each such point, else -1.
        """
        chains = self.chains
        is_end = np.zeros(len(self.points), dtype=bool)
        for ends in (chains.left, chains.right):
            is_end[ends[chains.is_node[chains.vertices]]] = True
        points, side = self.sides.points, self.sides.side
        special = is_end[points] | self.held[points, 0]
        for point, one in zip(points[special].tolist(), side[special].tolist(), strict=True):
            self.sides_at[point].append(one)
        points, side = points[~special], side[~special]
        axis = self.sides.axis[side]
        self.held[points, axis] = True
        self.entries.append((2 * points + axis, self.first_side + side, np.ones(len(points), dtype=np.int64)))
        on_side = np.full(len(self.points), -1)
        on_side[points] = side
        return on_side

    def _add_nodes(self) -> None:
        """Give the copies of each node by one of them, and close the circle around it."""
        chains = self.chains
        relations: dict[int, set[tuple[int, int, int]]] = defaultdict(set)
        for k, end in np.argwhere(chains.is_node[chains.vertices]).tolist():
            triple = (int(chains.left[k, end]), int(chains.right[k, end]), int(chains.chain[k]))
            relations[int(chains.vertices[k, end])].add(triple)
        of_cone = {int(v): i for i, v in enumerate(self.cones)}
        first = first_points(self.vertex)
        self.cone_points = first[self.cones]
        start = first.copy()
        on_side = np.array(sorted(self.sides_at, reverse=True), dtype=np.int64)
        start[self.vertex[on_side]] = on_side
        start[self.cones] = self.cone_points
        for v in sorted(set(relations) | set(of_cone)):
            self._add_node(v, int(start[v]), sorted(relations.get(v, ())), of_cone.get(v))

    def _add_node(self, v: int, start: int, relations: list[tuple[int, int, int]], cone: int | None) -> None:
        shift = np.zeros((2, self.size), dtype=np.int64)
        if cone is not None:
            at = 2 * (self.chain_count + cone)
            shift[:, at : at + 2] = np.eye(2)
        elif start in self.sides_at:
            side = self.sides_at[start][0]
            axis = int(self.sides.axis[side])
            shift[axis, self.first_side + side] = 1
            self.held[start, axis] = True
        known = {start: (0, shift)}
        left_over = list(relations)
        while left_over:
            later = []
            for left, right, chain in left_over:
                quarter, across = int(self.quarters[chain]), np.zeros((2, self.size), dtype=np.int64)
                across[:, 2 * chain : 2 * chain + 2] = np.eye(2)
                if left in known:
                    turn, shift = known[left]
                    turn, shift = (turn + quarter) % 4, TURNS[quarter] @ shift + across
                    if right not in known:
                        known[right] = turn, shift
                        continue
                    self._close(v, known[right], (turn, shift), cone is not None)
                elif right in known:
                    turn, shift = known[right]
                    known[left] = (turn - quarter) % 4, TURNS[-quarter % 4] @ (shift - across)
                else:
                    later.append((left, right, chain))
            if len(later) == len(left_over):
                raise GridError(f"the seams at vertex {v} do not connect all its copies")
            left_over = later
        for point, (turn, shift) in known.items():
            if cone is None:
                self.base[point], self.turn[point] = start, turn
            self._close_sides(point, shift)
            row, column = np.nonzero(shift)
            self.entries.append((2 * point + row, column, shift[row, column]))

    def _close(self, v: int, one: tuple[int, IntArray], two: tuple[int, IntArray], is_cone: bool) -> None:
        if not is_cone and one[0] != two[0]:
            raise GridError(f"vertex {v} has an angle of {4 + one[0] - two[0]} quarter turns, but is no cone")
        self.equations.extend(row for row in two[1] - one[1] if row.any())

    def _close_sides(self, point: int, shift: IntArray) -> None:
        """Have a point where a seam or a side ends lie on its sides."""
        for side in self.sides_at.get(point, ()):
            row = shift[self.sides.axis[side]].copy()
            row[self.first_side + side] -= 1
            if row.any():
                self.equations.append(row)

    def _fix_charts(self) -> None:
        """Let charts not move by themselves: some seams between them stay, and a cone or side of each component."""
        chart, component = charts_of(self.corners, len(self.points), self.chains)
        for chain in joining_chains(self.chains, chart).tolist():
            self._fix(chain)
        coned, firsts = np.unique(component[chart[self.cone_points]], return_index=True)
        for cone in firsts.tolist():
            self._fix(self.chain_count + cone)
        straight, firsts = np.unique(component[chart[self.sides.points]], return_index=True)
        for side in self.sides.side[firsts[~np.isin(straight, coned)]].tolist():
            row = np.zeros(self.size, dtype=np.int64)
            row[self.first_side + side] = 1
            self.equations.append(row)

    def _fix(self, variable: int) -> None:
        for axis in range(2):
            row = np.zeros(self.size, dtype=np.int64)
            row[2 * variable + axis] = 1
            self.equations.append(row)


def charts_of(corners: IntArray, count: int, chains: SeamChains) -> tuple[IntArray, IntArray]:
    """Return (u,) the chart of each point and (charts,) the component of each chart."""
    charts, chart = label_faces(corners, count)
    of_point = np.zeros(count, dtype=np.int64)
    of_point[corners.ravel()] = chart.repeat(3)
    _, component = label_components(charts, of_point[chains.left[:, 0]], of_point[chains.right[:, 0]])
    return of_point, component


def joining_chains(chains: SeamChains, chart: IntArray) -> IntArray:
    """Return chains that join the charts of each component, and none too many; chart: (u,) that of each point."""
    joined = np.arange(int(chart.max(initial=-1)) + 1)
    kept = []
    _, firsts = np.unique(chains.chain, return_index=True)
    for chain, k in enumerate(firsts.tolist()):
        one, two = int(joined[chart[chains.left[k, 0]]]), int(joined[chart[chains.right[k, 0]]])
        if one != two:
            joined[joined == two] = one
            kept.append(chain)
    return np.array(kept, dtype=np.int64)


def first_points(vertex: IntArray) -> IntArray:
    """Return (n,) the first point of each vertex; vertex: (u,) that of each point."""
    first = np.zeros(int(vertex.max(initial=-1)) + 1, dtype=np.int64)
    first[vertex[::-1]] = np.arange(len(vertex))[::-1]
    return first
