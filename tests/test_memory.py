"""What does not fit into memory is refused before the work, with numbers."""

from __future__ import annotations

import pytest
import shapes

import coneflat
from coneflat.errors import ConeflatError, TooLargeError
from coneflat.solver import memory
from coneflat.solver.memory import FACTORIZING, ITERATING, LARGE, fitting_solver, free_memory


def free(monkeypatch, count, has_amg=True):
    monkeypatch.setattr(memory, "free_memory", lambda: float(count))
    monkeypatch.setattr(memory, "available", lambda name: has_amg or name != "amg")


def test_small_meshes_are_not_asked(monkeypatch):
    free(monkeypatch, 0)
    assert fitting_solver(LARGE - 1, "auto") == "auto"


def test_what_fits_is_taken(monkeypatch):
    free(monkeypatch, FACTORIZING * LARGE)
    assert fitting_solver(LARGE, "auto") == "auto"
    assert fitting_solver(LARGE, "pardiso") == "pardiso"


def test_where_only_iteration_fits_it_is_taken(monkeypatch):
    free(monkeypatch, ITERATING * LARGE)
    assert fitting_solver(LARGE, "auto") == "amg"
    assert fitting_solver(LARGE, "amg") == "amg"
    with pytest.raises(
        TooLargeError, match=r"^1,000,000 triangles take about 1.4 GB of memory.*--solver amg$"
    ):
        fitting_solver(LARGE, "pardiso")
    free(monkeypatch, ITERATING * LARGE, has_amg=False)
    with pytest.raises(TooLargeError, match=r"pip install 'coneflat\[amg\]'"):
        fitting_solver(LARGE, "auto")


def test_what_never_fits(monkeypatch):
    free(monkeypatch, 2e9)
    with pytest.raises(TooLargeError) as raised:
        fitting_solver(30_000_000, "auto")
    assert str(raised.value) == "30,000,000 triangles take about 42 GB of memory, and 2 GB are free"
    assert isinstance(raised.value, ConeflatError)
    assert isinstance(raised.value, MemoryError)


def test_a_flattening_is_refused(monkeypatch):
    free(monkeypatch, 1e5)
    monkeypatch.setattr(memory, "LARGE", 100)
    with pytest.raises(TooLargeError, match="320 triangles"):
        coneflat.flatten(*shapes.sphere(2))


def test_free_memory_is_that_of_the_container(monkeypatch, tmp_path):
    monkeypatch.setattr(memory, "CGROUP", tmp_path)
    whole = free_memory()
    assert whole > 0
    (tmp_path / "memory.current").write_text("1000\n")
    (tmp_path / "memory.max").write_text("max\n")
    assert free_memory() == pytest.approx(whole, rel=0.5)
    (tmp_path / "memory.max").write_text("5000\n")
    assert free_memory() == 4000
