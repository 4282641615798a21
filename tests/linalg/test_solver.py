"""Every factorization against dense linear algebra, and which of them is taken."""

import ctypes
import logging
from importlib.util import find_spec

import numpy as np
import pytest
import shapes
from scipy.sparse import csc_matrix, diags, tril
from stored_meshes import at_hand

from coneflat import errors, flatten, read_mesh
from coneflat.base.threads import limit_threads
from coneflat.geometry import cotangent_laplacian, cotangents, edge_lengths
from coneflat.linalg import SuperLUFactor, factorize, pardiso, rslab, solvers
from coneflat.linalg.pardiso import PardisoFactor
from coneflat.linalg.rslab import RslabFactor
from coneflat.linalg.solvers import MIN_PARDISO_UNKNOWNS, MIN_RSLAB_UNKNOWNS, PACKAGES, SOLVER_VARIABLE


def needs(name):
    return pytest.mark.skipif(find_spec(PACKAGES[name]) is None, reason=f"{PACKAGES[name]} is not installed")


needs_pardiso, needs_rslab = needs("pardiso"), needs("rslab")
KINDS = {"superlu": SuperLUFactor, "rslab": RslabFactor, "pardiso": PardisoFactor}


@pytest.fixture(params=[pytest.param(name, marks=needs(name)) for name in KINDS])
def kind(request, monkeypatch):
    """A kind of factor, which `factorize` takes for all matrices of rank n."""
    monkeypatch.setenv(SOLVER_VARIABLE, request.param)
    return KINDS[request.param]


@pytest.fixture
def unforced(monkeypatch):
    """Solvers are chosen by size, whatever the environment of the tests says."""
    monkeypatch.delenv(SOLVER_VARIABLE, raising=False)


@pytest.fixture
def hidden(monkeypatch, unforced):
    """Return a function that hides solvers."""
    solver = solvers.solver

    def hide(*names):
        monkeypatch.setattr(solvers, "solver", lambda name: None if name in names else solver(name))

    return hide


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


def test_factors_are_reused_for_other_matrices(kind, matrix):
    """What was analysed for one matrix serves others of its size, whichever their pattern."""
    rescaled = csc_matrix((matrix.data * 2, matrix.indices, matrix.indptr), shape=matrix.shape)
    extended = csc_matrix(matrix + csc_matrix(([0.5, 0.5], ([0, 500], [500, 0])), shape=matrix.shape))
    extended.setdiag(extended.diagonal() + 1)
    extended.sort_indices()
    right = np.random.default_rng(0).normal(size=matrix.shape[0])
    factor = factorize(matrix)
    for system in (rescaled, extended, matrix):
        factor = factorize(system, previous=factor)
        assert type(factor) is kind
        assert factor.solve(right) == pytest.approx(np.linalg.solve(system.toarray(), right), abs=1e-9)


def test_indefinite_matrices_are_solved_with_pivots(kind, matrix):
    changed = matrix.copy()
    changed[100, 100] -= 100.0
    right = np.random.default_rng(0).normal(size=matrix.shape[0])
    factor = factorize(matrix)
    for system in (changed, matrix, changed):
        factor = factorize(csc_matrix(system), previous=factor)
        assert factor.solve(right) == pytest.approx(np.linalg.solve(system.toarray(), right), abs=1e-8)


def test_matrices_without_a_positive_diagonal_print_nothing(kind, matrix, capfd):
    matrix = matrix - 2 * diags(matrix.diagonal() * (np.arange(matrix.shape[0]) == 7))
    solution = factorize(csc_matrix(matrix)).solve(np.ones(matrix.shape[0]))
    assert matrix @ solution == pytest.approx(np.ones(matrix.shape[0]), abs=1e-6)
    assert capfd.readouterr().out == ""


def test_flattening_is_the_same_by_every_solver(kind):
    vertices, faces = shapes.sphere(3)
    result = flatten(vertices, faces)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(SOLVER_VARIABLE, "superlu")
        expected = flatten(vertices, faces)
    assert result.cones.tolist() == expected.cones.tolist()
    assert result.log_scale == pytest.approx(expected.log_scale, abs=1e-8)


def test_solutions_are_the_same_every_time(kind, matrix):
    right = np.random.default_rng(0).normal(size=(matrix.shape[0], 4))
    first, second = (factorize(matrix).solve(right) for _ in range(2))
    assert np.array_equal(first, second)


def test_the_size_chooses_the_solver(matrix, hidden):
    """The larger system that a matrix belongs to counts, and what is missing is replaced by the next."""
    right = np.ones(matrix.shape[0])
    expected = np.linalg.solve(matrix.toarray(), right)
    standard = RslabFactor if find_spec("rslab") else SuperLUFactor
    large = PardisoFactor if find_spec("pypardiso") else standard
    for missing, kinds in (
        ((), (SuperLUFactor, standard, large)),
        (("pardiso",), (SuperLUFactor, standard, standard)),
        (("pardiso", "rslab"), (SuperLUFactor, SuperLUFactor, SuperLUFactor)),
    ):
        hidden(*missing)
        for total_size, kind in zip((0, MIN_RSLAB_UNKNOWNS, MIN_PARDISO_UNKNOWNS), kinds, strict=True):
            factor = factorize(matrix, total_size=total_size)
            assert type(factor) is kind
            assert factor.solve(right) == pytest.approx(expected, abs=1e-9)


def test_small_systems_are_solved_by_superlu(matrix, unforced, capfd):
    right = np.ones(matrix.shape[0])
    indefinite = csc_matrix(matrix - diags(np.full(matrix.shape[0], 0.5)))
    for system in (matrix, indefinite):
        factor = factorize(system)
        assert type(factor) is SuperLUFactor
        assert factor.solve(right) == pytest.approx(np.linalg.solve(system.toarray(), right), abs=1e-6)
    assert capfd.readouterr().out == ""


@pytest.mark.parametrize("name", ["rocker-arm.obj", *at_hand("horse.ply")])
def test_solutions_on_real_meshes(kind, shared, name):
    """With several right-hand sides, before and after other values of the same pattern."""
    mesh = read_mesh(shared(name))
    matrix = grounded_laplacian(mesh.triangles, mesh.vertices)
    right = np.random.default_rng(0).normal(size=(matrix.shape[0], 17))
    scale = diags(np.exp(np.random.default_rng(1).normal(size=matrix.shape[0])))
    scaled = csc_matrix(
        ((scale @ matrix @ scale).tocsc().data, matrix.indices, matrix.indptr), shape=matrix.shape
    )
    factor = None
    for values in (matrix, scaled, matrix):
        factor = factorize(values, factor)
        assert type(factor) is kind
        for sides in (right, right[:, 0], np.asfortranarray(right)[:, 3:5]):
            solution = factor.solve(sides)
            assert solution.shape == sides.shape
            # The backward error: a solution is exact for a matrix that differs in the last digits.
            scale_of_rows = abs(values) @ abs(solution) + abs(sides)
            assert (abs(values @ solution - sides) / scale_of_rows).max() < 1e-12


def test_a_reused_analysis_changes_no_bit(kind, matrix):
    right = np.random.default_rng(0).normal(size=(matrix.shape[0], 3))
    scaled = csc_matrix((matrix.data * 3, matrix.indices, matrix.indptr), shape=matrix.shape)
    reused = factorize(matrix, factorize(scaled))
    assert np.array_equal(reused.solve(right), factorize(matrix).solve(right))


def test_zero_right_hand_sides(kind, matrix):
    assert factorize(matrix).solve(np.zeros((matrix.shape[0], 0))).shape == (matrix.shape[0], 0)


def test_singular_matrices(kind, matrix):
    """A row of zeros: an error of the package with the number of unknowns."""
    keep = diags((np.arange(matrix.shape[0]) != 7).astype(float))
    singular = csc_matrix(keep @ matrix @ keep)
    if kind is PardisoFactor:  # which perturbs zero pivots
        assert np.isfinite(factorize(singular).solve(np.ones(matrix.shape[0]))).all()
        return
    with pytest.raises(errors.MetricError, match=rf"system of {matrix.shape[0]} unknowns is singular"):
        factorize(singular)


@needs_rslab
def test_rslab_factorizes_the_lower_triangle(matrix):
    """Its analysis is of the lower triangle alone, whose values are given in the order of the whole matrix."""
    lower = csc_matrix(tril(matrix))
    triangle = rslab.Triangle(matrix)
    assert triangle.rows.tolist() == lower.indices.tolist()
    assert triangle.starts.tolist() == lower.indptr.tolist()
    assert triangle.values(matrix).tolist() == lower.data.tolist()


def test_an_unknown_solver_is_an_error(monkeypatch, matrix):
    monkeypatch.setenv(SOLVER_VARIABLE, "umfpack")
    with pytest.raises(errors.OptionError, match=r"umfpack: the solvers are pardiso, rslab, superlu"):
        factorize(matrix)


@pytest.mark.parametrize("name", ["pardiso", "rslab"])
def test_a_missing_solver_that_is_forced_is_an_error_that_says_how_to_get_it(
    name, hidden, monkeypatch, matrix
):
    hidden(name)
    monkeypatch.setenv(SOLVER_VARIABLE, name)
    with pytest.raises(
        errors.OptionError, match=f"^{SOLVER_VARIABLE}={name}.* pip install {PACKAGES[name]}$"
    ):
        flatten(*shapes.sphere(2))


def test_a_solver_that_is_not_installed_is_not_mentioned(monkeypatch, unforced, caplog):
    monkeypatch.setattr(solvers, "find_spec", lambda name: None)
    solvers.solver.cache_clear()
    try:
        assert solvers.solver_for(10**6) is SuperLUFactor
    finally:
        solvers.solver.cache_clear()
    assert caplog.records == []


@needs_pardiso
@pytest.mark.parametrize(
    "error", [ImportError("no MKL\nhere"), OSError("bad image"), AttributeError("pardiso")]
)
def test_mkl_that_cannot_be_loaded_is_logged_once_and_the_next_solver_is_taken(
    error, monkeypatch, unforced, caplog
):
    def fail():
        raise error

    monkeypatch.setattr(pardiso, "_routines", fail)
    solvers.solver.cache_clear()
    expected = RslabFactor if find_spec("rslab") else SuperLUFactor
    try:
        with caplog.at_level(logging.WARNING, "coneflat"):
            assert [solvers.solver_for(MIN_PARDISO_UNKNOWNS) for _ in range(2)] == [expected, expected]
    finally:
        solvers.solver.cache_clear()
    (record,) = caplog.records
    assert record.getMessage().startswith("coneflat: pypardiso cannot be loaded, others solve instead: ")
    assert "\n" not in record.getMessage()


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
@pytest.mark.parametrize("listed_files", [None, ()])
def test_mkl_is_found_without_package_metadata(monkeypatch, listed_files):
    def files(name):
        if listed_files is None:
            raise pardiso.metadata.PackageNotFoundError(name)
        return listed_files

    usual = pardiso._library()
    monkeypatch.setattr(pardiso.metadata, "files", files)
    assert pardiso._library()["pardiso"] is not None
    assert usual["pardiso"] is not None


@pytest.mark.slow
@needs_pardiso
def test_the_number_of_threads_changes_nothing_but_rounding(monkeypatch):
    monkeypatch.setenv(SOLVER_VARIABLE, "pardiso")
    vertices, faces = shapes.sphere(4)
    one_thread, three_threads, again = (flatten(vertices, faces, threads=n, max_cones=4) for n in (1, 3, 3))
    assert one_thread.cones.tolist() == three_threads.cones.tolist()
    assert one_thread.log_scale == pytest.approx(three_threads.log_scale, abs=1e-9)
    assert np.array_equal(three_threads.uv, again.uv)


@needs_pardiso
def test_a_factor_uses_the_threads_of_its_analysis(matrix, monkeypatch):
    thread_counts, call = [], pardiso._pardiso
    monkeypatch.setattr(
        pardiso,
        "_pardiso",
        lambda kind, count, *arguments: thread_counts.append(count) or call(kind, count, *arguments),
    )
    with limit_threads(3):
        factor = PardisoFactor(matrix)
    with limit_threads(1):
        factor = factor.refactorized(2 * matrix)
        factor.solve(np.ones(matrix.shape[0]))
    assert set(thread_counts) == {3}
    assert len(thread_counts) > 3


class Heap(ctypes.Structure):
    """What the C library tells of its memory."""

    _fields_ = tuple(
        (name, ctypes.c_size_t)
        for name in ("arena", "free_chunks", "fast", "maps", "mapped", "_", "__", "in_use", "free", "top")
    )


@needs_pardiso
def test_new_patterns_do_not_leak_memory(matrix):
    try:
        tell = ctypes.CDLL("libc.so.6").mallinfo2
    except (OSError, AttributeError):
        pytest.skip("needs the C library of GNU to tell how much memory is used")
    tell.restype = Heap
    right, in_use = np.ones(matrix.shape[0]), []
    factor = PardisoFactor(matrix)
    for _ in range(60):
        # Another array of indices may be of another pattern.
        factor = factor.refactorized(matrix.copy())
        in_use.append(tell().in_use + tell().mapped)
    np.testing.assert_array_equal(factor.solve(right), PardisoFactor(matrix).solve(right))
    # An analysis takes more than the matrix does.
    assert max(in_use[10:]) - in_use[10] < 5 * matrix.data.nbytes


@pytest.mark.parametrize("count", [0, -1, 1.5, 257, "many"])
def test_invalid_numbers_of_threads_are_errors(count):
    with pytest.raises(errors.OptionError, match="threads must be"):
        flatten(*shapes.sphere(1), threads=count)
