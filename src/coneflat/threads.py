"""Threads: how many the libraries below use, and one of our own where two stages can share the time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from contextvars import ContextVar, copy_context
from functools import cache, partial
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

Result = TypeVar("Result")

# Triangles from which on memory is what matters, and up to which a thread takes longer to start than it saves.
HUGE, TINY = 3_000_000, 1000
# The same where it is not a stage that another thread takes, but a loop of a few nanoseconds for each of so many.
FEW = 50_000
# How many are used unless told otherwise, on any machine: the last digits depend on it.
THREADS = 2

_threads: ContextVar[int] = ContextVar("coneflat_threads", default=THREADS)
# What the other core is at work on, if it is.
_beside: ContextVar[Future[Any] | None] = ContextVar("coneflat_beside", default=None)


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
def meanwhile(
    call: Callable[[], Result], triangles: int, tiny: int | None = None
) -> Iterator[Future[Result]]:
    """Have something done on another thread while what is inside runs, and yield its future.

    Of a huge mesh, and where there is to be one thread, it is done before, as what both hold in memory would be too
    much; of a tiny one, of up to so many triangles, when its result is asked for.

    Both are the same as one after the other: they share no data that either changes. Compiled loops, factorizations
    and most of numpy leave the interpreter to the other thread.
    """
    if triangles <= (TINY if tiny is None else tiny):
        yield Later(call)
        return
    with ThreadPoolExecutor(1, thread_name_prefix="coneflat") as executor:
        context = copy_context()
        context.run(_beside.set, Future())  # that of the thread which waits for this one
        future = executor.submit(context.run, call)
        if triangles > HUGE or threads() == 1:
            wait([future])
        token = _beside.set(future)
        try:
            yield future
        finally:
            _beside.reset(token)


def in_halves(work: Callable[[int, int], object], count: int) -> None:
    """Have something done for numbers from 0 up to a count, one half on another thread where the other core is idle.

    work: called with the first number and the one after the last; for each it writes to places of its own.
    """
    beside = _beside.get()
    if count <= FEW or (beside is not None and not beside.done()):
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
