"""Every back end against dense linear algebra, and the ladder."""

import ctypes

import numpy as np
import pytest
import shapes
from scipy.sparse import csc_matrix, diags

from coneflat import errors, flatten
from coneflat.apps.cli.main import cli
from coneflat.geometry import cotangent_laplacian, cotangents, edge_lengths
from coneflat.options.declared import SOLVERS as SOLVER_NAMES
from coneflat.solver import available, factorize, pardiso, solving
from coneflat.solver.back_ends import HUGE, LARGE, MODULES, best_for
from coneflat.threads import TINY, meanwhile, using_threads

SOLVERS = [
    pytest.param(name, marks=pytest.mark.skipif(not available(name), reason=f"{name} is not installed"))
    for name in MODULES
]


def grounded_laplacian(faces, vertices):
    laplacian = cotangent_laplacian(faces, cotangents(edge_lengths(vertices, faces)), len(vertices))
    return csc_matrix(csc_matrix(laplacian)[1:][:, 1:])


@pytest.fixture
def matrix():
    vertices, faces = shapes.sphere(3)
    return grounded_laplacian(faces, vertices)


@pytest.mark.parametrize("name", SOLVERS)
def test_solutions(name, matrix):
    right = np.random.default_rng(0).normal(size=(matrix.shape[0], 3))
    expected = np.linalg.solve(matrix.toarray(), right)
    with solving(name) as choice:
        factor = factorize(matrix)
        assert factor.solve(right) == pytest.approx(expected, abs=1e-9)
        assert factor.solve(right[:, 0]) == pytest.approx(expected[:, 0], abs=1e-9)
        assert factor.solve(np.asfortranarray(right)[:, ::2]) == pytest.approx(expected[:, ::2], abs=1e-9)
    assert list(choice.used) == [name]


@pytest.mark.parametrize("name", SOLVERS)
def test_the_same_pattern_and_another(name, matrix):
    """What was analysed for one matrix serves others of its size, whichever their pattern."""
    same = csc_matrix((matrix.data * 2, matrix.indices, matrix.indptr), shape=matrix.shape)
    other = csc_matrix(matrix + csc_matrix(([0.5, 0.5], ([0, 500], [500, 0])), shape=matrix.shape))
    other.setdiag(other.diagonal() + 1)
    other.sort_indices()
    right = np.random.default_rng(0).normal(size=matrix.shape[0])
    with solving(name):
        factor = factorize(matrix)
        for each in (same, other, matrix):
            factor = factorize(each, used_up=factor)
            assert factor.solve(right) == pytest.approx(np.linalg.solve(each.toarray(), right), abs=1e-9)


@pytest.mark.parametrize("name", [each for each in SOLVERS if each.values[0] != "amg"])
def test_indefinite_matrices_are_solved_with_pivots(name, matrix):
    changed = matrix.copy()
    changed[100, 100] -= 100.0
    right = np.random.default_rng(0).normal(size=matrix.shape[0])
    with solving(name):
        solution = factorize(csc_matrix(changed)).solve(right)
    assert solution == pytest.approx(np.linalg.solve(changed.toarray(), right), abs=1e-8)


@pytest.mark.parametrize("name", SOLVERS)
def test_matrices_without_a_positive_diagonal_print_nothing(name, matrix, capfd):
    matrix = matrix - 2 * diags(matrix.diagonal() * (np.arange(matrix.shape[0]) == 7))
    with solving(name):
        solution = factorize(csc_matrix(matrix)).solve(np.ones(matrix.shape[0]))
    assert matrix @ solution == pytest.approx(np.ones(matrix.shape[0]), abs=1e-6)
    assert capfd.readouterr().out == ""


@pytest.mark.parametrize("name", SOLVERS)
def test_flattening_is_the_same_by_every_solver(name):
    vertices, faces = shapes.sphere(3)
    result = flatten(vertices, faces, solver=name)
    expected = flatten(vertices, faces, solver="scipy")
    assert result.solvers == (name,)
    assert result.report()["solvers"] == [name]
    assert result.cones.tolist() == expected.cones.tolist()
    assert result.log_scale == pytest.approx(expected.log_scale, abs=1e-8)


@pytest.mark.parametrize("name", SOLVERS)
def test_solutions_are_the_same_every_time(name, matrix):
    right = np.random.default_rng(0).normal(size=(matrix.shape[0], 4))
    with solving(name):
        first, second = (factorize(matrix).solve(right) for _ in range(2))
    assert np.array_equal(first, second)


def test_the_ladder_takes_what_is_installed(monkeypatch):
    installed = {"cholespy", "scipy"}
    monkeypatch.setattr("coneflat.solver.back_ends.available", lambda name: name in installed)
    assert best_for(LARGE - 1) == best_for(HUGE) == "cholespy"
    installed |= {"pardiso", "amg"}
    assert (best_for(LARGE - 1), best_for(LARGE), best_for(HUGE)) == ("cholespy", "pardiso", "pardiso")
    installed -= {"pardiso"}
    assert best_for(HUGE) == "amg"
    installed.clear()
    assert best_for(10) == "scipy"


def test_a_solver_that_is_not_installed(monkeypatch):
    monkeypatch.setattr("coneflat.solver.back_ends.available", lambda name: False)
    with pytest.raises(errors.OptionError, match=r"pip install 'coneflat\[fast\]'"):
        flatten(*shapes.sphere(1), solver="pardiso")


def test_too_little_memory_for_a_factorization(monkeypatch, matrix):
    pytest.importorskip("pyamg")

    def no_memory(matrix):
        raise MemoryError

    monkeypatch.setattr("coneflat.solver.back_ends.CholespyFactor", no_memory)
    with solving("auto") as choice:
        factorize(matrix)
    assert list(choice.used) == ["amg"]
    with solving("cholespy"), pytest.raises(MemoryError):
        factorize(matrix)


def test_no_unknowns():
    assert factorize(csc_matrix((0, 0))).solve(np.zeros(0)).shape == (0,)


@pytest.mark.parametrize("name", SOLVERS)
def test_flattening_is_the_same_to_the_last_bit(name):
    """Whatever the memory looks like: results must not depend on where arrays lie."""
    vertices, faces = shapes.sphere(4)
    results, held = [], []
    for i in range(3):
        results.append(flatten(vertices, faces, solver=name, max_cones=4).uv)
        held.append(np.empty(50_001 + 7 * i))
    assert np.array_equal(results[0], results[1])
    assert np.array_equal(results[0], results[2])


def test_every_list_of_solvers_is_the_same():
    choices = next(
        option for option in cli.commands["flatten"].params if option.name == "solver"
    ).type.choices
    assert tuple(choices) == SOLVER_NAMES == ("auto", *MODULES)


@pytest.mark.skipif(not available("pardiso"), reason="pypardiso is not installed")
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


def test_scattered_parts_and_parts_of_a_whole_are_solved_by_what_is_fastest_for_them(matrix):
    right = np.ones(matrix.shape[0])
    expected = np.linalg.solve(matrix.toarray(), right)
    assert factorize(matrix, is_scattered=True).solve(right) == pytest.approx(expected, abs=1e-9)
    with solving("auto") as choice:
        for whole in (0, LARGE, 2 * HUGE):
            factor = factorize(matrix, whole=whole)
            assert factor.solve(right) == pytest.approx(expected, abs=1e-9)
            # No part is so large that nothing but multigrid fits into memory.
            assert list(choice.used)[-1] == best_for(min(max(whole, 1), LARGE))


def test_tiny_matrices_are_dense_and_solved_with_pivots_where_they_are_indefinite(matrix):
    right = np.random.default_rng(0).normal(size=(60, 3))
    some = csc_matrix(matrix[:60, :60])
    indefinite = some.copy()
    indefinite[20, 20] -= 100.0
    with solving("auto") as choice:
        factor = factorize(some)
        for each in (some, indefinite, some):
            factor = factorize(csc_matrix(each), used_up=factor)
            for sources in (right, right[:, 0], np.asfortranarray(right)[:, ::2]):
                expected = np.linalg.solve(each.toarray(), sources)
                assert factor.solve(sources) == pytest.approx(expected, abs=1e-9)
    assert list(choice.used) == ["scipy"]


@pytest.mark.skipif(not available("pardiso"), reason="needs pypardiso")
def test_the_number_of_threads_changes_nothing_but_rounding():
    vertices, faces = shapes.sphere(5)
    one, two, again = (flatten(vertices, faces, solver="pardiso", threads=n, max_cones=4) for n in (1, 3, 3))
    assert one.cones.tolist() == two.cones.tolist()
    assert one.log_scale == pytest.approx(two.log_scale, abs=1e-9)
    assert np.array_equal(two.uv, again.uv)


@pytest.mark.skipif(not available("pardiso"), reason="needs pypardiso")
def test_a_factor_stays_on_the_threads_that_it_was_made_on(matrix, monkeypatch):
    used, call = [], pardiso._pardiso
    monkeypatch.setattr(
        pardiso, "_pardiso", lambda kind, count, *rest: used.append(count) or call(kind, count, *rest)
    )
    with solving("pardiso"), using_threads(3):
        factor = factorize(matrix)
    with using_threads(1):
        factor = factor.renewed(2 * matrix)
        factor.solve(np.ones(matrix.shape[0]))
    assert set(used) == {3}
    assert len(used) > 3


class Heap(ctypes.Structure):
    """What the C library tells of its memory."""

    _fields_ = tuple(
        (name, ctypes.c_size_t)
        for name in ("arena", "free_chunks", "fast", "maps", "mapped", "_", "__", "in_use", "free", "top")
    )


@pytest.mark.skipif(not available("pardiso"), reason="needs pypardiso")
def test_another_pattern_leaves_no_memory_behind(matrix):
    try:
        tell = ctypes.CDLL("libc.so.6").mallinfo2
    except (OSError, AttributeError):
        pytest.skip("needs the C library of GNU to tell how much memory is used")
    tell.restype = Heap
    right, found = np.ones(matrix.shape[0]), []
    with solving("pardiso"):
        kept = factorize(matrix)
        for _ in range(60):
            # Another array of indices may be of another pattern.
            kept = kept.renewed(matrix.copy())
            found.append(tell().in_use + tell().mapped)
        np.testing.assert_array_equal(kept.solve(right), factorize(matrix).solve(right))
    # An analysis takes more than the matrix does.
    assert max(found[10:]) - found[10] < 5 * matrix.data.nbytes


def test_with_one_thread_nothing_is_done_meanwhile():
    seen = []
    with using_threads(1), meanwhile(lambda: seen.append("one"), TINY + 1) as doing:
        seen.append("two")
    assert seen == ["one", "two"]
    assert doing.done()


@pytest.mark.parametrize("count", [0, -1, 1.5, 257, "many"])
def test_numbers_of_threads_that_make_no_sense(count):
    with pytest.raises(errors.OptionError, match="threads must be"):
        flatten(*shapes.sphere(1), threads=count)
