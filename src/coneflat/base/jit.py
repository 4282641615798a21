"""The decorator of compiled loops.

Only loops that cannot be written as a few array operations are compiled, such as edge flips, breadth-first searches
and sums over corners. They are next to the code that uses them, in modules that are imported when first needed,
because numba takes long to load.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., object])


def compiled(function: F) -> F:
    """Return a function of arrays and numbers compiled to machine code, which is cached on disk between runs.

    Divisions by zero give inf or nan, as in NumPy. Results do not depend on the number of cores, because the function
    is not parallelised and floating-point operations are not reassociated. The interpreter lock is released.
    """
    return cast(F, numba.njit(cache=True, nogil=True, error_model="numpy")(function))
