"""What fits into memory, asked before long work: later, the system would end the process without a word."""

from __future__ import annotations

from pathlib import Path

from ..errors import TooLargeError

# Triangles from which on it is asked.
CHECKED_TRIANGLES = 1_000_000
# Bytes at the peak of a flattening for each triangle: measured on five and ten million. With cones of which many are
# tried it is more; less is refused than does not fit.
BYTES_PER_TRIANGLE = 1400
CGROUP = Path("/sys/fs/cgroup")


def check_memory(triangles: int) -> None:
    """Raise TooLargeError if no flattening of so many triangles fits into the memory that is free."""
    if triangles < CHECKED_TRIANGLES:
        return
    needed, free = triangles * BYTES_PER_TRIANGLE, free_memory()
    if needed > free:
        raise TooLargeError(
            f"{triangles:,} triangles take about {_size(needed)} of memory, and {_size(free)} are free"
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
