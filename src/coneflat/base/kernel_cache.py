"""The cache of compiled kernels, on disk.

numba's own cache stands beside the sources, which may be read-only, and trusts the time of one file. Here the name of
a cached kernel is a digest of what its machine code depends on: the bytecode and constants of the function and of the
kernels that it calls, the types of the arguments, the options of numba, the processor, and the versions of Python,
numba and numpy. So versions of coneflat, environments and processes can share a folder.
"""

from __future__ import annotations

import hashlib
import logging
import os
import pickle
import stat
import sys
import tempfile
import types
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from enum import EnumMeta
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite
import numba
import numpy as np
import platformdirs
from numba.core.caching import _Cache
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

from ..errors import CacheError
from .progress import report_detail

log = logging.getLogger("coneflat")

#: Environment variable: the folder of cached kernels.
CACHE_VARIABLE = "CONEFLAT_CACHE_DIR"
#: Folder of the package with the kernels of a wheel that was built for one platform.
BUILT_KERNELS = "kernels"
ENDING = ".kernel"
# Modules that kernels may use.
MODULES = ("heapq", "math", "numpy")
# Identifies the format of cached files.
HEADER = b"coneflat kernel 1\n"
DIGEST_SIZE = hashlib.sha256().digest_size
# What the announcement promises: the first `flatten`, wall time on two cores of 2020.
SECONDS_TO_COMPILE = 20


class KernelCache(_Cache):  # type: ignore[misc]
    """The cached machine code of one kernel, for the dispatcher of numba.

    Args:
        function: the kernel.
        options: how numba compiles it.
    """

    def __init__(self, function: types.FunctionType, options: Mapping[str, object]) -> None:
        self._function, self._options = function, sorted(options.items())

    @property
    def cache_path(self) -> str | None:
        """Return the folder that new kernels are written to."""
        folder = writable_folder()
        return None if folder is None else str(folder)

    def load_overload(self, sig: Sequence[Any], target_context: Any) -> Any:
        """Return the compiled kernel for types of arguments, or None if it is not cached."""
        target_context.refresh()
        name = self._file_name(sig, target_context.codegen())
        for folder in readable_folders():
            payload = read_kernel(folder / name)
            if payload is not None:
                try:
                    kernel = CompileResult._rebuild(target_context, *pickle.loads(payload))
                except Exception as error:
                    log.debug("coneflat: %s cannot be used: %r", folder / name, error)
                    continue
                _copy_to_chosen(folder, name, payload)
                return kernel
        compilation.begin(self._function.__name__)
        return None

    def save_overload(self, sig: Sequence[Any], data: Any) -> None:
        """Write a compiled kernel for types of arguments; without a writable folder it is kept in memory only."""
        compilation.count += 1
        folder = writable_folder()
        if folder is None or data.library.has_dynamic_globals:
            return
        path, payload = folder / self._file_name(sig, data.codegen), dumps(data._reduce())
        try:
            write_kernel(path, payload)
        except OSError as error:
            # On Windows, a file that another process reads cannot be replaced.
            if read_kernel(path) is None:
                compilation.report_unwritten(folder, error)

    def enable(self) -> None:
        """Do nothing: the cache is always enabled."""

    def disable(self) -> None:
        """Do nothing: the cache is always enabled."""

    def flush(self) -> None:
        """Do nothing: cached kernels are never out of date."""

    def _file_name(self, sig: Sequence[Any], codegen: Any) -> str:
        versions = (sys.implementation.cache_tag, numba.__version__, llvmlite.__version__, np.__version__)
        key = (
            HEADER,
            kernel_digest(self._function),
            self._options,
            str(sig),
            codegen.magic_tuple(),
            versions,
        )
        return f"{self._function.__name__}-{_digest(key)[:40]}{ENDING}"


class Compilation:
    """Count of the kernels that this process compiles, announced in one line.

    Attributes:
        count: number of kernels compiled so far.
        unwritten: why they cannot be written; empty if they are.
    """

    def __init__(self) -> None:
        self.count, self.unwritten = 0, ""
        self._is_announced = False

    def begin(self, name: str) -> None:
        """Report that a kernel is compiled."""
        if not self._is_announced:
            self._is_announced = True
            log.warning("coneflat: compiling, %s: up to about %d s", _where(), SECONDS_TO_COMPILE)
        log.info("coneflat: compiling %s", name)
        report_detail(f"compiling ({self.count + 1}: {name})")

    def report_unwritten(self, folder: Path, error: OSError) -> None:
        """Report that compiled kernels cannot be written, once."""
        if not self.unwritten:
            self.unwritten = error.strerror or str(error)
            log.warning(
                "coneflat: compiled kernels cannot be written to %s (%s), and are compiled again in the next process; "
                "%s names another folder",
                folder,
                self.unwritten,
                CACHE_VARIABLE,
            )


compilation = Compilation()


def readable_folders() -> Iterator[Path]:
    """Yield the folders that may contain kernels: those of the package first, then the user's."""
    yield Path(__file__).parent.parent / BUILT_KERNELS
    for folder in _user_folders():
        if _is_trusted(folder):
            yield folder


@cache
def writable_folder() -> Path | None:
    """Return the first folder in which kernels can be written; None if there is none."""
    for folder in _user_folders():
        with suppress(OSError):
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            # os.access does not know of read-only and full file systems.
            with tempfile.TemporaryFile(dir=folder) as file:
                file.write(HEADER)
            if _is_trusted(folder):
                return folder
    return None


def cache_folder() -> Path:
    """Return the folder in which kernels are cached: that of the environment variable, if it is set.

    Raises:
        CacheError: it is not writable.
    """
    folder, chosen = writable_folder(), _chosen_folder()
    if folder is None or (chosen is not None and folder != chosen):
        candidates = map(str, _user_folders() if chosen is None else [chosen])
        raise CacheError(
            f"no cache folder is writable (tried: {', '.join(candidates)}); set {CACHE_VARIABLE} to one that is"
        )
    return folder


def _where() -> str:
    folder = writable_folder()
    if folder is not None:
        return f"once, as the result is cached in {folder}"
    return f"in every process, as no cache folder is writable ({CACHE_VARIABLE} names another one)"


def _chosen_folder() -> Path | None:
    path = os.environ.get(CACHE_VARIABLE)
    return Path(path).absolute() if path else None


def _user_folders() -> Iterator[Path]:
    """Yield the folder of the environment variable, the user's cache folder, and a temporary one."""
    chosen = _chosen_folder()
    if chosen is not None:
        yield chosen
    with suppress(RuntimeError):  # The user has no home.
        # A home that does not exist must not be made here.
        if os.environ.get("XDG_CACHE_HOME") or Path("~").expanduser().is_dir():
            yield platformdirs.user_cache_path("coneflat", appauthor=False).absolute()
    user = f"-{os.getuid()}" if hasattr(os, "getuid") else ""
    with suppress(OSError):  # No temporary folder is writable.
        yield Path(tempfile.gettempdir()) / f"coneflat{user}"


def _is_trusted(folder: Path) -> bool:
    """Return whether a folder exists, and nobody else can write to it; machine code is loaded from it.

    The folder of the environment variable is trusted.
    """
    try:
        status = folder.lstat()
    except OSError:
        return False
    if folder == _chosen_folder() or not hasattr(os, "getuid"):
        return True
    is_shared = status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    return stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and not is_shared


def read_kernel(path: Path) -> bytes | None:
    """Return the content of a cached kernel; None if there is none, or a damaged one."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    start = len(HEADER) + DIGEST_SIZE
    payload = content[start:]
    if content[:start] == HEADER + hashlib.sha256(payload).digest():
        return payload
    log.warning("coneflat: %s is damaged and is compiled again", path)
    return None


def write_kernel(path: Path, payload: bytes) -> None:
    """Write a kernel, at once: processes that run at the same time see a complete file or none.

    Raises:
        OSError: it cannot be written.
    """
    descriptor, temporary = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
    try:
        with open(descriptor, "wb") as file:
            file.write(HEADER + hashlib.sha256(payload).digest() + payload)
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except OSError:
        with suppress(OSError):
            os.unlink(temporary)
        raise


def _copy_to_chosen(folder: Path, name: str, payload: bytes) -> None:
    """Copy a kernel to the folder of the environment variable, which is to contain all that is needed."""
    chosen = _chosen_folder()
    if chosen in (None, folder) or chosen != writable_folder() or (chosen / name).exists():
        return
    with suppress(OSError):
        write_kernel(chosen / name, payload)


@cache
def kernel_digest(function: types.FunctionType) -> str:
    """Return a digest of what a kernel computes: its code, and the constants and kernels that it refers to.

    Raises:
        TypeError: it refers to an object whose value has no digest, or is a closure.
    """
    if function.__closure__:
        raise TypeError(f"{function.__qualname__} is compiled and a closure, which has no digest")
    code, values = function.__code__, function.__globals__
    names = sorted({name for part in _codes(code) for name in part.co_names})
    referred = [(name, _describe(values[name], function)) for name in names if name in values]
    return _digest((_describe_code(code, function.__doc__), repr(function.__defaults__), referred))


def _codes(code: types.CodeType) -> Iterator[types.CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _codes(constant)


def _describe_code(code: types.CodeType, documentation: str | None = None) -> Any:
    constants = [
        _describe_code(constant) if isinstance(constant, types.CodeType) else repr(constant)
        for constant in code.co_consts
        if constant is None or constant != documentation
    ]
    return code.co_code.hex(), code.co_names, code.co_varnames, constants


def _describe(value: object, user: types.FunctionType) -> str:
    """Return what identifies the value of a global name that a kernel uses."""
    if hasattr(value, "py_func"):
        return "itself" if value.py_func is user else kernel_digest(value.py_func)
    if isinstance(value, tuple):
        return repr([_describe(part, user) for part in value])
    if isinstance(value, (bool, int, float, complex, str, bytes, type(None))):
        return repr(value)
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {value.shape} {value.tobytes().hex()}"
    if isinstance(value, EnumMeta):
        return repr(list(value))
    # Constants of other modules would be compiled in.
    if isinstance(value, types.ModuleType) and value.__name__ in MODULES:
        return value.__name__
    if callable(value) and not isinstance(value, types.ModuleType):
        return f"{getattr(value, '__module__', '')}.{getattr(value, '__qualname__', value)!s}"
    raise TypeError(f"{user.__qualname__} is compiled and refers to {value!r}, which has no digest")


def _digest(value: object) -> str:
    return hashlib.sha256(repr(value).encode()).hexdigest()
