"""Whole solutions of equations, and the lattice points nearest to a place, against brute force."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from coneflat.errors import GridError
from coneflat.quadmesh.lattice import Lattice, integer_solutions, reduce_basis


def random_gram(rng, size):
    root = rng.normal(size=(size, size)) @ np.diag(np.logspace(0, 1.5, size))
    return root.T @ root


def whole_space(gram):
    size = len(gram)
    return Lattice(np.zeros(size, dtype=np.int64), np.eye(size, dtype=np.int64), gram)


@pytest.mark.parametrize("seed", range(20))
def test_solutions_are_all_solutions(seed):
    """Whatever solves the equations is one solution plus integer multiples of the basis, in one way."""
    rng = np.random.default_rng(seed)
    rows = rng.integers(-2, 3, size=(3, 6))
    rows[2] = rows[0] + rows[1]  # one depends on the others
    solution = rng.integers(-5, 6, size=6)
    solutions = integer_solutions(rows, rows @ solution)
    assert solutions is not None
    assert (rows @ solutions.solution == rows @ solution).all()
    assert not (rows @ solutions.basis).any()
    assert (
        np.linalg.matrix_rank(solutions.basis) == solutions.basis.shape[1] == 6 - np.linalg.matrix_rank(rows)
    )
    steps = np.linalg.lstsq(
        solutions.basis.astype(float), (solution - solutions.solution).astype(float), rcond=None
    )[0]
    assert (solutions.basis @ np.rint(steps).astype(int) == solution - solutions.solution).all()


def test_equations_without_integer_solutions():
    assert integer_solutions(np.array([[2, 4]]), np.array([3])) is None
    assert integer_solutions(np.array([[1, 1], [2, 2]]), np.array([1, 3])) is None
    assert integer_solutions(np.zeros((1, 2), dtype=int), np.array([1])) is None


def test_entries_that_grow_too_large_are_an_error():
    rows = np.random.default_rng(0).integers(-(10**6), 10**6, size=(6, 8))
    with pytest.raises(GridError, match="overflow"):
        integer_solutions(rows, np.zeros(6, dtype=np.int64))


@pytest.mark.parametrize("seed", range(10))
def test_reduced_bases_keep_the_lattice_and_its_lengths(seed):
    rng = np.random.default_rng(seed)
    gram = random_gram(rng, 7)
    root, basis = np.ascontiguousarray(np.linalg.cholesky(gram).T), np.eye(7, dtype=np.int64)
    reduce_basis(root, basis)
    assert abs(round(np.linalg.det(basis))) == 1
    assert root.T @ root == pytest.approx(basis.T @ gram @ basis, rel=1e-8, abs=1e-6 * gram.max())
    assert (np.abs(np.triu(root, 1)) <= 0.51 * np.abs(np.diag(root))[:, None]).all()


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_nearest_points_with_equations_are_those_of_brute_force(seed):
    rng = np.random.default_rng(seed)
    gram = random_gram(rng, 4)
    place = rng.uniform(-2, 2, size=4)
    row = np.array([1, -1, 2, 0])
    lattice = whole_space(gram).where(row, 3).reduced()
    nearest = lattice.nearest(place)
    assert nearest @ row == 3
    every = np.array([point for point in product(range(-12, 13), repeat=4) if row @ point == 3])
    least_distance = np.einsum("ki,ij,kj->k", every - place, gram, every - place).min()
    if np.abs(nearest).max() < 12:
        assert (nearest - place) @ gram @ (nearest - place) == pytest.approx(least_distance)
    assert lattice.where(row, 4) is None
    assert lattice.where(2 * np.array([0, 1, 0, 1]), 1) is None


def test_a_lattice_of_one_point():
    alone = whole_space(np.eye(2)).where(np.array([1, 0]), 2).where(np.array([0, 1]), -1)
    assert alone.reduced().nearest(np.array([0.3, 0.4])).tolist() == [2, -1]
