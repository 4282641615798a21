"""Integer linear algebra: solution of integer equations, and the lattice points nearest to a given point."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.linalg
from scipy.sparse import csr_matrix

from ..base import BoolArray, FloatArray, IntArray, compiled
from ..errors import GridError

# Largest number of visited nodes of the search tree.
MAX_VISITS = 20_000


class IntegerSolutions(NamedTuple):
    """All integer solutions of linear equations: one solution (n,), and a basis (n, d) of the homogeneous solutions.

    Column k of the basis belongs to the k-th of the variables that are free, (n,) True.
    """

    solution: IntArray
    basis: IntArray
    is_free: BoolArray


def integer_solutions(rows: IntArray, right: IntArray) -> IntegerSolutions | None:
    """Return all integer vectors x with rows x = right; None if there are none.

    Args:
        rows: (r, n) coefficients; rows may be linearly dependent.
        right: (r,) right-hand side.

    Notes:
        Unimodular column operations bring the rows to echelon form (the Hermite normal form; Cohen, "A course in
        computational algebraic number theory", 1993, Section 2.4). Pivots are the smallest entries, and among these
        the ones in the sparsest columns, so that entries stay small.
    """
    columns = np.concatenate([rows.T.astype(np.int64), np.eye(rows.shape[1], dtype=np.int64)], axis=1)
    rows, solution = np.ascontiguousarray(rows, dtype=np.int64), np.zeros(len(columns), dtype=np.int64)
    is_free, has_solution = eliminate(columns, rows, right.astype(np.int64), solution)
    # This bound protects against overflow of 64 bits; entries for seams stay below a hundred.
    if np.abs(columns).max(initial=0) > 2**40:
        raise GridError(f"the equations between {len(columns)} translations of seams overflow")
    return (
        IntegerSolutions(solution, columns[is_free, len(rows) :].T.copy(), is_free) if has_solution else None
    )


@compiled
def eliminate(
    columns: IntArray, rows: IntArray, right: IntArray, solution: IntArray
) -> tuple[BoolArray, bool]:
    """Bring rows to echelon form by column operations, until all are or entries get very large.

    Args:
        columns: (n, r + n) the columns of the rows (r, n), and of an identity below them; changed in place.
        rows, right: the equations.
        solution: (n,) zeros; on return a solution.

    Returns:
        (n,) True for the columns that are then zero in all rows; and whether there are solutions. Without any, or with
        very large entries, it ends early.
    """
    # Loops compile several times as fast as array expressions.
    size = columns.shape[1]
    is_free = np.empty(len(columns), dtype=np.bool_)
    for c in range(len(columns)):
        is_free[c] = True
    for i in range(len(rows)):
        filled = 2
        while filled > 1:
            pivot, smallest, filled = -1, (0, 0), 0
            for c in range(len(columns)):
                if is_free[c] and columns[c, i] != 0:
                    entries = 0
                    for k in range(size):
                        entries += columns[c, k] != 0
                    filled += 1
                    if pivot < 0 or (abs(columns[c, i]), entries) < smallest:
                        pivot, smallest = c, (abs(columns[c, i]), entries)
            for c in range(len(columns)):
                if filled > 1 and c != pivot and is_free[c] and columns[c, i] != 0:
                    times = round(columns[c, i] / columns[pivot, i])
                    for k in range(size):
                        columns[c, k] -= times * columns[pivot, k]
                        if abs(columns[c, k]) > 2**40:
                            return is_free, False
        missing = right[i]
        for k in range(len(solution)):
            missing -= rows[i, k] * solution[k]
        if pivot >= 0:
            # The column is zero in all previous rows, so these remain satisfied.
            times = missing // columns[pivot, i]
            for k in range(len(solution)):
                solution[k] += times * columns[pivot, len(rows) + k]
            missing %= columns[pivot, i]
            is_free[pivot] = False
        if missing != 0:
            return is_free, False
    return is_free, True


@dataclass(frozen=True, eq=False)
class Lattice:
    """The integer vectors origin + basis y for integer y, with a metric.

    Attributes:
        origin: (d,) one vector.
        basis: (d, k) integers.
        gram: (d, d) the scalar product.
    """

    origin: IntArray
    basis: IntArray
    gram: FloatArray

    def where(self, row: IntArray, value: int) -> Lattice | None:
        """Return the vectors whose product with `row` (d,) is `value`, as a lattice; None if these are none or all."""
        # Only basis vectors with a product that is not zero change, which are few.
        entries = np.flatnonzero(row)
        filled = np.flatnonzero(products := row[entries] @ self.basis[entries])
        within = integer_solutions(products[None, filled], np.array([value - int(row @ self.origin)]))
        if within is None or not len(filled):
            return None
        changed, basis = self.basis[:, filled], np.delete(self.basis, filled[~within.is_free], axis=1)
        basis[:, (filled - np.cumsum(~within.is_free))[within.is_free]] = changed @ csr_matrix(within.basis)
        return Lattice(self.origin + changed @ within.solution, basis, self.gram)

    def reduced(self) -> ReducedLattice:
        """Return the same lattice with a nearly orthogonal basis."""
        change = np.eye(self.basis.shape[1], dtype=np.int64, order="F")
        transposed = csr_matrix(self.basis.T, dtype=np.float64)
        root = scipy.linalg.cholesky(transposed @ (transposed @ self.gram).T)
        reduce_basis(root, change)
        return ReducedLattice(
            self.origin, self.basis @ csr_matrix(change), self.gram, np.ascontiguousarray(root)
        )


@dataclass(frozen=True, eq=False)
class ReducedLattice(Lattice):
    """A lattice with a nearly orthogonal basis, and (k, k) the Cholesky factor of the Gram matrix of this basis."""

    root: FloatArray

    def nearest(self, place: FloatArray) -> IntArray:
        """Return (d,) the vector nearest to a real vector (d,).

        The search starts at Babai's point and stops after `MAX_VISITS` nodes. The result is the nearest
        vector if the search is complete before.

        References:
            C. P. Schnorr, M. Euchner, "Lattice basis reduction: improved practical algorithms", 1994.
        """
        if not self.basis.shape[1]:
            return self.origin
        target = scipy.linalg.cho_solve(
            (self.root, False), self.basis.T @ (self.gram @ (place - self.origin))
        )
        return self.origin + self.basis @ nearest_point(self.root, target, MAX_VISITS)


@compiled
def reduce_basis(root: FloatArray, basis: IntArray) -> None:
    """Reduce the columns of an upper triangular matrix in place (LLL), and apply the same operations to `basis`."""
    size = len(root)
    k, steps = 1, 0
    # A limit of steps, for endless exchanges caused by rounding and large lattices: the basis is then less reduced.
    while k < size and steps < min(200 * size, 40_000):
        steps += 1
        for j in range(k - 1, -1, -1):
            times = round(root[j, k] / root[j, j])
            if times != 0:
                for i in range(size):
                    root[i, k] -= times * root[i, j]
                    basis[i, k] -= int(times) * basis[i, j]
        above, below = root[k - 1, k], root[k, k]
        if 0.99 * root[k - 1, k - 1] ** 2 <= above * above + below * below:
            k += 1
            continue
        for i in range(size):
            root[i, k - 1], root[i, k] = root[i, k], root[i, k - 1]
            basis[i, k - 1], basis[i, k] = basis[i, k], basis[i, k - 1]
        # A rotation of two rows makes the matrix triangular again.
        norm = math.sqrt(above * above + below * below)
        c, s = above / norm, below / norm
        for i in range(k - 1, size):
            first, second = root[k - 1, i], root[k, i]
            root[k - 1, i], root[k, i] = c * first + s * second, c * second - s * first
        root[k, k - 1] = 0.0
        k = max(k - 1, 1)


@compiled
def nearest_point(root: FloatArray, target: FloatArray, visits: int) -> IntArray:
    """Return the integer vector nearest to a target in the metric with a Cholesky factor.

    The search is depth first from the last coordinate. At each depth, integers are tried in the order of their
    distance, so that the first leaf is Babai's point.
    """
    size = len(target)
    integers, step, nearest = np.zeros(size, np.int64), np.zeros(size, np.int64), np.zeros(size, np.int64)
    centre = np.zeros(size)
    beyond = np.zeros(size + 1)  # squared distance in the coordinates from this one on
    least_distance, depth, is_new = np.inf, size - 1, True
    for _ in range(visits):
        if is_new:
            pull = 0.0
            for j in range(depth + 1, size):
                pull += root[depth, j] * (integers[j] - target[j])
            centre[depth] = target[depth] - pull / root[depth, depth]
            integers[depth] = round(centre[depth])
            step[depth] = 1 if centre[depth] >= integers[depth] else -1
        off = (integers[depth] - centre[depth]) * root[depth, depth]
        total = beyond[depth + 1] + off * off
        is_new = total < least_distance and depth > 0
        if is_new:
            beyond[depth] = total
            depth -= 1
            continue
        if total < least_distance:
            least_distance = total
            for j in range(size):
                nearest[j] = integers[j]
        else:
            depth += 1
            if depth == size:
                break
        # The next nearest integer is on the other side, one further away.
        integers[depth] += step[depth]
        step[depth] = -step[depth] - (1 if step[depth] > 0 else -1)
    return nearest
