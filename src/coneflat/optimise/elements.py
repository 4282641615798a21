"""Triangles as functions of unknowns: maps, largest steps, gradients and Hessians.

The map of a triangle from its target shape to its shape in the plane is z -> a z + b conj(z), with singular values
|a| + |b| and |a| - |b| and the determinant |a|^2 - |b|^2. Both a and b are linear in the positions of the corners, and
thus in the unknowns that move these.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.sparse import csc_matrix

from ..base.arrays import BoolArray, ComplexArray, FloatArray, IntArray, has_any
from ..base.jit import compiled
from ..geometry.planar import map_factors
from ..mesh.connectivity import label_components, sort_by_counting
from ..mesh.edge_kernels import sort_keys
from .energies import Energy
from .motions import Motions

# Fraction of diagonal entries that is added to them: parts without constraints are free to rotate and translate.
RELATIVE_RIDGE = 1e-10


@dataclass(frozen=True, eq=False)
class Maps:
    """Maps of triangles, or changes of them: a and b, (f,) each."""

    a: ComplexArray
    b: ComplexArray

    def plus(self, length: FloatArray, step: Maps) -> Maps:
        """Return the maps after a step, multiplied by (f,) step lengths."""
        return Maps(self.a + length * step.a, self.b + length * step.b)

    def singular_values(self) -> tuple[FloatArray, FloatArray]:
        """Return (f,), (f,) the larger and the smaller singular value; the latter is negative for flipped maps."""
        size_a, size_b = np.abs(self.a), np.abs(self.b)
        return size_a + size_b, size_a - size_b

    def largest_steps(self, step: Maps) -> FloatArray:
        """Return (f,) the step lengths at which the triangles have no area, infinite if there is none."""
        constant = np.abs(self.a) ** 2 - np.abs(self.b) ** 2
        linear = (np.conj(self.a) * step.a - np.conj(self.b) * step.b).real  # half of it
        square = np.abs(step.a) ** 2 - np.abs(step.b) ** 2
        inside = linear**2 - square * constant
        root = np.sqrt(np.maximum(inside, 0.0))
        # The smallest positive root of constant + 2 linear t + square t^2, without cancellation.
        below = np.where(linear < 0, root - linear, -(linear + root))
        with np.errstate(divide="ignore", invalid="ignore"):
            first, second = constant / below, below / square
        falling = np.where(linear < 0, first, np.where(square < 0, second, np.inf))
        falling[(inside < 0) | (falling <= 0) | np.isnan(falling)] = np.inf
        return falling


@dataclass(frozen=True, eq=False)
class Elements:
    """The triangles that unknowns move.

    The unknowns of an element are those of its corners in order; an unknown may occur twice.

    Attributes:
        faces: (f,) the triangles.
        corners: (f, 3) their points.
        weight: (f,) weight of each triangle's energy.
        a_of, b_of: (f, 3) the derivatives of a and b by the positions of the corners.
        start: (f + 1,) the start of the unknowns of each element in the following arrays.
        unknown: the unknowns; k for the offset.
        alpha, beta: the derivatives of a and b by each of them.
        unknowns: (k,) the indices of the unknowns among those of the motions.
    """

    faces: IntArray
    corners: IntArray
    weight: FloatArray
    a_of: ComplexArray
    b_of: ComplexArray
    start: IntArray
    unknown: IntArray
    alpha: ComplexArray
    beta: ComplexArray
    unknowns: IntArray

    @classmethod
    def of(
        cls, motions: Motions, corners: IntArray, rest_sides: ComplexArray, unit: float, weight: FloatArray
    ) -> Elements:
        """Return the triangles that the motions move, with the derivatives of their maps.

        Args:
            motions: the motions of points.
            corners: (m, 3) the points of all triangles.
            rest_sides: (m, 3) complex sides in the target shape; used only for triangles that move.
            unit: factor of these sides.
            weight: (m,) weights of the triangles.
        """
        matrix = motions.matrix
        faces = np.flatnonzero(has_any(np.diff(matrix.indptr) > 0, corners))
        corners = corners[faces]
        a_of, b_of = map_factors(unit * rest_sides[faces])
        points = corners.ravel()
        sizes = np.diff(matrix.indptr)[points]
        ends = np.cumsum(sizes)
        corner = np.arange(len(sizes)).repeat(sizes)
        at = matrix.indptr[points].repeat(sizes) + np.arange(int(sizes.sum())) - (ends - sizes).repeat(sizes)
        return cls(
            faces,
            corners,
            weight[faces],
            a_of,
            b_of,
            start=np.concatenate([[0], ends[2::3]]),
            unknown=matrix.indices[at].astype(np.int64),
            alpha=a_of.ravel()[corner] * matrix.data[at],
            beta=b_of.ravel()[corner] * matrix.data[at],
            unknowns=np.arange(motions.count),
        )

    def of_parts(self, chosen: BoolArray) -> Elements:
        """Return the elements of chosen parts (parts,), with renumbered parts and unknowns."""
        rows = chosen[self.part]
        is_chosen_unknown = chosen[self.unknown_part]
        unknowns = self.unknowns[is_chosen_unknown]
        number = np.append(np.cumsum(is_chosen_unknown) - 1, len(unknowns))
        sizes = np.diff(self.start)
        entries = rows.repeat(sizes)
        return Elements(
            self.faces[rows],
            self.corners[rows],
            self.weight[rows],
            self.a_of[rows],
            self.b_of[rows],
            start=np.concatenate([[0], np.cumsum(sizes[rows])]),
            unknown=number[self.unknown[entries]],
            alpha=self.alpha[entries],
            beta=self.beta[entries],
            unknowns=unknowns,
        )

    @property
    def count(self) -> int:
        """The number k of unknowns."""
        return len(self.unknowns)

    @cached_property
    def pattern(self) -> ElementPattern:
        """The entries of the Hessian."""
        return ElementPattern.of(self.start, self.unknown, self.count)

    @cached_property
    def _labels(self) -> tuple[int, IntArray]:
        """The number of parts, which are connected components of unknowns that share triangles; and (k,) these."""
        indices, indptr = self.pattern.matrix.indices, self.pattern.matrix.indptr
        columns = np.arange(self.count).repeat(np.diff(indptr))
        return label_components(self.count, indices.astype(np.int64), columns)

    @property
    def parts(self) -> int:
        """The number of parts: connected components of unknowns that share triangles."""
        return self._labels[0]

    @property
    def unknown_part(self) -> IntArray:
        """(k,) the part of each unknown."""
        return self._labels[1]

    @cached_property
    def part(self) -> IntArray:
        """(f,) the part of each triangle; any part for those that only the offset moves, as all parts share a step."""
        return np.append(self.unknown_part, 0)[self.unknown[self.start[:-1]]]

    def maps(self, points: ComplexArray) -> Maps:
        """Return the maps at given positions (u,) of all points."""
        places = points[self.corners]
        # Relative to a corner, to avoid cancellation far from the origin.
        places = places - places[:, :1]
        return Maps((self.a_of * places).sum(axis=1), (self.b_of * places).sum(axis=1))

    def change(self, step: FloatArray) -> Maps:
        """Return the change of the maps for a step of the unknowns, with the offset as the last entry (k + 1,)."""
        values = step[self.unknown]
        sums = [np.add.reduceat(factor * values, self.start[:-1]) for factor in (self.alpha, self.beta)]
        return Maps(sums[0], sums[1])

    def energies(self, energy: Energy, maps: Maps) -> FloatArray:
        """Return (f,) the energy of each triangle; infinite where it is flipped, unless the energy is regularised."""
        s1, s2 = maps.singular_values()
        is_positive = (s2 > 0) | energy.is_regularised
        values = np.full(len(s1), np.inf)
        values[is_positive] = energy.values(s1[is_positive], s2[is_positive]) * self.weight[is_positive]
        return values

    def part_energies(self, energy: Energy, maps: Maps) -> FloatArray:
        """Return (parts,) the energy of each part."""
        return self.sums(self.energies(energy, maps))

    def sums(self, values: FloatArray) -> FloatArray:
        """Return (parts,) the sum of the values (f,) of the triangles of each part."""
        return np.bincount(self.part, values, self.parts).astype(np.float64)

    def newton_system(
        self, energy: Energy, maps: Maps, offset: float
    ) -> tuple[FloatArray, FloatArray, csc_matrix]:
        """Return the gradient (k,), the contribution of an offset to it (k,), and the positive semidefinite Hessian.

        Args:
            energy: the energy.
            maps: the current maps.
            offset: the prescribed change of the last unknown, which is not solved for.
        """
        derivatives = polar_derivatives(energy, maps)
        gradient, pull = np.zeros(self.count + 1), np.zeros(self.count + 1)
        values = np.zeros(len(self.pattern.matrix.data))
        add_elements(
            self.start,
            self.unknown,
            self.pattern.squares,
            self.pattern.slots,
            self.alpha,
            self.beta,
            derivatives.unit_a,
            derivatives.unit_b,
            derivatives.slopes * self.weight[:, None],
            derivatives.bends * self.weight[:, None],
            gradient,
            pull,
            values,
        )
        values[self.pattern.diagonal] *= 1 + RELATIVE_RIDGE
        # One matrix for all steps, so that its pattern is analysed once.
        self.pattern.matrix.data = values
        return gradient[: self.count], offset * pull[: self.count], self.pattern.matrix


@dataclass(frozen=True, eq=False)
class ElementPattern:
    """The entries of the Hessian.

    Attributes:
        squares: (f + 1,) the start of the pairs of unknowns of each element.
        slots: the entry of each pair; -1 for pairs with the offset.
        matrix: (k, k) matrix with these entries.
        diagonal: (k,) the entries of its diagonal.
    """

    squares: IntArray
    slots: IntArray
    matrix: csc_matrix
    diagonal: IntArray

    @classmethod
    def of(cls, start: IntArray, unknown: IntArray, count: int) -> ElementPattern:
        """Return the entries for elements with `start` and `unknown` as of `Elements`, and a number of unknowns."""
        sizes = np.diff(start)
        squares = np.concatenate([[0], np.cumsum(sizes**2)])
        slots = np.full(squares[-1], -1)
        order = sort_by_counting(unknown, count + 1)
        first = np.searchsorted(unknown[order], np.arange(count + 2))
        owner = np.arange(len(sizes)).repeat(sizes)
        rows, starts = find_entries(start, unknown, owner, squares, first, order, slots)
        matrix = csc_matrix((np.zeros(len(rows)), rows, starts), shape=(count, count))
        diagonal = np.flatnonzero(matrix.indices == np.arange(count).repeat(np.diff(matrix.indptr)))
        return cls(squares, slots, matrix, diagonal)


class PolarDerivatives(NamedTuple):
    """Derivatives of energies by a and b in polar coordinates, with positive semidefinite second derivatives.

    Attributes:
        unit_a, unit_b: (f,) directions of a and b as unit complex numbers.
        slopes: (f, 2) derivatives by |a| and |b|.
        bends: (f, 5) second derivatives: by |a|, by |b|, mixed, and perpendicular to a and b.
    """

    unit_a: ComplexArray
    unit_b: ComplexArray
    slopes: FloatArray
    bends: FloatArray


def polar_derivatives(energy: Energy, maps: Maps) -> PolarDerivatives:
    """Return the derivatives of the energies of triangles by a and b.

    Notes:
        In the lengths A = |a| and B = |b|, and their directions, a triangle's Hessian decouples into a block of two by
        two for the lengths and one number each for the directions, psi_A / A and psi_B / B (in other coordinates:
        Smith, de Goes, Kim, "Analytic eigensystems for isotropic distortion energies", 2019). Each block is projected
        to a positive semidefinite one.
    """
    size_a, size_b = np.abs(maps.a), np.abs(maps.b)
    derivatives = energy.derivatives(size_a + size_b, size_a - size_b)
    by_a, by_b = derivatives.by_1 + derivatives.by_2, derivatives.by_1 - derivatives.by_2
    by_aa = derivatives.by_11 + 2 * derivatives.by_12 + derivatives.by_22
    by_bb = derivatives.by_11 - 2 * derivatives.by_12 + derivatives.by_22
    unit_a, turn_a = _polar(maps.a, size_a, size_b, by_a, by_aa)
    unit_b, turn_b = _polar(maps.b, size_b, size_a, by_b, by_bb)
    block = _semidefinite(by_aa, by_bb, derivatives.by_11 - derivatives.by_22)
    bends = np.stack([*block, np.maximum(turn_a, 0.0), np.maximum(turn_b, 0.0)], axis=1)
    return PolarDerivatives(unit_a, unit_b, np.stack([by_a, by_b], axis=1), bends)


def _semidefinite(
    first: FloatArray, last: FloatArray, cross: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return symmetric blocks of two by two, by diagonal and mixed entry (f,), with negative eigenvalues set to 0."""
    middle, half = (first + last) / 2, (first - last) / 2
    radius = np.hypot(half, cross)
    high, low = np.maximum(middle + radius, 0.0), np.maximum(middle - radius, 0.0)
    share = np.divide((high - low) / 2, radius, out=np.zeros_like(radius), where=radius > 0)
    mean = (high + low) / 2
    return mean + share * half, mean - share * half, share * cross


def _polar(
    values: ComplexArray, size: FloatArray, reference: FloatArray, slope: FloatArray, bend: FloatArray
) -> tuple[ComplexArray, FloatArray]:
    """Return (f,) the directions of complex numbers of a given size, and the derivatives by it divided by it.

    By symmetry the derivative `slope` vanishes with the size, so the limit of the quotient is the second derivative
    `bend`. Sizes that are tiny in comparison with `reference` count as 0.
    """
    is_zero = size <= 1e-9 * reference
    divisor = np.where(is_zero, 1.0, size)
    return np.where(is_zero, 1.0, values / divisor), np.where(is_zero, bend, slope / divisor)


@compiled
def find_entries(
    start: IntArray,
    unknown: IntArray,
    owner: IntArray,
    squares: IntArray,
    first: IntArray,
    order: IntArray,
    slots: IntArray,
) -> tuple[IntArray, IntArray]:
    """Return the rows of the entries of the Hessian by columns, and (k + 1,) the start of each column.

    Args:
        start, unknown, squares: see `add_elements`.
        owner: the element of each entry of `unknown`.
        first, order: (k + 2,) the start of each unknown in `order`, which sorts `unknown`; the last one is the offset.
        slots: the entry of each pair on return; pairs with the offset are left out.
    """
    count, end = len(first) - 2, 0
    rows, starts = np.empty(len(slots), dtype=np.int64), np.zeros(count + 1, dtype=np.int64)
    entry = np.empty(count, dtype=np.int64)
    for row in range(count):
        entry[row] = -1
    for column in range(count):
        for at in range(first[column], first[column + 1]):
            f = owner[order[at]]
            for i in range(start[f], start[f + 1]):
                row = unknown[i]
                if row < count and entry[row] < starts[column]:
                    entry[row], rows[end] = end, row
                    end += 1
        starts[column + 1] = end
        sort_keys(rows[starts[column] : end])
        for i in range(starts[column], end):
            entry[rows[i]] = i
        for at in range(first[column], first[column + 1]):
            place = order[at]
            f = owner[place]
            for i in range(start[f], start[f + 1]):
                if unknown[i] < count:
                    pair = squares[f] + (i - start[f]) * (start[f + 1] - start[f]) + place - start[f]
                    slots[pair] = entry[unknown[i]]
    return rows[:end], starts


@compiled
def add_elements(
    start: IntArray,
    unknown: IntArray,
    squares: IntArray,
    slots: IntArray,
    alpha: ComplexArray,
    beta: ComplexArray,
    unit_a: ComplexArray,
    unit_b: ComplexArray,
    slopes: FloatArray,
    bends: FloatArray,
    gradient: FloatArray,
    pull: FloatArray,
    values: FloatArray,
) -> None:
    """Add up the gradient and the Hessian.

    Args:
        start: (f + 1,) the start of the unknowns of each element.
        unknown, alpha, beta: the unknowns, and the derivatives of a and b by each of them.
        squares, slots: the start of the pairs of each element, and the entry of `values` for each pair.
        unit_a, unit_b: (f,) directions of a and b as unit complex numbers.
        slopes: (f, 2) derivatives by |a| and |b|.
        bends: (f, 5) second derivatives: by |a|, by |b|, mixed, and perpendicular to a and b.
        gradient: (k + 1,) added to.
        pull: (k + 1,) the column of the Hessian for the last unknown, added to.
        values: the entries of the Hessian, added to.
    """
    last = len(gradient) - 1
    for f in range(len(start) - 1):
        begin, size = start[f], start[f + 1] - start[f]
        for i in range(start[f], start[f + 1]):
            p_i, q_i = alpha[i] * unit_a[f].conjugate(), beta[i] * unit_b[f].conjugate()
            gradient[unknown[i]] += slopes[f, 0] * p_i.real + slopes[f, 1] * q_i.real
            for j in range(i, start[f + 1]):
                p_j, q_j = alpha[j] * unit_a[f].conjugate(), beta[j] * unit_b[f].conjugate()
                value = (
                    bends[f, 0] * p_i.real * p_j.real
                    + bends[f, 1] * q_i.real * q_j.real
                    + bends[f, 2] * (p_i.real * q_j.real + q_i.real * p_j.real)
                    + bends[f, 3] * p_i.imag * p_j.imag
                    + bends[f, 4] * q_i.imag * q_j.imag
                )
                for k in range(1 if i == j else 2):
                    row, column = (i, j) if k == 0 else (j, i)
                    slot = slots[squares[f] + (row - begin) * size + column - begin]
                    if slot >= 0:
                        values[slot] += value
                    elif unknown[column] == last:
                        pull[unknown[row]] += value
