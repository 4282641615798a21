"""Solutions of systems of linear equations, some of which may be linearly dependent."""

from __future__ import annotations

import numpy as np
from scipy.linalg import lapack
from scipy.sparse import block_diag, csr_matrix, eye, hstack, vstack

from ..base.arrays import FloatArray, IntArray, mask_of

# Relative size below which the residual of an eliminated equation, or an eliminated integer coefficient, is rounding.
RELATIVE_ROUNDING = 1e-10
# Coefficients of a basis below this value are set to zero; the sides of seams differ by the dropped part.
ZERO_COEFFICIENT = 1e-15
# Block size of LAPACK, in columns.
PANEL_COLUMNS = 32


def solutions_of(rows: csr_matrix, right: FloatArray) -> tuple[csr_matrix, FloatArray]:
    """Return the solutions of linear equations, and the residuals of dependent equations.

    Many equations are eliminated before the QR factorization: each gives a variable that no other of them contains, and
    few of the rest.

    Args:
        rows: (r, v) coefficients, about 1 in size; equations may be linearly dependent.
        right: (r,) right-hand sides.

    Returns:
        (v, k + 1) a basis of the k-dimensional space of homogeneous solutions, with a particular solution in the last
        column; and (d,) the remaining transformed right-hand sides, rounding errors if the equations are consistent,
        else about as large as their contradictions.
    """
    if not len(right):
        return eye(rows.shape[1], rows.shape[1] + 1, format="csr"), right
    # Up to a hundred equations are solved faster as a dense system, and so are those that connect most variables, of
    # which few can be eliminated at once.
    equations, variables = _independent_pivots(rows) if len(right) > 100 else (np.empty(0, np.int64),) * 2
    if len(equations) <= len(right) // 50:
        filled = rows.getnnz(axis=0) > 0
        solutions, residuals = _solutions_of_dense(rows[:, filled].toarray(), right)
        order = np.argsort(np.concatenate([np.flatnonzero(~filled), np.flatnonzero(filled)]))
        return csr_matrix(
            block_diag((eye((~filled).sum()), csr_matrix(solutions)), format="csr")[order]
        ), residuals
    is_used, is_given = mask_of(rows.shape[0], equations), mask_of(rows.shape[1], variables)
    divisors = np.asarray(rows[equations, variables]).ravel()
    # The given variables are `values` minus `factors` times the others.
    values = right[equations] / divisors
    factors = csr_matrix(rows[equations].multiply(1 / divisors[:, None]))[:, ~is_given]
    equations_left = rows[~is_used]
    coefficients = equations_left[:, variables]
    left = csr_matrix(equations_left[:, ~is_given] - coefficients @ factors)
    left.data[np.abs(left.data) <= ZERO_COEFFICIENT] = 0.0
    left.eliminate_zeros()
    solutions, residuals = solutions_of(left, right[~is_used] - coefficients @ values)
    last = csr_matrix((len(values), solutions.shape[1] - 1))
    values_of_pivots = hstack([last, values[:, None]]) - factors @ solutions
    order = np.argsort(np.concatenate([np.flatnonzero(~is_given), variables]))
    return csr_matrix(vstack([solutions, values_of_pivots], format="csr")[order]), residuals


def _independent_pivots(rows: csr_matrix) -> tuple[IntArray, IntArray]:
    """Return (p,) equations and the variables, (p,), that they give; no other of these equations has these variables.

    The coefficients are at least half of the largest of their equations. Variables of few equations with few variables
    are first, so that few entries are filled. Small coefficients, which may be rounding, are left to the factorization.
    """
    by_variable, entries = rows.tocsc(), rows.tocoo()
    sizes, widths, heights = np.abs(entries.data), np.diff(rows.indptr), np.diff(by_variable.indptr)
    threshold = np.full(rows.shape[0], 0.01)
    np.maximum.at(threshold, entries.row, sizes / 2)
    candidates = np.flatnonzero(sizes >= threshold[entries.row])
    cost = (widths[entries.row] - 1) * (heights[entries.col] - 1)
    candidates = candidates[np.argsort(cost[candidates], kind="stable")]
    has_given, is_contained = np.zeros(rows.shape[0], dtype=bool), np.zeros(rows.shape[1], dtype=bool)
    pivots = []
    for equation, variable in zip(
        entries.row[candidates].tolist(), entries.col[candidates].tolist(), strict=True
    ):
        if not has_given[equation] and not is_contained[variable]:
            pivots.append((equation, variable))
            is_contained[rows.indices[rows.indptr[equation] : rows.indptr[equation + 1]]] = True
            column = slice(by_variable.indptr[variable], by_variable.indptr[variable + 1])
            has_given[by_variable.indices[column]] = True
    equations, variables = np.array(pivots, dtype=np.int64).reshape(-1, 2).T
    return equations, variables


def _solutions_of_dense(rows: FloatArray, right: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the solutions and residuals of dense equations (h, w) by QR factorization with pivoting."""
    height, width = rows.shape
    if not height or not width:
        return np.eye(width, width + 1), right
    # SciPy's own functions check their arguments, which for most layouts takes longer than the computation.
    r, pivots, scales, _, _ = lapack.dgeqp3(rows, lwork=(width + 1) * PANEL_COLUMNS)
    turned = lapack.dormqr("L", "T", r[:, : len(scales)], scales, right[:, None], PANEL_COLUMNS)[0][:, 0]
    diagonal = np.abs(np.diag(r))
    rank = int((diagonal > RELATIVE_ROUNDING * max(diagonal[0], 1.0)).sum())
    columns = np.concatenate([-r[:rank, rank:], turned[:rank, None]], axis=1)
    solved = lapack.dtrtrs(r[:rank, :rank], columns)[0] if rank else columns
    solutions = np.eye(width, width - rank + 1, k=-rank)
    solutions[:rank] = np.where(np.abs(solved) > ZERO_COEFFICIENT, solved, 0.0)
    return solutions[np.argsort(pivots)], turned[rank:]
