"""How many threads the libraries below use."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Keep OpenBLAS to one thread inside.

    The dense matrices here are small: its threads gain nothing on them, and while they wait for more to do they take
    the cores from everything else, which then takes a third longer. PARDISO keeps its threads.
    """
    import scipy.linalg  # noqa: F401 - comes with a library of its own, which must be there to be told
    from threadpoolctl import ThreadpoolController

    with ThreadpoolController().select(internal_api="openblas").limit(limits=1):
        yield
