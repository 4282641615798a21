"""The decorator of the compiled loops.

Only what cannot be written as a handful of array operations is compiled (edge flips, breadth-first searches,
sums over corners), beside what uses it, in modules that are imported when first needed: numba takes a while to load.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, ClassVar, TypeVar, cast

import numba
from llvmlite import binding
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.dispatcher import Dispatcher
from numba.core.runtime import rtsys

F = TypeVar("F", bound=Callable[..., object])

# The releases of numba whose way of keeping functions is the one that `Kept` shortens; others go theirs.
KNOWN_RELEASES = ("0.68",)


def compiled(function: F) -> F:
    """Compile a function of arrays and numbers to machine code, kept on disk between runs.

    Divisions by zero give inf or nan, as in numpy. Results do not depend on the machine's number of cores:
    nothing runs in parallel inside and nothing is reassociated. Other threads of the interpreter go on meanwhile.
    """
    is_known = numba.__version__.startswith(KNOWN_RELEASES)
    kernel = numba.njit(cache=not is_known, nogil=True, error_model="numpy")(function)
    if is_known and isinstance(kernel, Dispatcher):
        cast(Any, kernel)._cache = Kept(function)
    return cast(F, kernel)


class _Loader(CompileResultCacheImpl):  # type: ignore[misc]
    """Loads a function's machine code, and leaves for later what only those compiled with it need.

    Attributes:
        later: the libraries of loaded functions, and their code in the form in which others can take it in; None once
            something is compiled.
    """

    later: ClassVar[list[tuple[Any, bytes]] | None] = []

    def rebuild(self, target_context: Any, payload: Any) -> Any:
        """Return the result of a compilation."""
        if _Loader.later is None:
            return super().rebuild(target_context, payload)
        (name, kind, (machine_code, bitcode)), description, *rest = payload
        # Which the code that is left for later would tell.
        target_context.codegen()._engine._defined_symbols.add(description.llvm_cpython_wrapper_name)
        loaded = super().rebuild(
            target_context, ((name, kind, (machine_code, _no_bitcode())), description, *rest)
        )
        _Loader.later.append((loaded.library, bitcode))
        return loaded

    @classmethod
    def load_rest(cls) -> None:
        """Load what was left, as something is to be compiled."""
        later, cls.later = cls.later or [], None
        for library, bitcode in later:
            library._shared_module = binding.parse_bitcode(bitcode)
            library.codegen._engine._load_defined_symbols(library._shared_module)


class Kept(FunctionCache):  # type: ignore[misc]
    """The compiled forms of a function, on disk.

    To load one, numba makes ready for compiling, with all functions that it has a form of, and asks for the processor:
    a tenth of a second, and as much for fifty functions. And each comes with its code before it became the machine's,
    which takes twice as long to load. Here only what has to be compiled waits for that.
    """

    _impl_class = _Loader

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the result of compiling for types of arguments, None if there is none."""
        rtsys.initialize(target_context)  # of which the machine code takes memory
        with self._guard_against_spurious_io_errors():
            found = self._load_overload(sig, target_context)
            if found is not None:
                return found
        _Loader.load_rest()
        return None

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        return super()._index_key(sig, _machine(codegen))


class _Machine:
    """What code is compiled for."""

    def __init__(self, codegen: Any) -> None:
        self._description = codegen.magic_tuple()

    def magic_tuple(self) -> Any:
        """Return what tells it from others."""
        return self._description


_machine = cache(_Machine)


@cache
def _no_bitcode() -> bytes:
    bitcode: bytes = binding.parse_assembly("").as_bitcode()
    return bitcode
