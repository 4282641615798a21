"""Threads: the number that libraries may use, and a second thread for parts of a stage that can run concurrently."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar, copy_context
from functools import cache
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

Result = TypeVar("Result")

# Number of triangles above which memory limits the computation.
MEMORY_BOUND_TRIANGLES = 3_000_000
# Default number of threads. It is the same on every machine, because the last digits of results depend on it.
THREADS = 2

_threads: ContextVar[int] = ContextVar("coneflat_threads", default=THREADS)


@contextmanager
def concurrently(call: Callable[[], Result], triangles: int) -> Iterator[Future[Result]]:
    """Run a function on another thread during the block, and yield its future.

    If the mesh is small, or huge, because both together would need too much memory, or if only one thread may be used,
    the function finishes before the block starts. The function and the block must not share data that either modifies.
    Compiled loops, factorizations and most of NumPy release the interpreter lock.
    """
    # On small meshes both would mostly wait for the interpreter lock, and starting a thread takes 0.1 ms.
    if threads() == 1 or not 2_000 <= triangles <= MEMORY_BOUND_TRIANGLES:
        yield _finished(call)
        return
    with ThreadPoolExecutor(1, thread_name_prefix="coneflat") as executor:
        yield executor.submit(copy_context().run, call)


def _finished(call: Callable[[], Result]) -> Future[Result]:
    """Return the future of a call that has finished; as on another thread, its exception is raised by `result`."""
    future = Future[Result]()
    try:
        future.set_result(copy_context().run(call))
    except Exception as error:
        future.set_exception(error)
    return future


def threads() -> int:
    """Return the number of threads that may be used."""
    return _threads.get()


@contextmanager
def limit_threads(count: int = THREADS) -> Iterator[None]:
    """Set the number of threads in the block: PARDISO uses all, the stages at most two, and OpenBLAS one.

    The dense matrices here are so small that threads of OpenBLAS gain nothing. Idle, they would occupy the cores by
    spinning, and everything else would take a third longer.
    """
    token = _threads.set(count)
    try:
        with _openblas().limit(limits=1):
            yield
    finally:
        _threads.reset(token)


@cache
def _openblas() -> ThreadpoolController:
    """Return the controller of the threads of OpenBLAS; cached, because the search for its libraries takes 6 ms."""
    import scipy.linalg  # noqa: F401 - loads its own OpenBLAS, which must be loaded to be controlled
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController().select(internal_api="openblas")
