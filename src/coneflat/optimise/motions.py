"""Motions of the points of a layout as functions of unknowns, such that seams stay rigid and constraints hold."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_matrix, eye, vstack

from ..base.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from ..errors import OptionError
from ..geometry.planar import as_complex
from ..mesh.charts import point_vertices
from ..mesh.connectivity import TriangleMesh
from .constraints import CheckedConstraints
from .elimination import RELATIVE_ROUNDING, solutions_of
from .seam_chains import SeamChains, constrained_chains

# Unit of the rounding gaps between the sides of seams. In this unit they are large enough not to be treated as zero.
CLOSING_UNIT = 2.0**-40


@dataclass(frozen=True, eq=False)
class Motions:
    """The shift of each point as a sum of real unknowns times complex coefficients.

    Attributes:
        count: the number of unknowns k, all real.
        start: (u + 1,) the start of the entries of each point.
        unknown, coefficient: the unknown of each entry, and the shift of the point per unit of it. Unknown k is not
            solved for: with the value 1 it moves the points to where the constraints hold.
        has_offset: whether constraints do not hold at the current points.
        builder: the builder of these motions, if seams have to be closed.
    """

    count: int
    start: IntArray
    unknown: IntArray
    coefficient: ComplexArray
    has_offset: bool = False
    builder: _Builder | None = None

    def closed(self, points: ComplexArray) -> ComplexArray:
        """Return (u,) moved points with the rounding gaps between the sides of seams closed.

        If a layout shrinks by a factor of a thousand, the relative size of rounding errors grows by the same factor.
        """
        builder = self.builder
        if builder is None or not len(builder.chains.edges):
            return points
        motions = builder.at(points).motions()
        step = np.zeros(motions.count + 1)
        step[-1] = CLOSING_UNIT
        return points + motions.shifts(step)

    def shifts(self, step: FloatArray) -> ComplexArray:
        """Return (u,) the complex shifts of the points for a step (k + 1,) of the unknowns and the offset."""
        size = len(self.start) - 1
        moved = self.coefficient * step[self.unknown]
        total = np.empty(size, dtype=np.complex128)
        total.real = np.bincount(self._point, moved.real, size)
        total.imag = np.bincount(self._point, moved.imag, size)
        return total

    @cached_property
    def _point(self) -> IntArray:
        """Return the point of each coefficient."""
        return np.arange(len(self.start) - 1).repeat(np.diff(self.start))


def find_motions(
    mesh: TriangleMesh,
    corners: IntArray,
    points: ComplexArray,
    is_free: BoolArray,
    constraints: CheckedConstraints,
) -> Motions:
    """Return the motions of points that preserve the rotation across every seam and satisfy constraints.

    An ordinary point has two unknowns, its shift. A vertex within a seam also has two; the shift of its second point is
    that of the first, rotated by the rotation of the seam, plus the change of the seam's translation. These changes
    and the shifts of the points where seams end satisfy a small linear system, whose solutions are spanned by further
    unknowns.

    Args:
        mesh: the mesh.
        corners: (m, 3) the point at each triangle corner.
        points: (u,) positions in the plane as complex numbers.
        is_free: (n,) True for vertices that may move; the translation of a seam that contains others is fixed.
        constraints: further constraints on points.

    Raises:
        SeamError: the sides of a seam are not rigid copies of each other.
        OptionError: the constraints contradict each other.
    """
    vertex = point_vertices(mesh.faces, corners, len(points))
    chains = constrained_chains(mesh, corners, points, vertex, constraints)
    return _Builder(points, vertex, is_free, chains, constraints).motions()


def _require_solved(residual: float, right: FloatArray) -> None:
    # The rotations of seams are exact up to rounding, and points are many units from their centres.
    if residual > 100 * RELATIVE_ROUNDING * max(1.0, float(np.abs(right).max())):
        raise OptionError(f"constraints contradict each other, or the seams, by about {residual:.2g}")


class _Builder:
    """The linear system of node shifts, translation changes and line shifts, and the motions of all points."""

    def __init__(
        self,
        points: ComplexArray,
        vertex: IntArray,
        is_free: BoolArray,
        chains: SeamChains,
        constraints: CheckedConstraints,
        is_closing: bool = False,
    ) -> None:
        self.points, self.vertex, self.chains, self.constraints = points, vertex, chains, constraints
        self.is_closing = is_closing
        self.free_vertices = is_free
        self.is_free = is_free[vertex]
        self.entries: list[tuple[IntArray, IntArray, ComplexArray]] = []
        on_seam = np.zeros(len(points), dtype=bool)
        on_seam[chains.left] = on_seam[chains.right] = True
        self.is_special = on_seam & chains.is_node[vertex]
        fixed = np.concatenate([constraints.pinned, constraints.on_line])
        if len(fixed):
            twice, times = np.unique(fixed, return_counts=True)
            self.is_special[twice[times > 1]] = True
        self.is_special &= self.is_free
        # Real variables of the linear system: two for each special point and each translation, one for each line.
        self.of_point = np.full(len(points), -1)
        special = np.flatnonzero(self.is_special)
        self.of_point[special] = 2 * np.arange(len(special))
        self.of_chain = np.full(len(chains.rotation), -1)
        loose = self._loose_chains()
        self.of_chain[loose] = 2 * (len(special) + np.arange(len(loose)))
        self.of_line = np.full(len(constraints.directions), -1)
        shifting = np.flatnonzero(np.isnan(constraints.offsets))
        self.of_line[shifting] = 2 * (len(special) + len(loose)) + np.arange(len(shifting))
        self.size = 2 * (len(special) + len(loose)) + len(shifting)
        self.translation = self._translations()
        c = constraints
        self.ties = [
            self._tie(side, shift)
            for side, shift in zip(c.tied.tolist(), as_complex(c.translations).tolist(), strict=True)
        ]

    def at(self, points: ComplexArray) -> _Builder:
        """Return the builder for moved points; its offset, in units of `CLOSING_UNIT`, closes all seams."""
        return _Builder(
            points, self.vertex, self.free_vertices, self.chains, self.constraints, is_closing=True
        )

    def _loose_chains(self) -> IntArray:
        """Return the chains whose translations may change."""
        chains = self.chains
        stays = ~self.is_free[chains.left] & ~chains.is_node[chains.vertices]
        return np.flatnonzero(np.bincount(chains.chain, stays.any(axis=1), len(chains.rotation)) == 0)

    def _translations(self) -> ComplexArray:
        """Return (c,) the mean translation of each chain from its rotated left side to its right side."""
        chains = self.chains
        off = (
            self.points[chains.right] - chains.rotation[chains.chain, None] * self.points[chains.left]
        ).mean(axis=1)
        total = np.zeros(len(chains.rotation), dtype=np.complex128)
        np.add.at(total, chains.chain, off)
        return total / np.bincount(chains.chain, minlength=len(total))

    def _gaps(self, left: IntArray, right: IntArray, chain: IntArray) -> ComplexArray:
        """Return the shifts of right points that close the gaps to the mapped left points, in units of `CLOSING_UNIT`.

        They are zero unless seams are closed.
        """
        if not self.is_closing:
            return np.zeros(len(left), dtype=np.complex128)
        turned: ComplexArray = self.chains.rotation[chain] * self.points[left]
        gaps: ComplexArray = turned + self.translation[chain] - self.points[right]
        return gaps / CLOSING_UNIT

    def motions(self) -> Motions:
        """Return the motions."""
        basis = self._solutions()
        self.count = basis.shape[1] - 1
        self._basis = basis
        special = np.flatnonzero(self.is_special)
        self._add(
            special, self.of_point[special], np.ones(len(special), dtype=np.complex128), is_complex=True
        )
        self._add_seams()
        self._add_ordinary()
        point, unknown, coefficient = (np.concatenate(parts) for parts in zip(*self.entries, strict=True))
        last = unknown < 0  # the offset, whose index is known only now
        unknown = np.where(last, self.count, unknown)
        order = np.argsort(point, kind="stable")
        start = np.searchsorted(point[order], np.arange(len(self.points) + 1))
        return Motions(
            self.count, start, unknown[order], coefficient[order], bool(np.any(coefficient[last] != 0)), self
        )

    def _add(self, points: IntArray, variables: IntArray, factors: ComplexArray, is_complex: bool) -> None:
        """Add shifts of points by variables of the linear system, each multiplied by a factor."""
        if not len(points):
            return
        rows = self._basis[variables]
        entries = (rows + 1j * self._basis[variables + 1] if is_complex else rows).tocoo()
        row, column, coefficient = entries.row, entries.col, entries.data * factors[entries.row]
        self.entries.append(
            (points[row], np.where(column == self._basis.shape[1] - 1, -1, column), coefficient)
        )

    def _add_offset(self, points: IntArray, shifts: ComplexArray) -> None:
        moved = shifts != 0
        self.entries.append((points[moved], np.full(int(moved.sum()), -1), shifts[moved]))

    def _add_seams(self) -> None:
        """Add the motions of vertices within seams, which move both points of a vertex."""
        chains = self.chains
        if not len(chains.edges):
            return
        inside = (~chains.is_node[chains.vertices]) & self.is_free[chains.left]
        left, at = np.unique(chains.left[inside], return_index=True)
        right = chains.right[inside][at]
        chain = np.broadcast_to(chains.chain[:, None], chains.left.shape)[inside][at]
        self.is_special[left] = self.is_special[right] = True
        turn = chains.rotation[chain]
        self._add_offset(right, self._gaps(left, right, chain))
        on_line = np.isin(left, self.constraints.on_line)
        self._add_on_lines(left[on_line], right[on_line], turn[on_line])
        left_free, right_free, turning = left[~on_line], right[~on_line], turn[~on_line]
        unknown = self.count + 2 * np.arange(len(left_free))
        self.count += 2 * len(left_free)
        for axis, direction in enumerate((1.0, 1j)):
            self.entries.append(
                (left_free, unknown + axis, np.full(len(left_free), direction, dtype=np.complex128))
            )
            self.entries.append((right_free, unknown + axis, direction * turning))
        moves = self.of_chain[chain] >= 0
        ones = np.ones(int(moves.sum()), dtype=np.complex128)
        self._add(right[moves], self.of_chain[chain[moves]], ones, is_complex=True)

    def _add_on_lines(self, left: IntArray, right: IntArray, turn: ComplexArray) -> None:
        """Add the motions of left points within seams along and with their lines, and of the matching right points."""
        if not len(left):
            return
        c = self.constraints
        order = np.argsort(c.on_line, kind="stable")
        at = order[np.searchsorted(c.on_line[order], left)]
        line = c.line[at]
        direction = as_complex(c.directions)[line]
        normal = 1j * direction
        off = normal * self._off_line(left, line)
        shifts = self.of_line[line] >= 0
        unknown = self.count + np.arange(len(left))
        self.count += len(left)
        unturned: ComplexArray = np.ones_like(turn)
        for points, factor in ((left, unturned), (right, turn)):
            self.entries.append((points, unknown, factor * direction))
            self._add_offset(points, factor * off)
            self._add(points[shifts], self.of_line[line[shifts]], (factor * normal)[shifts], is_complex=False)

    def _add_ordinary(self) -> None:
        """Add the motions of all other points: free, along a line, or to their prescribed positions."""
        c = self.constraints
        is_ordinary = self.is_free & ~self.is_special
        if len(c.pinned) or len(c.on_line):
            self._add_constrained(is_ordinary)
        free = np.flatnonzero(is_ordinary)
        for axis, step in enumerate((1.0, 1j)):
            directions = np.full(len(free), step, dtype=np.complex128)
            self.entries.append((free, self.count + 2 * np.arange(len(free)) + axis, directions))
        self.count += 2 * len(free)

    def _add_constrained(self, is_ordinary: BoolArray) -> None:
        """Add the motions of pinned points and points on lines that are in `rest` (u,), and remove them from it."""
        c = self.constraints
        pins = np.flatnonzero(is_ordinary[c.pinned])
        self._add_offset(c.pinned[pins], as_complex(c.places[pins]) - self.points[c.pinned[pins]])
        is_ordinary[c.pinned] = False
        on = np.flatnonzero(is_ordinary[c.on_line])
        points, line = c.on_line[on], c.line[on]
        direction = as_complex(c.directions)[line]
        self.entries.append((points, self.count + np.arange(len(points)), direction))
        self.count += len(points)
        normal = 1j * direction
        self._add_offset(points, normal * self._off_line(points, line))
        shifts = self.of_line[line] >= 0
        self._add(points[shifts], self.of_line[line[shifts]], normal[shifts], is_complex=False)
        is_ordinary[c.on_line] = False

    def _off_line(self, points: IntArray, line: IntArray) -> FloatArray:
        """Return (q,) the signed distance of each point to its line, positive to the left of its direction.

        A line that may move sideways passes through its first point.
        """
        c = self.constraints
        across = (np.conj(1j * as_complex(c.directions)[c.line]) * self.points[c.on_line]).real
        at = c.offsets.copy()
        lines, first = np.unique(c.line, return_index=True)
        loose = np.isnan(at[lines])
        at[lines[loose]] = across[first[loose]]
        return at[line] - (np.conj(1j * as_complex(c.directions)[line]) * self.points[points]).real

    def _solutions(self) -> csr_matrix:
        """Return (v, k + 1) a basis of the variables' values, and a particular solution in the last column."""
        rows, right = self._equations()
        if not len(right):
            return eye(self.size, self.size + 1, format="csr")
        basis, left = solutions_of(rows, right)
        if not self.is_closing:  # rounding gaps between fixed points may be inconsistent
            _require_solved(float(np.abs(left).max(initial=0.0)), right)
        return basis

    def _equations(self) -> tuple[csr_matrix, FloatArray]:
        """Return (r, v) the equations between the variables, and their right-hand sides (r,)."""
        ends, values = self._equations_of_ends()
        rows: list[FloatArray] = []
        right: list[float] = []
        c = self.constraints

        def add(terms: list[tuple[int, complex]], value: complex) -> None:
            """Add the equation "sum of factors times complex variables = value" as two real equations."""
            equations = np.zeros((2, self.size))
            for variable, factor in terms:
                equations[0, variable] += factor.real
                equations[0, variable + 1] -= factor.imag
                equations[1, variable] += factor.imag
                equations[1, variable + 1] += factor.real
            rows.extend(equations)
            right.extend([value.real, value.imag])

        for point, place in zip(c.pinned.tolist(), as_complex(c.places).tolist(), strict=True):
            if self.of_point[point] >= 0:
                add([(int(self.of_point[point]), 1.0 + 0.0j)], place - complex(self.points[point]))
        for chain, value in self.ties:
            add([(int(self.of_chain[chain]), 1.0 + 0.0j)], value)
        off = self._off_line(c.on_line, c.line) if len(c.on_line) else np.empty(0)
        for point, line, value in zip(c.on_line.tolist(), c.line.tolist(), off.tolist(), strict=True):
            if self.of_point[point] >= 0:
                row = np.zeros(self.size)
                normal = 1j * complex(*c.directions[line])
                row[self.of_point[point] : self.of_point[point] + 2] = normal.real, normal.imag
                if self.of_line[line] >= 0:
                    row[self.of_line[line]] = -1.0
                rows.append(row)
                right.append(value)
        if not rows:
            return ends, values
        return vstack([ends, csr_matrix(np.array(rows))], format="csr"), np.concatenate([values, right])

    def _equations_of_ends(self) -> tuple[csr_matrix, FloatArray]:
        """Return equations (2 q, v) and right-hand sides (2 q,): chains map left points at nodes to right ones."""
        chains = self.chains
        edge, end = np.nonzero(chains.is_node[chains.vertices])
        chain, left, right = chains.chain[edge], chains.left[edge, end], chains.right[edge, end]
        variables = np.stack([self.of_point[right], self.of_point[left], self.of_chain[chain]], axis=1)
        is_relevant = (variables >= 0).any(axis=1)
        variables, chain, left, right = (
            variables[is_relevant],
            chain[is_relevant],
            left[is_relevant],
            right[is_relevant],
        )
        factors = np.full(variables.shape, 1.0 + 0.0j)
        factors[:, 1], factors[:, 2] = -chains.rotation[chain], -1.0
        equation, which = np.nonzero(variables >= 0)
        variable, factor = variables[equation, which], factors[equation, which]
        entries = np.concatenate([factor.real, -factor.imag, factor.imag, factor.real])
        row = np.concatenate([2 * equation, 2 * equation, 2 * equation + 1, 2 * equation + 1])
        column = np.concatenate([variable, variable + 1, variable, variable + 1])
        is_relevant = entries != 0
        rows = csr_matrix(
            (entries[is_relevant], (row[is_relevant], column[is_relevant])), shape=(2 * len(chain), self.size)
        )
        gaps = self._gaps(left, right, chain)
        return rows, np.stack([gaps.real, gaps.imag], axis=1).ravel()

    def _tie(self, side: int, shift: complex) -> tuple[int, complex]:
        """Return a half-edge's chain, and the change of its translation that gives the half-edge the one in `shift`."""
        chains = self.chains
        at = np.argwhere(chains.halfedges == side)
        if not len(at):
            raise OptionError(f"tied half-edge {side} is on no seam")
        k, is_right = at[0].tolist()
        chain = int(chains.chain[k])
        if self.of_chain[chain] < 0:
            raise OptionError(f"tied half-edge {side} is on a seam with a fixed translation")
        turn = complex(chains.rotation[chain])
        translation = shift if is_right else -turn * shift
        return chain, translation - complex(self.translation[chain])
