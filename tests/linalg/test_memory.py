"""What does not fit into memory is refused before the work, with numbers."""

from __future__ import annotations

import pytest
import shapes

import coneflat
from coneflat.errors import ConeflatError, TooLargeError
from coneflat.linalg import memory
from coneflat.linalg.memory import BYTES_PER_TRIANGLE, CHECKED_BYTES, check_memory, free_memory


def free(monkeypatch, count):
    monkeypatch.setattr(memory, "free_memory", lambda: float(count))


def test_small_meshes_are_not_checked(monkeypatch):
    free(monkeypatch, 0)
    check_memory(CHECKED_BYTES // BYTES_PER_TRIANGLE)


def test_meshes_that_fit_are_accepted(monkeypatch):
    count = CHECKED_BYTES // BYTES_PER_TRIANGLE + 1
    free(monkeypatch, BYTES_PER_TRIANGLE * count)
    check_memory(count)


def test_meshes_that_do_not_fit_are_refused(monkeypatch):
    free(monkeypatch, 2e9)
    with pytest.raises(TooLargeError) as raised:
        check_memory(30_000_000)
    assert str(raised.value) == "30,000,000 triangles need about 42 GB of memory, but 2 GB are free"
    assert isinstance(raised.value, ConeflatError)
    assert isinstance(raised.value, MemoryError)


def test_flatten_checks_the_memory(monkeypatch):
    free(monkeypatch, 1e5)
    monkeypatch.setattr(memory, "CHECKED_BYTES", 100)
    with pytest.raises(TooLargeError, match="320 triangles"):
        coneflat.flatten(*shapes.sphere(2))


def test_free_memory_is_that_of_the_container(monkeypatch, tmp_path):
    monkeypatch.setattr(memory, "CGROUP", tmp_path)
    unlimited = free_memory()
    assert unlimited > 0
    (tmp_path / "memory.current").write_text("1000\n")
    (tmp_path / "memory.max").write_text("max\n")
    assert free_memory() == pytest.approx(unlimited, rel=0.5)
    (tmp_path / "memory.max").write_text("5000\n")
    assert free_memory() == 4000
