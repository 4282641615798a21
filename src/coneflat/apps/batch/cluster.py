"""A batch on a Dask cluster."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from typing import Any

from ...errors import OptionError
from .jobs import Job
from .process import Child, failed

# Workers that may be lost under one mesh before it counts as failed: it may be the mesh that kills them.
LOSSES = 3
# Seconds in which a scheduler must answer: one that is there takes a fraction of one.
PATIENCE = 4.0

_own = threading.local()


def flatten_here(job: Job, limit: float | None) -> dict[str, Any]:
    """Flatten in a child process of this thread of a worker, which can be ended at the time limit."""
    if not hasattr(_own, "child"):
        _own.child = Child()
    row: dict[str, Any] = _own.child.flatten(job, limit)
    return row


def rows_of_cluster(
    jobs: Sequence[Job], address: str, limit: float | None
) -> Iterator[tuple[Job, dict[str, Any]]]:
    """Yield jobs with their rows as they are done; work of lost workers is done again by others.

    Raises:
        OptionError: no cluster can be reached at the address, or Dask is not installed.
    """
    try:
        from distributed import Client, as_completed
    except ImportError as error:
        raise OptionError("a Dask cluster needs distributed: pip install 'coneflat[dask]'") from error
    try:
        _require_scheduler(address)
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except Exception as error:  # The library has many ways to fail at an address that is none.
        why = " ".join(str(error).split()) or type(error).__name__
        raise OptionError(f"no Dask scheduler answers at {address}: {why}") from error
    with client:
        futures = {client.submit(flatten_here, job, limit, pure=False, retries=LOSSES): job for job in jobs}
        try:
            for future in as_completed(futures, loop=client.loop):
                job = futures[future]
                lost = future.exception()
                if lost is None:
                    yield job, future.result()
                else:
                    yield job, failed(job, f"the cluster gave up: {type(lost).__name__}: {lost}")
        finally:
            client.cancel(list(futures))


def _require_scheduler(address: str) -> None:
    """Raise an error if no scheduler answers at an address; a client would go on trying, and fail again at the end."""
    import asyncio

    from distributed.comm import connect

    async def knock() -> None:
        comm = await connect(address, timeout=PATIENCE)
        try:
            await comm.write({"op": "identity", "reply": True})
            await comm.read()
        finally:
            comm.abort()

    asyncio.run(asyncio.wait_for(knock(), PATIENCE))
