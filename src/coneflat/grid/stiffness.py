"""What it costs to change translations of seams and places of cones, to second order."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix, csr_matrix, diags, kron

from .._arrays import ComplexArray, FloatArray, IntArray
from ..geometry.triangles import cotangents
from ..mesh import NEXT, PREVIOUS
from ..solver import factorize
from .transitions import TURNS, Transitions

# Part of the mean diagonal entry that is added to it: what nothing holds, a component without cones, may shift.
RIDGE = 1e-10
# Right-hand sides at once.
BLOCK = 16


class Stiffness:
    """The least Dirichlet energy of a shift of a layout that changes its seams and cones by given amounts.

    A shift is a field of plane vectors whose copies across seams are quarter turns of each other plus the change of the
    translation. Its energy, the integral of its squared derivative, is that of the change of the map, and the same
    wherever the seams run. It tells how near a change comes to turning triangles over, as a distance between
    translations, in which some run around all of the model and some around a finger, does not.
    """

    def __init__(self, corners: IntArray, points: ComplexArray, transitions: Transitions) -> None:
        self._shifts = transitions.shifts
        self._energy = kron(_laplacian(corners, points), np.eye(2)).tocsr()
        self._turned = _turned_copies(transitions)
        system = (self._turned.T @ self._energy @ self._turned).tocsc()
        ridge = RIDGE * float(system.diagonal().mean()) if system.shape[0] else 0.0
        ridged = csc_matrix(system + diags(np.full(system.shape[0], ridge)))
        ridged.sort_indices()
        self._factor = factorize(ridged, is_noted=False)

    def displacement(self, values: FloatArray) -> FloatArray:
        """Return the shifts (2u, k) of least energy for changes (v, k) of the variables."""
        given = self._shifts @ values
        right = -(self._turned.T @ (self._energy @ given))
        shifts: FloatArray = given + self._turned @ self._factor.solve(np.ascontiguousarray(right))
        return shifts

    def gram(self, basis: IntArray) -> FloatArray:
        """Return (d, d) the energies of changes that columns of a basis (v, d) span, as scalar products."""
        count = basis.shape[1]
        gram = np.zeros((count, count))
        # Few points are on seams: as a sparse matrix this stays small.
        pulls = self._energy @ (self._shifts @ csr_matrix(basis))
        for start in range(0, count, BLOCK):
            block = slice(start, min(start + BLOCK, count))
            gram[:, block] = pulls.T @ self.displacement(basis[:, block].astype(np.float64))
        # What cones do not hold costs nothing; as a distance it has to cost something.
        return (gram + gram.T) / 2 + RIDGE * max(float(np.trace(gram)), 1.0) * np.eye(count)


def _laplacian(corners: IntArray, points: ComplexArray) -> csr_matrix:
    """Return (u, u) the cotangent Laplacian of the layout."""
    starts, ends = corners[:, NEXT].ravel(), corners[:, PREVIOUS].ravel()
    weights = cotangents(np.abs(points[ends] - points[starts]).reshape(-1, 3)).ravel() / 2
    rows = np.concatenate([starts, ends, starts, ends])
    columns = np.concatenate([ends, starts, starts, ends])
    both = np.concatenate([-weights, -weights, weights, weights])
    return coo_matrix((both, (rows, columns)), shape=(len(points), len(points))).tocsr()


def _turned_copies(transitions: Transitions) -> csr_matrix:
    """Return (2u, b) how the shifts of points follow those of the ones that they are given by, if loose."""
    count = len(transitions.base)
    turns, axes = TURNS[transitions.turn], np.arange(2)
    rows = np.broadcast_to(2 * np.arange(count)[:, None, None] + axes[:, None], turns.shape)
    columns = np.broadcast_to(2 * transitions.base[:, None, None] + axes, turns.shape)
    every = coo_matrix((turns.ravel(), (rows.ravel(), columns.ravel())), shape=(2 * count, 2 * count)).tocsc()
    every.eliminate_zeros()
    is_base = transitions.base == np.arange(count)
    return every[:, np.flatnonzero((is_base[:, None] & ~transitions.held).ravel())].tocsr()
