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

from ...files.atomic import remove_unfinished
from .jobs import Job

# Each process computes on one core: there are as many processes as cores.
ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"), "1"
)

COMMAND = [sys.executable, "-m", "coneflat.apps.batch.child"]
# Seconds between attempts to end processes: one may just be starting.
PAUSE = 0.05


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
                time.sleep(PAUSE)
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
        timer = threading.Timer(limit, process.kill) if limit is not None else None
        line = ""
        if timer is not None:
            timer.start()
        assert process.stdin is not None
        assert process.stdout is not None
        with suppress(OSError):  # It may die before it takes the job.
            process.stdin.write(job.as_json() + "\n")
            process.stdin.flush()
            line = process.stdout.readline()
        if timer is not None:
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
