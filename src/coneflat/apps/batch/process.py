"""A batch in processes on this machine, each of which flattens one mesh after the other, with a time limit for each.

Python has the threads that wait for them. The processes are ours, since those of its pools cannot be ended one by one,
take the whole pool down when they die, and run the caller's script once more.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import suppress
from queue import SimpleQueue
from typing import Any

from ...errors import OptionError
from ...io import remove_unfinished
from .jobs import Job

# Each process computes on one core: there are as many processes as cores.
ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1"
)

COMMAND = [sys.executable, "-m", "coneflat.apps.batch.child"]


def rows_of_processes(
    jobs: Sequence[Job], processes: int, limit: float | None
) -> Iterator[tuple[Job, dict[str, Any]]]:
    """Yield jobs with their rows as they are done."""
    children = [Child() for _ in range(processes)]
    idle: SimpleQueue[Child] = SimpleQueue()
    for child in children:
        idle.put(child)

    def work(job: Job) -> dict[str, Any]:
        child = idle.get()
        try:
            return child.flatten(job, limit)
        except Exception as error:  # One mesh has failed, not the batch.
            child.end()
            return failed(job, f"internal error: {type(error).__name__}: {error}")
        finally:
            idle.put(child)

    with ThreadPoolExecutor(processes) as pool:
        futures = {pool.submit(work, job): job for job in jobs}
        try:
            for future in as_completed(futures):
                yield futures[future], future.result()
        finally:
            # Also when the one who asks has had enough, or was interrupted.
            pool.shutdown(wait=False, cancel_futures=True)
            while any(future.running() for future in futures):
                for child in children:
                    child.kill()
                time.sleep(0.05)  # seconds: one may just be starting
            for child in children:
                child.end()


def failed(job: Job, error: str, seconds: float | None = None) -> dict[str, Any]:
    """Return the row of a job that has no result."""
    return {
        "mesh": job.mesh,
        "output": job.output,
        "status": "failed",
        "error": error,
        "seconds": seconds,
    }


def _end_of(code: int) -> str:
    """Return how a process with an exit code ended."""
    if code >= 0:
        return f"ended with code {code}"
    try:
        return f"was ended by {signal.Signals(-code).name}"
    except ValueError:
        return f"was ended by signal {-code}"


class Child:
    """A process that is started when there is something to do, and again after it was ended or has died."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[str] | None = None

    def flatten(self, job: Job, limit: float | None) -> dict[str, Any]:
        """Return the row of a job; a process that takes longer than the limit, seconds, is ended."""
        start = time.perf_counter()
        try:
            process = self._started()
        except OSError as error:  # No memory for another process, say.
            return failed(job, f"no process could be started: {error.strerror or error}")
        timer = threading.Timer(threading.TIMEOUT_MAX if limit is None else limit, process.kill)
        line = ""
        timer.start()
        assert process.stdin is not None
        assert process.stdout is not None
        with suppress(OSError):  # It may die before it takes the job.
            process.stdin.write(job.as_json() + "\n")
            process.stdin.flush()
            line = process.stdout.readline()
        timer.cancel()
        seconds = time.perf_counter() - start
        if line.endswith("\n"):
            with suppress(ValueError):
                row: dict[str, Any] = json.loads(line)
                return row
        self.end()
        remove_unfinished(job.output)
        if limit is not None and seconds >= limit:
            why = f"it took longer than {limit:g} s"
        else:
            why = f"its process {_end_of(process.returncode)}, for want of memory perhaps"
        return failed(job, why, round(seconds, 3))

    def end(self) -> None:
        """End the process, whatever it does; for the thread that uses it."""
        if self._process is not None:
            self._process.kill()
            # Closes the pipes, where a job may still be stuck.
            with suppress(OSError, ValueError):
                self._process.communicate()
            self._process = None

    def kill(self) -> None:
        """End the process from another thread; the one that uses it finds it dead."""
        process = self._process
        if process is not None:
            process.kill()

    def _started(self) -> subprocess.Popen[str]:
        if self._process is None or self._process.poll() is not None:
            self._process = subprocess.Popen(
                COMMAND,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
                encoding="utf-8",
                env={**os.environ, **ONE_THREAD},
            )
        return self._process


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
