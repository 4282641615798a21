"""Integer equations for seams whose two sides are related by quarter turns.

The motion of a seam maps a copy of a vertex in the plane to another copy, z_right = i^q z_left + t. The variables are
the translations t of the chains of seam edges and the positions of cones. Around each inner vertex, the composition of
the motions must have the vertex as a fixed point, which is a linear equation of these with coefficients 0, 1 and -1.
"""

from __future__ import annotations

from collections import defaultdict, deque
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from ..base import BoolArray, ComplexArray, FloatArray, IntArray, mask_of
from ..errors import GridError
from ..geometry import TURNS, UNITS, as_pairs, complex_sums
from ..optimise import SeamChains
from .grid_layout import GridLayout, charts_of, first_points, joining_chains
from .options import GRID_TOLERANCE


@dataclass(frozen=True, eq=False)
class Transitions:
    """The motions of a layout's seams, as functions of integer variables.

    The variables are x and y of the translation of each chain, x and y of one copy of each cone, and the common
    coordinate of the points of each side, on the boundary or on the left of a chain.

    Attributes:
        chains: the seams.
        quarters: (c,) quarter turns of each chain.
        base: (u,) the base point of each point, which is i^turn times the base plus its shift. A point is its own base
            if it is the only copy, or belongs to a cone.
        turn: (u,) from 0 to 3.
        shifts: (2u, v) matrix from the variables to x and y of the shift of each point.
        fixed: (u, 2) coordinates that are given by the shift alone: both for cones, one on sides of the boundary.
        equations: (r, v) coefficients of the equations, whose right-hand side is 0.
        values: (v,) the variables of the given layout, up to rounding.
    """

    chains: SeamChains
    quarters: IntArray
    base: IntArray
    turn: IntArray
    shifts: csr_matrix
    fixed: BoolArray
    equations: IntArray
    values: FloatArray

    def places(self, points: ComplexArray, values: FloatArray | IntArray) -> ComplexArray:
        """Return (u,) the points for given values of the variables; copies follow from their base points."""
        shift = self.shifts @ values
        loose = np.where(self.fixed[:, 0], 0, points.real) + 1j * np.where(self.fixed[:, 1], 0, points.imag)
        return UNITS[self.turn] * loose[self.base] + (shift[0::2] + 1j * shift[1::2])


def find_transitions(layout: GridLayout) -> Transitions:
    """Return the transitions of a layout.

    Raises:
        SeamError: the sides of a seam are not congruent.
        GridError: the sides of a seam are not related by quarter turns.
    """
    chains = layout.chains()
    angle = np.angle(chains.rotation) / (np.pi / 2)
    quarters = np.rint(angle).astype(np.int64)
    off = float(np.abs(angle - quarters).max(initial=0.0)) * np.pi / 2
    if off > GRID_TOLERANCE:
        raise GridError(
            f"rotations of seams are up to {off:.2g} rad from quarter turns: flatten with quantise=pi/2 and "
            "correct_handles, and a mesh with several boundaries with boundary='straight'"
        )
    return _Builder(layout, chains, quarters % 4).transitions()


class _Builder:
    def __init__(self, layout: GridLayout, chains: SeamChains, quarters: IntArray) -> None:
        count = len(layout.points)
        self.layout, self.points, self.sides = layout, layout.points, layout.sides
        self.chains, self.quarters, self.chain_count = chains, quarters, len(quarters)
        self.cones, self.vertex = layout.nodes, layout.vertex
        self.cone_points = first_points(self.vertex)[self.cones]
        self.first_side = 2 * (self.chain_count + len(self.cones))
        self.size = self.first_side + len(self.sides.axis)
        self.base, self.turn = np.arange(count), np.zeros(count, dtype=np.int64)
        self.fixed = np.isin(self.vertex, self.cones)[:, None].repeat(2, axis=1)
        self.sides_at: dict[int, list[int]] = defaultdict(list)
        self.entries: list[tuple[IntArray, IntArray, IntArray]] = []
        self.equations: list[IntArray] = []

    def transitions(self) -> Transitions:
        """Return the transitions."""
        chains, points = self.chains, self.points
        self._add_regular(self._add_sides())
        self._add_nodes()
        self._fix_charts()
        row, column, value = (np.concatenate(parts) for parts in zip(*self.entries, strict=True))
        shifts = coo_matrix((value, (row, column)), shape=(2 * len(points), self.size)).tocsr()
        off = points[chains.right] - UNITS[self.quarters[chains.chain], None] * points[chains.left]
        translation = complex_sums(chains.chain, off.mean(axis=1), self.chain_count)
        translation /= np.bincount(chains.chain)
        places = np.concatenate([translation, points[self.cone_points]])
        side = self.sides.side
        common = as_pairs(points[self.sides.points])[np.arange(len(side)), self.sides.axis[side]]
        means = np.bincount(side, common) / np.bincount(side)
        values = np.concatenate([as_pairs(places).ravel(), means])
        equations = np.array(self.equations, dtype=np.int64).reshape(len(self.equations), self.size)
        return Transitions(chains, self.quarters, self.base, self.turn, shifts, self.fixed, equations, values)

    def _add_regular(self, on_side: IntArray) -> None:
        """Express the right points inside chains by the left ones; `on_side` (u,) is the side of a point or -1."""
        chains = self.chains
        inside = ~chains.is_node[chains.vertices]
        right, at = np.unique(chains.right[inside], return_index=True)
        left = chains.left[inside][at]
        chain = np.broadcast_to(chains.chain[:, None], chains.left.shape)[inside][at]
        self.base[right] = left
        self.turn[right] = self.quarters[chain]
        for axis in range(2):
            self.entries.append((2 * right + axis, 2 * chain + axis, np.ones(len(right), dtype=np.int64)))
        fixed = on_side[left] >= 0
        right, side = right[fixed], on_side[left[fixed]]
        factors = TURNS[self.quarters[chain[fixed]], :, self.sides.axis[side]]
        for axis in range(2):
            self.entries.append((2 * right + axis, self.first_side + side, factors[:, axis]))

    def _add_sides(self) -> IntArray:
        """Express a coordinate of points on sides by the variable of the side; points at ends of seams follow later.

        Return (u,) the side of each such point, else -1.
        """
        chains = self.chains
        at_node = chains.is_node[chains.vertices]
        is_end = mask_of(len(self.points), np.stack([chains.left, chains.right])[:, at_node])
        points, side = self.sides.points, self.sides.side
        special = is_end[points] | self.fixed[points, 0]
        for point, side_number in zip(points[special].tolist(), side[special].tolist(), strict=True):
            self.sides_at[point].append(side_number)
        points, side = points[~special], side[~special]
        axis = self.sides.axis[side]
        self.fixed[points, axis] = True
        self.entries.append((2 * points + axis, self.first_side + side, np.ones(len(points), dtype=np.int64)))
        on_side = np.full(len(self.points), -1)
        on_side[points] = side
        return on_side

    def _add_nodes(self) -> None:
        """Express the copies of each node by one of them, and add the equations of the loop around it."""
        chains = self.chains
        relations: dict[int, set[tuple[int, int, int]]] = defaultdict(set)
        for k, end in np.argwhere(chains.is_node[chains.vertices]).tolist():
            triple = (int(chains.left[k, end]), int(chains.right[k, end]), int(chains.chain[k]))
            relations[int(chains.vertices[k, end])].add(triple)
        of_cone = {int(v): i for i, v in enumerate(self.cones)}
        start = first_points(self.vertex)
        on_side = np.array(sorted(self.sides_at, reverse=True), dtype=np.int64)
        start[self.vertex[on_side]] = on_side
        start[self.cones] = self.cone_points
        for v in sorted(set(relations) | set(of_cone)):
            self._add_node(v, int(start[v]), sorted(relations.get(v, ())), of_cone.get(v))

    def _add_node(self, v: int, start: int, relations: list[tuple[int, int, int]], cone: int | None) -> None:
        copies = self._copies_of_node(v, start, relations, cone)
        for point, (turn, shift) in copies.items():
            if cone is None:
                self.base[point], self.turn[point] = start, turn
            for side in self.sides_at.get(point, ()):  # the sides that contain the point
                equation = shift[self.sides.axis[side]].copy()
                equation[self.first_side + side] -= 1
                self.equations.extend([equation] if equation.any() else [])
            row, column = np.nonzero(shift)
            self.entries.append((2 * point + row, column, shift[row, column]))

    def _base_shift(self, start: int, cone: int | None) -> IntArray:
        """Return (2, v) the coefficients of the base point of a node: variables of its cone, or of its side."""
        shift = np.zeros((2, self.size), dtype=np.int64)
        if cone is not None:
            at = 2 * (self.chain_count + cone)
            shift[:, at : at + 2] = np.eye(2)
        elif start in self.sides_at:
            side = self.sides_at[start][0]
            axis = int(self.sides.axis[side])
            shift[axis, self.first_side + side] = 1
            self.fixed[start, axis] = True
        return shift

    def _copies_of_node(
        self, v: int, start: int, relations: list[tuple[int, int, int]], cone: int | None
    ) -> dict[int, tuple[int, IntArray]]:
        """Return the quarter turns and the shift (2, v) of each copy of a node, and add the equations of its loop.

        Args:
            v: the node.
            start: its base point.
            relations: left point, right point and chain of each seam at the node.
            cone: its number among the cones, or None.

        Raises:
            GridError: the loop is not closed, or the node must be a cone.
        """
        copies = {start: (0, self._base_shift(start, cone))}
        left_over, waiting = deque(relations), 0
        while left_over:
            left, right, chain = left_over.popleft()
            quarter, across = int(self.quarters[chain]), np.zeros((2, self.size), dtype=np.int64)
            across[:, 2 * chain : 2 * chain + 2] = np.eye(2)
            if left in copies:
                turn, shift = copies[left]
                turn, shift = (turn + quarter) % 4, TURNS[quarter] @ shift + across
                if right not in copies:
                    copies[right] = turn, shift
                    continue
                if cone is None and copies[right][0] != turn:
                    raise GridError(
                        f"vertex {v} has an angle of {4 + copies[right][0] - turn} quarter turns but is not a cone"
                    )
                self.equations.extend(row for row in shift - copies[right][1] if row.any())
            elif right in copies:
                turn, shift = copies[right]
                copies[left] = (turn - quarter) % 4, TURNS[-quarter % 4] @ (shift - across)
            else:
                left_over.append((left, right, chain))  # until one of both is in `copies`
                waiting += 1
                if waiting > len(relations) ** 2:
                    raise GridError(f"the seams at vertex {v} do not connect all its copies")
        return copies

    def _fix_charts(self) -> None:
        """Fix the free motions of charts: some seams between them, and a cone or side of each component."""
        chart, component = charts_of(self.layout, self.chains)
        coned, firsts = np.unique(component[self.cone_points], return_index=True)
        fixed = np.concatenate([joining_chains(self.chains, chart), self.chain_count + firsts])
        straight, firsts = np.unique(component[self.sides.points], return_index=True)
        sides = self.sides.side[firsts[~np.isin(straight, coned)]]
        columns = np.concatenate([(2 * fixed[:, None] + [0, 1]).ravel(), self.first_side + sides])
        rows = np.zeros((len(columns), self.size), dtype=np.int64)
        rows[np.arange(len(columns)), columns] = 1
        self.equations.extend(rows)
