"""Two stages at once."""

from __future__ import annotations

import threading

import pytest

from coneflat.threads import HUGE, TINY, meanwhile

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
