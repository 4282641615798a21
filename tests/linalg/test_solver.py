"""Every factorization against dense linear algebra, and which of them is taken."""

import ctypes

import numpy as np
import pytest
import shapes
from scipy.sparse import csc_matrix, diags

from coneflat import errors, flatten
from coneflat.base.threads import limit_threads
from coneflat.geometry import cotangent_laplacian, cotangents, edge_lengths
from coneflat.linalg import SuperLUFactor, factorize, pardiso
from coneflat.linalg.factors import MIN_PARDISO_UNKNOWNS, CholespyFactor, has_pardiso
from coneflat.linalg.pardiso import PardisoFactor

needs_pardiso = pytest.mark.skipif(not has_pardiso(), reason="pypardiso is not installed")
KINDS = [CholespyFactor, SuperLUFactor, pytest.param(PardisoFactor, marks=needs_pardiso)]


@pytest.fixture(params=KINDS)
def kind(request, monkeypatch):
    """A kind of factor; `factorize` takes it for all but indefinite matrices."""
    name = "coneflat.linalg.factors"
    monkeypatch.setattr(f"{name}.has_pardiso", lambda: request.param is PardisoFactor)
    monkeypatch.setattr(f"{name}.MIN_PARDISO_UNKNOWNS", 1)
    monkeypatch.setattr(f"{name}.MAX_SMALL_SYSTEM", 0)
    if request.param is SuperLUFactor:
        monkeypatch.setattr(f"{name}.CholespyFactor", SuperLUFactor)
    return request.param


def grounded_laplacian(faces, vertices):
    laplacian = cotangent_laplacian(faces, cotangents(edge_lengths(vertices, faces)), len(vertices))
    return csc_matrix(csc_matrix(laplacian)[1:][:, 1:])


@pytest.fixture
def matrix():
    vertices, faces = shapes.sphere(3)
    return grounded_laplacian(faces, vertices)


def test_solutions(kind, matrix):
    right = np.random.default_rng(0).normal(size=(matrix.shape[0], 3))
    expected = np.linalg.solve(matrix.toarray(), right)
    factor = factorize(matrix)
    assert type(factor) is kind
    assert factor.solve(right) == pytest.approx(expected, abs=1e-9)
    assert factor.solve(right[:, 0]) == pytest.approx(expected[:, 0], abs=1e-9)
    assert factor.solve(np.asfortranarray(right)[:, ::2]) == pytest.approx(expected[:, ::2], abs=1e-9)


def test_the_same_pattern_and_another(kind, matrix):
    """What was analysed for one matrix serves others of its size, whichever their pattern."""
    same = csc_matrix((matrix.data * 2, matrix.indices, matrix.indptr), shape=matrix.shape)
    other = csc_matrix(matrix + csc_matrix(([0.5, 0.5], ([0, 500], [500, 0])), shape=matrix.shape))
    other.setdiag(other.diagonal() + 1)
    other.sort_indices()
    right = np.random.default_rng(0).normal(size=matrix.shape[0])
    factor = factorize(matrix)
    for each in (same, other, matrix):
        factor = factorize(each, previous=factor)
        assert type(factor) is kind
        assert factor.solve(right) == pytest.approx(np.linalg.solve(each.toarray(), right), abs=1e-9)


def test_indefinite_matrices_are_solved_with_pivots(kind, matrix):
    changed = matrix.copy()
    changed[100, 100] -= 100.0
    right = np.random.default_rng(0).normal(size=matrix.shape[0])
    factor = factorize(matrix)
    for each in (changed, matrix, changed):
        factor = factorize(csc_matrix(each), previous=factor)
        assert factor.solve(right) == pytest.approx(np.linalg.solve(each.toarray(), right), abs=1e-8)


def test_matrices_without_a_positive_diagonal_print_nothing(kind, matrix, capfd):
    matrix = matrix - 2 * diags(matrix.diagonal() * (np.arange(matrix.shape[0]) == 7))
    solution = factorize(csc_matrix(matrix)).solve(np.ones(matrix.shape[0]))
    assert matrix @ solution == pytest.approx(np.ones(matrix.shape[0]), abs=1e-6)
    assert capfd.readouterr().out == ""


def test_flattening_is_the_same_by_every_solver(kind):
    vertices, faces = shapes.sphere(3)
    result = flatten(vertices, faces)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("coneflat.linalg.factors.has_pardiso", lambda: False)
        expected = flatten(vertices, faces)
    assert result.cones.tolist() == expected.cones.tolist()
    assert result.log_scale == pytest.approx(expected.log_scale, abs=1e-8)


def test_solutions_are_the_same_every_time(kind, matrix):
    right = np.random.default_rng(0).normal(size=(matrix.shape[0], 4))
    first, second = (factorize(matrix).solve(right) for _ in range(2))
    assert np.array_equal(first, second)


@needs_pardiso
def test_large_systems_are_solved_by_pardiso_where_it_is_installed(matrix, monkeypatch):
    right = np.ones(matrix.shape[0])
    expected = np.linalg.solve(matrix.toarray(), right)
    monkeypatch.setattr("coneflat.linalg.factors.MAX_SMALL_SYSTEM", 0)
    for is_installed, large in ((True, PardisoFactor), (False, CholespyFactor)):
        monkeypatch.setattr("coneflat.linalg.factors.has_pardiso", lambda: is_installed)  # noqa: B023
        for total_size, kind in ((0, CholespyFactor), (MIN_PARDISO_UNKNOWNS, large)):
            factor = factorize(matrix, total_size=total_size)
            assert type(factor) is kind
            assert factor.solve(right) == pytest.approx(expected, abs=1e-9)


def test_small_systems_are_solved_by_superlu_without_messages(matrix, capfd):
    """CHOLMOD prints on standard output if a matrix is indefinite."""
    right = np.ones(matrix.shape[0])
    indefinite = csc_matrix(matrix - diags(np.full(matrix.shape[0], 0.5)))
    for each in (matrix, indefinite):
        factor = factorize(each)
        assert type(factor) is SuperLUFactor
        assert factor.solve(right) == pytest.approx(np.linalg.solve(each.toarray(), right), abs=1e-6)
    assert capfd.readouterr().out == ""


def test_larger_systems_are_solved_by_cholmod(matrix, monkeypatch):
    monkeypatch.setattr("coneflat.linalg.factors.MAX_SMALL_SYSTEM", 10_000)
    assert type(factorize(matrix)) is CholespyFactor


def test_no_unknowns():
    assert factorize(csc_matrix((0, 0))).solve(np.zeros(0)).shape == (0,)


def test_flattening_is_the_same_to_the_last_bit(kind):
    """Whatever the memory looks like: results must not depend on where arrays lie."""
    vertices, faces = shapes.sphere(3)
    results, held = [], []
    for i in range(3):
        results.append(flatten(vertices, faces, max_cones=4).uv)
        held.append(np.empty(50_001 + 7 * i))
    assert np.array_equal(results[0], results[1])
    assert np.array_equal(results[0], results[2])


@pytest.mark.slow
@needs_pardiso
@pytest.mark.parametrize("found", [None, ()])
def test_mkl_is_found_where_no_package_tells_of_it(monkeypatch, found):
    def files(name):
        if found is None:
            raise pardiso.metadata.PackageNotFoundError(name)
        return found

    usual = pardiso._library()
    monkeypatch.setattr(pardiso.metadata, "files", files)
    assert pardiso._library()["pardiso"] is not None
    assert usual["pardiso"] is not None


@pytest.mark.slow
@needs_pardiso
def test_the_number_of_threads_changes_nothing_but_rounding(monkeypatch):
    monkeypatch.setattr("coneflat.linalg.factors.MIN_PARDISO_UNKNOWNS", 1)
    vertices, faces = shapes.sphere(4)
    one, two, again = (flatten(vertices, faces, threads=n, max_cones=4) for n in (1, 3, 3))
    assert one.cones.tolist() == two.cones.tolist()
    assert one.log_scale == pytest.approx(two.log_scale, abs=1e-9)
    assert np.array_equal(two.uv, again.uv)


@needs_pardiso
def test_a_factor_stays_on_the_threads_that_it_was_made_on(matrix, monkeypatch):
    used, call = [], pardiso._pardiso
    monkeypatch.setattr(
        pardiso, "_pardiso", lambda kind, count, *rest: used.append(count) or call(kind, count, *rest)
    )
    with limit_threads(3):
        factor = PardisoFactor(matrix)
    with limit_threads(1):
        factor = factor.refactorized(2 * matrix)
        factor.solve(np.ones(matrix.shape[0]))
    assert set(used) == {3}
    assert len(used) > 3


class Heap(ctypes.Structure):
    """What the C library tells of its memory."""

    _fields_ = tuple(
        (name, ctypes.c_size_t)
        for name in ("arena", "free_chunks", "fast", "maps", "mapped", "_", "__", "in_use", "free", "top")
    )


@needs_pardiso
def test_another_pattern_leaves_no_memory_behind(matrix):
    try:
        tell = ctypes.CDLL("libc.so.6").mallinfo2
    except (OSError, AttributeError):
        pytest.skip("needs the C library of GNU to tell how much memory is used")
    tell.restype = Heap
    right, found = np.ones(matrix.shape[0]), []
    kept = PardisoFactor(matrix)
    for _ in range(60):
        # Another array of indices may be of another pattern.
        kept = kept.refactorized(matrix.copy())
        found.append(tell().in_use + tell().mapped)
    np.testing.assert_array_equal(kept.solve(right), PardisoFactor(matrix).solve(right))
    # An analysis takes more than the matrix does.
    assert max(found[10:]) - found[10] < 5 * matrix.data.nbytes


@pytest.mark.parametrize("count", [0, -1, 1.5, 257, "many"])
def test_numbers_of_threads_that_make_no_sense(count):
    with pytest.raises(errors.OptionError, match="threads must be"):
        flatten(*shapes.sphere(1), threads=count)
