"""Threads: how many the libraries below use, and one of our own where two stages can share the time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from contextvars import ContextVar, copy_context
from functools import cache
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

Result = TypeVar("Result")

# Triangles from which on memory is what matters.
MEMORY_BOUND_TRIANGLES = 3_000_000
# How many are used unless told otherwise, on any machine: the last digits depend on it.
THREADS = 2

_threads: ContextVar[int] = ContextVar("coneflat_threads", default=THREADS)


@contextmanager
def concurrently(call: Callable[[], Result], triangles: int) -> Iterator[Future[Result]]:
    """Run a function on another thread while what is inside runs, and yield its future.

    On a huge mesh, and where one thread is to be used, the function returns before the inside begins, as the memory of
    both would be too much. They must not share data that either changes. Compiled loops, factorizations and most of
    numpy release the interpreter lock.
    """
    with ThreadPoolExecutor(1, thread_name_prefix="coneflat") as executor:
        future = executor.submit(copy_context().run, call)
        if triangles > MEMORY_BOUND_TRIANGLES or threads() == 1:
            wait([future])
        yield future


def threads() -> int:
    """Return how many threads may be used here."""
    return _threads.get()


@contextmanager
def using_threads(count: int = THREADS) -> Iterator[None]:
    """Have everything inside use so many threads: PARDISO all, our own stages two at most, and OpenBLAS one.

    The dense matrices here are small: its threads gain nothing on them, and while they wait for more to do they take
    the cores from everything else, which then takes a third longer.
    """
    token = _threads.set(count)
    try:
        with _openblas().limit(limits=1):
            yield
    finally:
        _threads.reset(token)


@cache
def _openblas() -> ThreadpoolController:
    """Return what sets the threads of OpenBLAS; to look for its libraries takes 6 ms."""
    import scipy.linalg  # noqa: F401 - comes with a library of its own, which must be there to be told
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController().select(internal_api="openblas")
