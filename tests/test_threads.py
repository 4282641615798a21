"""Two stages at once."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from coneflat.threads import FEW, HUGE, TINY, in_halves, meanwhile, using_threads

SIZES = {"tiny": TINY, "usual": TINY + 1, "huge": HUGE + 1}


@pytest.mark.parametrize("size", SIZES)
def test_results_and_errors_come_when_asked_for(size):
    with meanwhile(lambda: 7, SIZES[size]) as working:
        assert working.result() == 7
        assert working.result() == 7
    with meanwhile(lambda: 1 // 0, SIZES[size]) as working, pytest.raises(ZeroDivisionError):
        working.result()


def test_only_what_is_large_has_a_thread():
    name = {}
    for size, triangles in SIZES.items():
        with meanwhile(lambda: threading.current_thread().name, triangles) as working:
            name[size] = working.result()
    assert name["tiny"] == threading.current_thread().name
    assert name["usual"].startswith("coneflat")
    assert name["huge"].startswith("coneflat")


def workers(count):
    """The threads that two halves of a loop ran on, after a look at what they wrote."""
    places, names = np.zeros(count), set()

    def fill(start, stop):
        places[start:stop] += np.arange(start, stop)
        names.add(threading.current_thread().name)

    in_halves(fill, count)
    assert np.array_equal(places, np.arange(count))
    return names


def test_halves_make_a_whole():
    own = threading.current_thread().name
    assert workers(3) == {own}
    assert workers(FEW) == {own}
    assert len(workers(FEW + 1) - {own}) == 1
    with using_threads(1):
        assert len(workers(FEW + 1) - {own}) == 1  # one after the other


def test_there_is_no_third_thread():
    go_on = threading.Event()
    with meanwhile(go_on.wait, TINY + 1) as waiting:
        busy = workers(FEW + 1)
        go_on.set()
        waiting.result()
        idle = workers(FEW + 1)
    assert busy == {threading.current_thread().name}
    assert len(idle) == 2
    with meanwhile(lambda: workers(FEW + 1), TINY + 1) as working:
        inside = working.result()
    assert len(inside) == 1
    assert inside != busy


def test_errors_of_either_half_are_raised():
    for bad in (0, FEW):

        def work(start, stop, bad=bad):
            if start <= bad < stop:
                raise ZeroDivisionError

        with pytest.raises(ZeroDivisionError):
            in_halves(work, FEW + 1)
