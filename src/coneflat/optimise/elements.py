"""Triangles as functions of unknowns: maps, largest steps, gradients and Hessians.

The map of a triangle from its target shape to its shape in the plane is z -> a z + b conj(z), with singular values
|a| + |b| and |a| - |b| and the determinant |a|^2 - |b|^2. Both a and b are linear in the positions of the corners, and
thus in the unknowns that move these.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_matrix

from ..base.arrays import BoolArray, ComplexArray, FloatArray, IntArray, has_any
from ..base.jit import compiled
from ..geometry.planar import map_factors
from ..mesh.connectivity import label_components, sort_by_counting, sort_keys
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


class Elements:
    """The triangles that unknowns move.

    Attributes:
        faces: (f,) the triangles.
        count: the number of unknowns k.
        unknowns: (k,) their indices among those of the motions.
        parts: number of parts, which are connected components of unknowns that share triangles.
        part, unknown_part: (f,), (k,) the part of each triangle and of each unknown.
        weight: (f,) weight of each triangle's energy.
    """

    def __init__(
        self, motions: Motions, corners: IntArray, rest_sides: ComplexArray, unit: float, weight: FloatArray
    ) -> None:
        """Find the triangles that the motions move, and the derivatives of their maps.

        Args:
            motions: the motions of points.
            corners: (m, 3) the points of all triangles.
            rest_sides: (m, 3) complex sides in the target shape; used only for triangles that move.
            unit: factor of these sides.
            weight: (m,) weights of the triangles.
        """
        matrix = motions.matrix
        moves = np.diff(matrix.indptr) > 0
        self.faces = np.flatnonzero(has_any(moves, corners))
        self.count, self.weight = motions.count, weight[self.faces]
        self.unknowns = np.arange(self.count)
        corners = corners[self.faces]
        self._corners = corners
        self._a_of, self._b_of = map_factors(unit * rest_sides[self.faces])
        # The unknowns of an element are those of its corners in order; an unknown may occur twice.
        sizes = np.diff(matrix.indptr)[corners.ravel()]
        ends = np.cumsum(sizes)
        self._start = np.concatenate([[0], ends[2::3]])
        entry = np.arange(len(sizes)).repeat(sizes)
        at = (
            matrix.indptr[corners.ravel()].repeat(sizes)
            + np.arange(int(sizes.sum()))
            - (ends - sizes).repeat(sizes)
        )
        self._unknown = matrix.indices[at].astype(np.int64)
        self._alpha = self._a_of.ravel()[entry] * matrix.data[at]
        self._beta = self._b_of.ravel()[entry] * matrix.data[at]
        self._find_pattern()

    def of_parts(self, chosen: BoolArray) -> Elements:
        """Return the elements of chosen parts (parts,), with renumbered parts and unknowns."""
        is_chosen, is_chosen_unknown = chosen[self.part], chosen[self.unknown_part]
        unknowns = np.flatnonzero(is_chosen_unknown)
        number = np.append(np.cumsum(is_chosen_unknown) - 1, len(unknowns))
        restricted, sizes = copy(self), np.diff(self._start)
        entries = is_chosen.repeat(sizes)
        restricted.faces, restricted.weight, restricted.count = (
            self.faces[is_chosen],
            self.weight[is_chosen],
            len(unknowns),
        )
        restricted._corners, restricted._a_of, restricted._b_of = (
            self._corners[is_chosen],
            self._a_of[is_chosen],
            self._b_of[is_chosen],
        )
        restricted._start = np.concatenate([[0], np.cumsum(sizes[is_chosen])])
        restricted._unknown = number[self._unknown[entries]]
        restricted._alpha, restricted._beta = self._alpha[entries], self._beta[entries]
        restricted.unknowns = self.unknowns[unknowns]
        restricted._find_pattern()
        return restricted

    def _find_pattern(self) -> None:
        k, sizes = self.count, np.diff(self._start)
        self._squares = np.concatenate([[0], np.cumsum(sizes**2)])
        self._slots = np.full(self._squares[-1], -1)
        order = sort_by_counting(self._unknown, k + 1)
        first = np.searchsorted(self._unknown[order], np.arange(k + 2))
        owner = np.arange(len(sizes)).repeat(sizes)
        rows, starts = find_entries(
            self._start, self._unknown, owner, self._squares, first, order, self._slots
        )
        # One matrix for all steps, so that its pattern is analysed once.
        self._matrix = csc_matrix((np.zeros(len(rows)), rows, starts), shape=(k, k))
        self._indices, self._indptr = self._matrix.indices, self._matrix.indptr
        self._diagonal = np.flatnonzero(self._indices == np.arange(k).repeat(np.diff(self._indptr)))
        self.parts, self.unknown_part = label_components(
            k, self._indices.astype(np.int64), np.arange(k).repeat(np.diff(self._indptr))
        )
        first = self._unknown[self._start[:-1]]
        self.part = np.append(self.unknown_part, 0)[first]  # any part for the offset: all share a step

    def maps(self, points: ComplexArray) -> Maps:
        """Return the maps at given positions (u,) of all points."""
        places = points[self._corners]
        # Relative to a corner, to avoid cancellation far from the origin.
        places = places - places[:, :1]
        return Maps((self._a_of * places).sum(axis=1), (self._b_of * places).sum(axis=1))

    def change(self, step: FloatArray) -> Maps:
        """Return the change of the maps for a step of the unknowns, with the offset as the last entry (k + 1,)."""
        values = step[self._unknown]
        sums = [np.add.reduceat(factor * values, self._start[:-1]) for factor in (self._alpha, self._beta)]
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

        Notes:
            In the lengths A = |a| and B = |b|, and their directions, a triangle's Hessian decouples into a block of
            two by two for the lengths and one number each for the directions, psi_A / A and psi_B / B (in other
            coordinates: Smith, de Goes, Kim, "Analytic eigensystems for isotropic distortion energies", 2019). Each
            block is projected to a positive semidefinite one.
        """
        size_a, size_b = np.abs(maps.a), np.abs(maps.b)
        derivatives = energy.derivatives(size_a + size_b, size_a - size_b)
        by_a, by_b = derivatives.by_1 + derivatives.by_2, derivatives.by_1 - derivatives.by_2
        first = derivatives.by_11 + 2 * derivatives.by_12 + derivatives.by_22
        last = derivatives.by_11 - 2 * derivatives.by_12 + derivatives.by_22
        cross = derivatives.by_11 - derivatives.by_22
        unit_a, turn_a = _polar(maps.a, size_a, size_b, by_a, first)
        unit_b, turn_b = _polar(maps.b, size_b, size_a, by_b, last)
        middle, half = (first + last) / 2, (first - last) / 2
        radius = np.hypot(half, cross)
        high, low = np.maximum(middle + radius, 0.0), np.maximum(middle - radius, 0.0)
        share = np.divide((high - low) / 2, radius, out=np.zeros_like(radius), where=radius > 0)
        bends = (
            np.stack(
                [
                    (high + low) / 2 + share * half,
                    (high + low) / 2 - share * half,
                    share * cross,
                    np.maximum(turn_a, 0.0),
                    np.maximum(turn_b, 0.0),
                ],
                axis=1,
            )
            * self.weight[:, None]
        )
        slopes = np.stack([by_a, by_b], axis=1) * self.weight[:, None]
        gradient, pull = np.zeros(self.count + 1), np.zeros(self.count + 1)
        values = np.zeros(len(self._indices))
        add_elements(
            self._start,
            self._unknown,
            self._squares,
            self._slots,
            self._alpha,
            self._beta,
            unit_a,
            unit_b,
            slopes,
            bends,
            gradient,
            pull,
            values,
        )
        values[self._diagonal] *= 1 + RELATIVE_RIDGE
        self._matrix.data = values
        return gradient[: self.count], offset * pull[: self.count], self._matrix


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
