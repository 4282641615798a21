"""Check of the free memory before long computations; without it, the system may kill the process silently."""

from __future__ import annotations

from pathlib import Path

from ..errors import TooLargeError

# Peak memory of a flattening in bytes per triangle, measured on five and ten million triangles. A search that tries
# many cones needs more, so the check accepts some meshes that do not fit.
BYTES_PER_TRIANGLE = 1400
# Number of bytes from which the memory is checked: small meshes are not slowed down.
CHECKED_BYTES = 10**9
CGROUP = Path("/sys/fs/cgroup")


def check_memory(triangles: int) -> None:
    """Raise TooLargeError if a flattening of this number of triangles does not fit into the free memory.

    Raises:
        TooLargeError: the message has both sizes.
    """
    require_memory(triangles * BYTES_PER_TRIANGLE, f"{triangles:,} triangles need")


def require_memory(needed: float, purpose: str) -> None:
    """Raise TooLargeError if a number of bytes does not fit into the free memory; not for less than a gigabyte.

    Raises:
        TooLargeError: the message has both sizes after `purpose`, such as "a grid needs".
    """
    if needed > CHECKED_BYTES and needed > (free := free_memory()):
        raise TooLargeError(f"{purpose} about {_size(needed)} of memory, but {_size(free)} are free")


def free_memory() -> float:
    """Return the number of bytes that this process may still allocate, including swap space."""
    import psutil

    free = float(psutil.virtual_memory().available + psutil.swap_memory().free)
    try:
        # The limit of a container; the file contains "max" if there is no limit.
        limit, used_bytes = (
            int((CGROUP / f"memory.{file_name}").read_text()) for file_name in ("max", "current")
        )
    except (OSError, ValueError):
        return free
    return min(free, float(limit - used_bytes))


def _size(count: float) -> str:
    return f"{count / 1e9:.3g} GB"
