"""Integer equations for seams whose two sides are related by quarter turns.

The motion of a seam maps a copy of a vertex in the plane to another copy, z_right = i^q z_left + t. The variables are
the translations t of the chains of seam edges and the positions of cones. Around each inner vertex, the composition of
the motions must have the vertex as a fixed point, which is a linear equation of these with coefficients 0, 1 and -1.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from ..base import BoolArray, ComplexArray, FloatArray, IntArray, mask_of
from ..errors import GridError
from ..geometry import TURNS, UNITS, as_pairs, complex_sums
from ..optimise import SeamChains
from .grid_layout import GridLayout, Sides, charts_of, first_points, joining_chains
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

    Every point is expressed by a base point and the variables: points on sides, points inside of chains, and the copies
    of each node. Loops around nodes that do not close yield the equations, and so do the motions of charts, which are
    free until they are fixed.

    Raises:
        SeamError: the sides of a seam are not congruent.
        GridError: the sides of a seam are not related by quarter turns.

    Notes:
        With the equations, the layouts of a grid are the integer points of a linear space (Bommer et al. 2009,
        "Mixed-integer quadrangulation").
    """
    chains = layout.chains()
    quarters = _quarter_turns(chains)
    columns = _Columns(len(quarters), len(layout.nodes), len(layout.sides.axis))
    vertex = layout.vertex
    on_sides = _points_on_sides(layout, chains, vertex)
    loops = [
        _loop_around(node, quarters, columns, layout.sides)
        for node in _find_nodes(layout, chains, vertex, on_sides)
    ]
    expressions = [
        _along_sides(layout, on_sides, columns),
        _inside_chains(layout, chains, quarters, on_sides, columns),
        *(loop.copies for loop in loops),
    ]
    equations = [row for loop in loops for row in loop.equations]
    equations += [columns.row(column) for column in _free_motions(layout, chains, vertex, columns)]
    base, turn = np.arange(len(vertex)), np.zeros(len(vertex), dtype=np.int64)
    fixed = np.isin(vertex, layout.nodes)[:, None].repeat(2, axis=1)
    for expression in expressions:
        base[expression.points], turn[expression.points] = expression.base, expression.turn
        fixed[expression.points[expression.fixed_rows], expression.fixed_axes] = True
    row, column, coefficient = (
        np.concatenate(parts) for parts in zip(*(part.entries for part in expressions), strict=True)
    )
    return Transitions(
        chains=chains,
        quarters=quarters,
        base=base,
        turn=turn,
        shifts=coo_matrix((coefficient, (row, column)), shape=(2 * len(vertex), columns.total)).tocsr(),
        fixed=fixed,
        equations=np.array(equations, dtype=np.int64).reshape(len(equations), columns.total),
        values=_present_values(layout, chains, quarters, vertex),
    )


def _quarter_turns(chains: SeamChains) -> IntArray:
    """Return (c,) the quarter turns of each chain, 0 to 3.

    Raises:
        GridError: the sides of a seam are not related by quarter turns.
    """
    angle = np.angle(chains.rotation) / (np.pi / 2)
    quarters = np.rint(angle).astype(np.int64)
    off = float(np.abs(angle - quarters).max(initial=0.0)) * np.pi / 2
    if off > GRID_TOLERANCE:
        raise GridError(
            f"rotations of seams are up to {off:.2g} rad from quarter turns: flatten with quantise=pi/2 and "
            "correct_handles, and a mesh with several boundaries with boundary='straight'"
        )
    return quarters % 4


class _Columns(NamedTuple):
    """The numbers of the variables: x and y of chains, x and y of nodes, then the coordinates of sides."""

    chains: int
    nodes: int
    sides: int

    @property
    def first_side(self) -> int:
        return 2 * (self.chains + self.nodes)

    @property
    def total(self) -> int:
        return self.first_side + self.sides

    def translation(self, chain: int) -> IntArray:
        """Return (2, v) the translation of a chain."""
        return self._pair(chain)

    def place(self, node: int) -> IntArray:
        """Return (2, v) the position of a node."""
        return self._pair(self.chains + node)

    def row(self, column: int) -> IntArray:
        """Return (v,) the coefficients of a single variable."""
        row = np.zeros(self.total, dtype=np.int64)
        row[column] = 1
        return row

    def _pair(self, number: int) -> IntArray:
        return np.stack([self.row(2 * number), self.row(2 * number + 1)])


class _Expression(NamedTuple):
    """Some points as functions of the variables: i^turn times a base point, plus a shift.

    Attributes:
        points: (k,) the points.
        base, turn: (k,) their base points, and quarter turns from 0 to 3.
        entries: row, column and coefficient of the entries of `Transitions.shifts`.
        fixed_rows, fixed_axes: indices into `points`, and axes, of the coordinates that are given by the shift alone.
    """

    points: IntArray
    base: IntArray
    turn: IntArray
    entries: tuple[IntArray, IntArray, IntArray]
    fixed_rows: IntArray
    fixed_axes: IntArray


class _OnSides(NamedTuple):
    """The points on straight sides.

    Attributes:
        points, side: the points that are not copies of nodes, and the side of each.
        at_nodes: the sides of each of the others.
    """

    points: IntArray
    side: IntArray
    at_nodes: dict[int, list[int]]


def _points_on_sides(layout: GridLayout, chains: SeamChains, vertex: IntArray) -> _OnSides:
    """Return the points on sides, of a layout whose points have these vertices (u,)."""
    points, side = layout.sides.points, layout.sides.side
    at_node = chains.is_node[chains.vertices]
    is_end = mask_of(len(vertex), np.stack([chains.left, chains.right])[:, at_node])
    is_copy = is_end[points] | np.isin(vertex[points], layout.nodes)
    at_nodes: dict[int, list[int]] = defaultdict(list)
    for point, side_number in zip(points[is_copy].tolist(), side[is_copy].tolist(), strict=True):
        at_nodes[point].append(side_number)
    return _OnSides(points[~is_copy], side[~is_copy], dict(at_nodes))


def _along_sides(layout: GridLayout, on_sides: _OnSides, columns: _Columns) -> _Expression:
    """Express a coordinate of points on sides by the variable of the side."""
    points, side = on_sides.points, on_sides.side
    axis = layout.sides.axis[side]
    entries = 2 * points + axis, columns.first_side + side, np.ones(len(points), dtype=np.int64)
    return _Expression(points, points, np.zeros_like(points), entries, np.arange(len(points)), axis)


def _inside_chains(
    layout: GridLayout, chains: SeamChains, quarters: IntArray, on_sides: _OnSides, columns: _Columns
) -> _Expression:
    """Express the right points inside chains by the left ones and the translation of the chain."""
    inside = ~chains.is_node[chains.vertices]
    right, at = np.unique(chains.right[inside], return_index=True)
    left = chains.left[inside][at]
    chain = np.broadcast_to(chains.chain[:, None], chains.left.shape)[inside][at]
    entries = [(2 * right + axis, 2 * chain + axis, np.ones(len(right), dtype=np.int64)) for axis in range(2)]
    # A left point on a side is given by the side's variable, which the chain rotates.
    side_of = np.full(len(layout.points), -1)
    side_of[on_sides.points] = on_sides.side
    is_sided = side_of[left] >= 0
    sided, side = right[is_sided], side_of[left[is_sided]]
    factors = TURNS[quarters[chain[is_sided]], :, layout.sides.axis[side]]
    entries += [(2 * sided + axis, columns.first_side + side, factors[:, axis]) for axis in range(2)]
    row, column, coefficient = (np.concatenate(parts) for parts in zip(*entries, strict=True))
    no_index = np.empty(0, dtype=np.int64)
    return _Expression(right, left, quarters[chain], (row, column, coefficient), no_index, no_index)


class _Node(NamedTuple):
    """A vertex at which chains end, or that is a cone.

    Attributes:
        vertex: the vertex.
        start: its base point.
        number: its number among the nodes of the layout, or None.
        seams: left point, right point and chain of each seam edge at the vertex.
        sides: the sides of each of its copies that are on sides.
    """

    vertex: int
    start: int
    number: int | None
    seams: list[tuple[int, int, int]]
    sides: dict[int, list[int]]


def _find_nodes(
    layout: GridLayout, chains: SeamChains, vertex: IntArray, on_sides: _OnSides
) -> Iterable[_Node]:
    """Yield the nodes of a layout, whose points have these vertices (u,)."""
    seams: dict[int, set[tuple[int, int, int]]] = defaultdict(set)
    for k, end in np.argwhere(chains.is_node[chains.vertices]).tolist():
        triple = (int(chains.left[k, end]), int(chains.right[k, end]), int(chains.chain[k]))
        seams[int(chains.vertices[k, end])].add(triple)
    numbers = {int(node): i for i, node in enumerate(layout.nodes)}
    start = first_points(vertex)
    # Other vertices start on a side, where they have a copy on one.
    sided = np.array(sorted(on_sides.at_nodes, reverse=True), dtype=np.int64)
    sided = sided[~np.isin(vertex[sided], layout.nodes)]
    start[vertex[sided]] = sided
    for v in sorted(seams.keys() | numbers.keys()):
        yield _Node(v, int(start[v]), numbers.get(v), sorted(seams.get(v, ())), on_sides.at_nodes)


class _Loop(NamedTuple):
    """The copies of a node, and (v,) the equations that close the loop around it and keep copies on their sides."""

    copies: _Expression
    equations: list[IntArray]


def _loop_around(node: _Node, quarters: IntArray, columns: _Columns, sides: Sides) -> _Loop:
    """Return the copies of a node as functions of its base point.

    Raises:
        GridError: the loop around the node is not closed, or the node must be a cone.
    """
    start_sides = node.sides.get(node.start, []) if node.number is None else []
    shift = (
        np.zeros((2, columns.total), dtype=np.int64) if node.number is None else columns.place(node.number)
    )
    start_axes = sides.axis[start_sides[:1]]
    for side, axis in zip(start_sides[:1], start_axes, strict=True):
        shift[axis, columns.first_side + side] = 1
    copies, equations = _copies_of(node, shift, quarters, columns)
    for point, (_, shift) in copies.items():
        for side in node.sides.get(point, ()):
            equation = shift[sides.axis[side]] - columns.row(columns.first_side + side)
            equations += [equation] if equation.any() else []
    points = np.array(list(copies), dtype=np.int64)
    turns = np.array([turn for turn, _ in copies.values()], dtype=np.int64)
    row, column = np.nonzero(shifts := np.concatenate([shift for _, shift in copies.values()]))
    entries = (2 * points.repeat(2) + np.tile([0, 1], len(points)))[row], column, shifts[row, column]
    is_fixed = node.number is not None
    base, turn = (points, 0 * turns) if is_fixed else (np.full_like(points, node.start), turns)
    return _Loop(_Expression(points, base, turn, entries, np.zeros_like(start_axes), start_axes), equations)


def _copies_of(
    node: _Node, start_shift: IntArray, quarters: IntArray, columns: _Columns
) -> tuple[dict[int, tuple[int, IntArray]], list[IntArray]]:
    """Return the quarter turns and the shift (2, v) of each copy of a node, and the equations of the loop around it.

    A seam of which one side is expressed yields the other side; one with both sides expressed yields equations.

    Args:
        node: the node.
        start_shift: (2, v) the shift of its base point.
        quarters: (c,) quarter turns of each chain.
        columns: the variables.

    Raises:
        GridError: the loop is not closed, or the node must be a cone.
    """
    copies, equations = {node.start: (0, start_shift)}, list[IntArray]()
    left_over, waiting = deque(node.seams), 0
    while left_over:
        left, right, chain = left_over.popleft()
        quarter, across = int(quarters[chain]), columns.translation(chain)
        if left in copies:
            turn, shift = copies[left]
            turn, shift = (turn + quarter) % 4, TURNS[quarter] @ shift + across
            if right not in copies:
                copies[right] = turn, shift
                continue
            if node.number is None and copies[right][0] != turn:
                raise GridError(
                    f"vertex {node.vertex} has an angle of {4 + copies[right][0] - turn} quarter turns but is not a "
                    "cone"
                )
            equations += [row for row in shift - copies[right][1] if row.any()]
        elif right in copies:
            turn, shift = copies[right]
            copies[left] = (turn - quarter) % 4, TURNS[-quarter % 4] @ (shift - across)
        else:
            left_over.append((left, right, chain))  # until one of both is in `copies`
            waiting += 1
            if waiting > len(node.seams) ** 2:
                raise GridError(f"the seams at vertex {node.vertex} do not connect all its copies")
    return copies, equations


def _free_motions(layout: GridLayout, chains: SeamChains, vertex: IntArray, columns: _Columns) -> list[int]:
    """Return the variables that are 0 to fix the free motions of charts.

    They are the translations of some seams between charts, and the position of a node or a side of each component.
    """
    chart, component = charts_of(layout, chains)
    node_points = first_points(vertex)[layout.nodes]
    noded, first_nodes = np.unique(component[node_points], return_index=True)
    pairs = np.concatenate([joining_chains(chains, chart), columns.chains + first_nodes])
    straight, first_sides = np.unique(component[layout.sides.points], return_index=True)
    sides = layout.sides.side[first_sides[~np.isin(straight, noded)]]
    return [*(2 * pairs[:, None] + [0, 1]).ravel().tolist(), *(columns.first_side + sides).tolist()]


def _present_values(
    layout: GridLayout, chains: SeamChains, quarters: IntArray, vertex: IntArray
) -> FloatArray:
    """Return (v,) the variables of a layout, up to rounding: means over the points that they refer to."""
    points, sides = layout.points, layout.sides
    off = points[chains.right] - UNITS[quarters[chains.chain], None] * points[chains.left]
    translation = complex_sums(chains.chain, off.mean(axis=1), len(quarters)) / np.bincount(chains.chain)
    places = np.concatenate([translation, points[first_points(vertex)[layout.nodes]]])
    common = as_pairs(points[sides.points])[np.arange(len(sides.side)), sides.axis[sides.side]]
    return np.concatenate(
        [as_pairs(places).ravel(), np.bincount(sides.side, common) / np.bincount(sides.side)]
    )
