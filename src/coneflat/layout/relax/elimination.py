"""Solutions of small systems of linear equations of which some may depend on others."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from ..._arrays import FloatArray

# Relative size below which what elimination leaves of an equation is rounding.
ROUNDING = 1e-10
# Coefficients of an orthogonal basis below this are none; what is taken for none is missed by the sides of seams.
TINY = 1e-15
# Coefficients below this are rounding where turns are quarter turns, and they are whole.
NOT_WHOLE = 1e-9
# Part of the largest coefficient of an equation that a pivot has at least.
PIVOT = 0.5


def sparse_solutions(rows: FloatArray, right: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (v, k + 1) a basis of the solutions of equations, one of these in the last column, and what was missed.

    Equations with the fewest variables are solved first, each for the variable that is in the fewest others (H. M.
    Markowitz, "The elimination form of the inverse and its application to linear programming", 1957), so that variables
    depend on few; those of an orthogonal basis would depend on all.

    Args:
        rows: (r, v) coefficients, dependent ones among them are no harm.
        right: (r,).

    Returns:
        The basis, and (d,) what is left of the right-hand sides of equations that depend on others: 0 unless they
        contradict these.
    """
    work = np.concatenate([rows, right[:, None]], axis=1)
    count = rows.shape[1]
    is_open = np.ones(len(rows), dtype=bool)
    solved: list[tuple[int, int]] = []
    while True:
        filled = np.abs(work[:, :count]) > NOT_WHOLE
        sizes = np.where(is_open, filled.sum(axis=1), count + 1)
        sizes[is_open & (sizes == 0)] = count + 1
        row = int(np.argmin(sizes))
        if sizes[row] > count:
            break
        size = np.abs(work[row, :count])
        columns = np.flatnonzero(size >= PIVOT * size.max())
        column = int(columns[np.argmin(filled[:, columns].sum(axis=0))])
        work[row] /= work[row, column]
        others = np.flatnonzero(filled[:, column])
        others = others[others != row]
        work[others] -= work[others, column, None] * work[row]
        work[others, column] = 0.0
        is_open[row] = False
        solved.append((row, column))
    pivots = np.array([column for _, column in solved], dtype=np.int64)
    at = np.array([row for row, _ in solved], dtype=np.int64)
    free = np.setdiff1d(np.arange(count), pivots)
    basis = np.zeros((count, len(free) + 1))
    basis[free, np.arange(len(free))] = 1.0
    basis[pivots, :-1] = -work[np.ix_(at, free)]
    basis[pivots, -1] = work[at, count]
    basis[np.abs(basis) < NOT_WHOLE * max(1.0, float(np.abs(basis).max(initial=0.0)))] = 0.0
    return basis, work[is_open, count]


def orthogonal_solutions(rows: FloatArray, right: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (v, k + 1) a basis of the solutions of equations, one of these in the last column, and what was missed.

    Args:
        rows: (r, v) coefficients, dependent ones among them are no harm.
        right: (r,).

    Returns:
        The basis, and (r,) what is left of the right-hand sides: rounding unless equations contradict each other.
    """
    q, r, pivots = scipy.linalg.qr(rows, mode="economic", pivoting=True)
    diagonal = np.abs(np.diag(r))
    rank = int((diagonal > ROUNDING * max(diagonal[0], 1e-300)).sum())
    turned = q.T @ right
    solved = scipy.linalg.solve_triangular(
        r[:rank, :rank], np.concatenate([-r[:rank, rank:], turned[:rank, None]], axis=1)
    )
    count = rows.shape[1]
    basis = np.zeros((count, count - rank + 1))
    basis[pivots[:rank]] = np.where(np.abs(solved) > TINY, solved, 0.0)
    basis[pivots[rank:], np.arange(count - rank)] = 1.0
    return basis, right - q[:, :rank] @ turned[:rank]
