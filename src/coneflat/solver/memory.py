"""What fits into memory, asked before long work: later, the system would end the process without a word."""

from __future__ import annotations

from pathlib import Path

from ..errors import TooLargeError
from .back_ends import available

# Triangles from which on it is asked.
LARGE = 1_000_000
# Bytes at the peak of a flattening for each triangle, by what solves: measured on five and ten million. With cones of
# which many are tried it is more; less is refused than does not fit.
FACTORIZING, ITERATING = 1400, 1100
CGROUP = Path("/sys/fs/cgroup")


def fitting_solver(triangles: int, name: str) -> str:
    """Return the back end asked for, or "amg" for "auto" where nothing else fits into the memory that is free.

    Args:
        triangles: of the mesh.
        name: the back end, or "auto".

    Raises:
        TooLargeError: no flattening of so many triangles fits.
    """
    if triangles < LARGE:
        return name
    free = free_memory()
    needed = triangles * (ITERATING if name == "amg" else FACTORIZING)
    if needed <= free:
        return name
    iterating = triangles * ITERATING
    fits_iterating = name != "amg" and iterating <= free
    if name == "auto" and fits_iterating and available("amg"):
        return "amg"
    advice = ""
    if fits_iterating:
        how = "by --solver amg" if available("amg") else "by --solver amg (pip install 'coneflat[amg]')"
        advice = f"; about {_size(iterating)} {how}"
    raise TooLargeError(
        f"{triangles:,} triangles take about {_size(needed)} of memory, and {_size(free)} are free{advice}"
    )


def free_memory() -> float:
    """Return the bytes that this process may still take, swap space included."""
    import psutil

    free = float(psutil.virtual_memory().available + psutil.swap_memory().free)
    try:
        # Of a container; the file says max where there is no limit.
        limit, used = (int((CGROUP / f"memory.{what}").read_text()) for what in ("max", "current"))
    except (OSError, ValueError):
        return free
    return min(free, float(limit - used))


def _size(count: float) -> str:
    return f"{count / 1e9:.3g} GB"
