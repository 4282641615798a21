"""Two stages at once."""

from __future__ import annotations

import threading

import pytest

from coneflat.base.threads import MEMORY_BOUND_TRIANGLES, concurrently, limit_threads


@pytest.mark.parametrize("triangles", [1, MEMORY_BOUND_TRIANGLES + 1])
def test_results_and_errors_come_when_asked_for(triangles):
    with concurrently(lambda: 7, triangles) as working:
        assert working.result() == 7
        assert working.result() == 7
    with concurrently(lambda: 1 // 0, triangles) as working, pytest.raises(ZeroDivisionError):
        working.result()


@pytest.mark.parametrize(("triangles", "count"), [(10_000, 1), (100, 2), (MEMORY_BOUND_TRIANGLES + 1, 2)])
def test_on_one_thread_and_on_small_or_huge_meshes_the_inside_begins_afterwards(triangles, count):
    begun = threading.Event()
    with limit_threads(count), concurrently(begun.is_set, triangles) as working:
        begun.set()
        assert working.done()
    assert not working.result()


def test_two_calls_run_at_the_same_time():
    begun = threading.Event()
    with concurrently(begun.wait, 10_000) as working:
        assert not working.done()
        begun.set()
    assert working.result()
