"""Batches in processes on this machine or on a cluster; each process flattens one mesh at a time, with a time limit.

Threads of this process wait for them. Process pools of Python are not used: their processes cannot be ended singly, one
that dies breaks the whole pool, and they import the script of the caller again.
"""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import suppress
from functools import cache, partial
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from ...base import Progress, exit_text, plural, printable
from ...errors import OptionError
from ...io import imported, remove_unfinished
from .jobs import Job

# Each process uses one thread, because there are as many processes as cores.
ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1"
)


def unreported(stage: str, fraction: float) -> None:
    """Report no progress."""


COMMAND = [sys.executable, "-m", "coneflat.apps.batch.child"]


def rows_of_processes(
    jobs: Sequence[Job], processes: int, limit: float | None, progress: Progress = unreported
) -> Iterator[tuple[Job, dict[str, Any]]]:
    """Yield jobs with their rows, in the order in which they end.

    progress: called with a text and the fraction of the meshes that is done, those in work counted by their progress;
        from several threads, one at a time.
    """
    running = Running(len(jobs), progress)
    children = [Child() for _ in range(processes)]
    idle: SimpleQueue[Child] = SimpleQueue()
    for child in children:
        idle.put(child)

    def work(job: Job) -> dict[str, Any]:
        child = idle.get()
        try:
            return child.flatten(job, limit, partial(running.report, job))
        except Exception as error:  # Only this mesh has failed, not the batch.
            child.end()
            return failed(job, f"internal error: {type(error).__name__}: {error}")
        finally:
            running.end(job)
            idle.put(child)

    with ThreadPoolExecutor(processes) as pool:
        futures = {pool.submit(work, job): job for job in jobs}
        try:
            for future in as_completed(futures):
                yield futures[future], future.result()
        finally:
            # This is also reached if the caller stops early or is interrupted.
            pool.shutdown(wait=False, cancel_futures=True)
            while any(future.running() for future in futures):
                for child in children:
                    child.kill()
                time.sleep(0.05)  # seconds; a process may be starting
            for child in children:
                child.end()


def failed(job: Job, error: str, seconds: float | None = None) -> dict[str, Any]:
    """Return the row of a job that failed."""
    return {
        "mesh": job.mesh,
        "output": job.output,
        "status": "failed",
        "error": error,
        "seconds": seconds,
    }


class Running:
    """The progress of a batch, from that of the meshes in work."""

    def __init__(self, count: int, progress: Progress) -> None:
        """count: number of meshes. progress: called as by `rows_of_processes`."""
        self._count, self._progress = count, progress
        self._lock = threading.Lock()
        self._done = 0
        self._fractions: dict[str, float] = {}

    def report(self, job: Job, stage: str, fraction: float) -> None:
        """Note the progress of a mesh."""
        with self._lock:
            self._fractions[job.output] = fraction
            name = printable(Path(job.mesh).name)
            text = f"{self._done} of {plural(self._count, 'mesh', 'meshes')}; {name}: {stage}"
            self._progress(text, (self._done + sum(self._fractions.values())) / self._count)

    def end(self, job: Job) -> None:
        """Note that a mesh is done, or has failed."""
        with self._lock:
            self._fractions.pop(job.output, None)
            self._done += 1


class Child:
    """A worker process that is started for its first job, and again after it was ended or has died."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[str] | None = None

    def flatten(self, job: Job, limit: float | None, progress: Progress = unreported) -> dict[str, Any]:
        """Return the row of a job; the process is ended if it takes longer than the limit in seconds.

        progress: called with the stage and the fraction of the work on the mesh that is done.
        """
        start = time.perf_counter()
        try:
            process = self._started()
        except OSError as error:  # For example, there is no memory for another process.
            return failed(job, f"no process could be started: {error.strerror or error}")
        assert process.stdin is not None
        assert process.stdout is not None
        row: dict[str, Any] = {}
        with suppress(OSError, ValueError):  # It may die before it reads the job, or while it writes.
            process.stdin.write(job.as_json() + "\n")
            process.stdin.flush()
            while "status" not in (answer := _answer(process, limit, start)):
                if "message" in answer:
                    # The compilation of a kernel begins, which happens once for all meshes: the time starts again.
                    start = time.perf_counter()
                    log_once(answer["level"], answer["message"])
                else:
                    progress(answer["stage"], answer["fraction"])
            row = answer
        seconds = time.perf_counter() - start
        if row:
            return row
        self.end()
        remove_unfinished(job.output)
        if limit is not None and seconds >= limit:
            reason = f"it took longer than {limit:g} s"
        else:
            reason = f"its process {exit_text(process.returncode)}"
        return failed(job, reason, round(seconds, 3))

    def end(self) -> None:
        """End the process in any state; called by the thread that uses it."""
        if self._process is not None:
            self._process.kill()
            # This closes the pipes, which may still contain a job.
            with suppress(OSError, ValueError):
                self._process.communicate()
            self._process = None

    def kill(self) -> None:
        """End the process from another thread; the thread that uses it notices that it has died."""
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


def _answer(process: subprocess.Popen[str], limit: float | None, start: float) -> dict[str, Any]:
    """Return the next line of a worker process, which is ended at its time limit.

    limit, start: seconds for the job, and when it began, as of `time.perf_counter`.

    Raises:
        ValueError: the line is not complete.
    """
    assert process.stdout is not None
    left = threading.TIMEOUT_MAX if limit is None else max(start + limit - time.perf_counter(), 0.0)
    timer = threading.Timer(left, process.kill)
    timer.start()
    try:
        return json.loads(process.stdout.readline())
    finally:
        timer.cancel()


@cache
def log_once(level: int, message: str) -> None:
    """Log a message; all workers send the same ones."""
    logging.getLogger("coneflat").log(level, message)


# Number of times that a mesh is tried again after its worker was lost; the mesh may be the cause of the loss.
RETRIES = 3
# Seconds within which a scheduler must answer; it normally takes a fraction of one.
ANSWER_SECONDS = 4.0

_local = threading.local()


def flatten_here(job: Job, limit: float | None) -> dict[str, Any]:
    """Flatten in a child process, one for each thread of a worker, which is ended at the time limit."""
    if not hasattr(_local, "child"):
        _local.child = Child()
    return _local.child.flatten(job, limit)


def rows_of_cluster(
    jobs: Sequence[Job], address: str, limit: float | None
) -> Iterator[tuple[Job, dict[str, Any]]]:
    """Yield jobs with their rows, in the order in which they end; jobs of lost workers are assigned to others.

    Raises:
        OptionError: no cluster can be reached at the address, or Dask is not installed.
    """
    distributed = imported("distributed", "a Dask cluster needs distributed", '"coneflat[dask]"')
    try:
        _require_scheduler(address)
        client = distributed.Client(address, timeout=ANSWER_SECONDS, set_as_default=False)
    except Exception as error:  # The library raises many types of errors for a wrong address.
        reason = " ".join(str(error).split()) or type(error).__name__
        raise OptionError(f"no Dask scheduler answers at {address}: {reason}") from error
    with client:
        futures = {client.submit(flatten_here, job, limit, pure=False, retries=RETRIES): job for job in jobs}
        try:
            for future in distributed.as_completed(futures, loop=client.loop):
                job = futures[future]
                lost = future.exception()
                if lost is None:
                    yield job, future.result()
                else:
                    yield job, failed(job, f"the cluster failed: {type(lost).__name__}: {lost}")
        finally:
            client.cancel(list(futures))


def _require_scheduler(address: str) -> None:
    """Raise an error if no scheduler answers at an address; a client would keep trying, and fail again when closed."""
    import asyncio

    from distributed.comm import connect

    async def request() -> None:
        comm = await connect(address, timeout=ANSWER_SECONDS)
        try:
            await comm.write({"op": "identity", "reply": True})
            await comm.read()
        finally:
            comm.abort()

    asyncio.run(asyncio.wait_for(request(), ANSWER_SECONDS))
