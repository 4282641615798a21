"""Solutions of small systems of linear equations, some of which may be linearly dependent."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.linalg import lapack
from scipy.sparse import csr_matrix

from ...base.arrays import FloatArray, IntArray
from ...mesh.connectivity import label_components

# Relative size below which the residual of an eliminated equation, or an eliminated integer coefficient, is rounding.
RELATIVE_ROUNDING = 1e-10
# Coefficients of an orthogonal basis below this value are set to zero; the sides of seams differ by the dropped part.
ZERO_COEFFICIENT = 1e-15
# Block size of LAPACK, in columns.
PANEL_COLUMNS = 32


def orthogonal_solutions(rows: csr_matrix, right: FloatArray) -> tuple[csr_matrix, FloatArray]:
    """Return the solutions of linear equations by QR factorization, and the residuals of dependent equations.

    Each set of variables that equations connect is solved for separately.

    Args:
        rows: (r, v) coefficients; equations may be linearly dependent.
        right: (r,) right-hand sides.

    Returns:
        (v, k + 1) a basis of the k-dimensional space of homogeneous solutions, with a particular solution in the last
        column; and (d,) the remaining transformed right-hand sides, rounding errors if the equations are consistent.
    """
    variables = rows.shape[1]
    residuals, at, columns, values, count = [np.empty(0)], [], [], [], 0
    for own, rights, matrix in _blocks(rows):
        basis, last, left = _solutions_of_block(matrix, right[rights])
        extended = np.concatenate([last[:, None], basis], axis=1)
        row, column = np.nonzero(extended)
        at.append(own[row])
        columns.append(np.where(column == 0, -1, count + column - 1))
        values.append(extended[row, column])
        residuals.append(left)
        count += basis.shape[1]
    column = np.concatenate(columns)
    column[column < 0] = count
    solutions = csr_matrix(
        (np.concatenate(values), (np.concatenate(at), column)), shape=(variables, count + 1)
    )
    return solutions, np.concatenate(residuals)


def _blocks(rows: csr_matrix) -> Iterator[tuple[IntArray, IntArray, FloatArray]]:
    """Yield sets of variables, (w,), the equations that connect these, (h,), and their coefficients, (h, w)."""
    equations, variables = rows.shape
    entries = rows.tocoo()
    count, block = label_components(variables + equations, entries.col, variables + entries.row)
    order = np.argsort(block, kind="stable")  # the variables of each come before its equations
    bounds = np.searchsorted(block[order], np.arange(count + 1))
    place = np.empty(len(block), dtype=np.int64)
    place[order] = np.arange(len(block)) - bounds[block[order]]
    widths = np.bincount(block[:variables], minlength=count)
    starts = np.concatenate([[0], np.cumsum(widths * (np.diff(bounds) - widths))])
    of_entry = block[entries.col]
    row = place[variables + entries.row] - widths[of_entry]
    dense = np.zeros(starts[-1])
    dense[starts[of_entry] + row * widths[of_entry] + place[entries.col]] = entries.data
    for b, width in enumerate(widths.tolist()):
        members = order[bounds[b] : bounds[b + 1]]
        yield (
            members[:width],
            members[width:] - variables,
            dense[starts[b] : starts[b + 1]].reshape(-1, width),
        )


def _solutions_of_block(rows: FloatArray, right: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (w, f) a basis of the null space of equations (h, w), (w,) a solution, and the transformed residuals."""
    height, width = rows.shape
    if not height:
        return np.eye(width), np.zeros(width), right
    # LAPACK is called directly: there may be thousands of blocks, and SciPy's checks take longer than the computation.
    r, pivots, scales, _, _ = lapack.dgeqp3(rows, lwork=(width + 1) * PANEL_COLUMNS)
    turned = lapack.dormqr("L", "T", r[:, : len(scales)], scales, right[:, None], PANEL_COLUMNS)[0][:, 0]
    diagonal = np.abs(np.diag(r))
    rank = int((diagonal > RELATIVE_ROUNDING * max(diagonal[0], 1e-300)).sum())
    wanted = np.concatenate([-r[:rank, rank:], turned[:rank, None]], axis=1)
    solved = lapack.dtrtrs(r[:rank, :rank], wanted)[0] if rank else wanted
    solved = np.where(np.abs(solved) > ZERO_COEFFICIENT, solved, 0.0)
    pivots -= 1  # LAPACK counts from 1
    basis, last = np.zeros((width, width - rank)), np.zeros(width)
    basis[pivots[:rank]], last[pivots[:rank]] = solved[:, :-1], solved[:, -1]
    basis[pivots[rank:], np.arange(width - rank)] = 1.0
    return basis, last, turned[rank:]
