"""The decorator of the compiled loops.

Only what cannot be written as a handful of array operations is compiled (edge flips, breadth-first searches,
sums over corners), beside what uses it, in modules that are imported when first needed: numba takes a while to load.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., object])


def compiled(function: F) -> F:
    """Compile a function of arrays and numbers to machine code, kept on disk between runs.

    Divisions by zero give inf or nan, as in numpy. Results do not depend on the machine's number of cores:
    nothing runs in parallel inside and nothing is reassociated. Other threads of the interpreter go on meanwhile.
    """
    return cast(F, numba.njit(cache=True, nogil=True, error_model="numpy")(function))
