"""The decorator of compiled loops.

Only loops that cannot be written as a few array operations are compiled, such as edge flips, breadth-first searches
and sums over corners. They are next to the code that uses them, in modules that are imported when first needed,
because numba takes long to load.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba

from .kernel_cache import KernelCache

F = TypeVar("F", bound=Callable[..., object])

# A wrapper for calls from C, which nobody makes, is a twentieth of the compilation.
OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}


def compiled(function: F) -> F:
    """Return a function of arrays and numbers compiled to machine code, which is cached on disk between runs.

    Divisions by zero give inf or nan, as in NumPy. Results do not depend on the number of cores, because the function
    is not parallelised and floating-point operations are not reassociated. The interpreter lock is released.
    """
    kernel: Any = numba.njit(**OPTIONS)(function)
    kernel._cache = KernelCache(function, OPTIONS)  # type: ignore[arg-type]
    return kernel
