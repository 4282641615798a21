"""Threads: how many the libraries below use, and one of our own where two stages can share the time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from contextvars import ContextVar, copy_context
from functools import cache, partial
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

Result = TypeVar("Result")

# Triangles from which on memory is what matters, and up to which a thread takes longer to start than it saves.
HUGE, TINY = 3_000_000, 1000
# How many are used unless told otherwise, on any machine: the last digits depend on it.
THREADS = 2

_threads: ContextVar[int] = ContextVar("coneflat_threads", default=THREADS)
# Whether this is done beside something else.
_is_beside: ContextVar[bool] = ContextVar("coneflat_is_beside", default=False)


class Later(Future[Result]):
    """What is done when it is asked for."""

    def __init__(self, call: Callable[[], Result]) -> None:
        super().__init__()
        self._call = call

    def result(self, timeout: float | None = None) -> Result:
        """Return what comes of it."""
        if not self.done():
            try:
                self.set_result(self._call())
            except Exception as error:
                self.set_exception(error)
        return super().result(timeout)


@contextmanager
def meanwhile(call: Callable[[], Result], triangles: int) -> Iterator[Future[Result]]:
    """Have something done on another thread while what is inside runs, and yield its future.

    Of a huge mesh, and where there is to be one thread, it is done before, as what both hold in memory would be too
    much; of a tiny one when its result is asked for.

    Both are the same as one after the other: they share no data that either changes. Compiled loops, factorizations
    and most of numpy leave the interpreter to the other thread.
    """
    if triangles <= TINY:
        yield Later(call)
        return
    with ThreadPoolExecutor(1, thread_name_prefix="coneflat") as executor:
        context = copy_context()
        context.run(_is_beside.set, True)
        future = executor.submit(context.run, call)
        if triangles > HUGE or threads() == 1:
            wait([future])
        yield future


def in_halves(work: Callable[[int, int], object], count: int) -> None:
    """Have something done for numbers from 0 up to a count, one half of them on another thread.

    work: called with the first number and the one after the last; for each it writes to places of its own.
    """
    if _is_beside.get():  # the other core is at work
        work(0, count)
        return
    with meanwhile(partial(work, 0, count // 2), count) as first:
        work(count // 2, count)
        first.result()


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
