"""The queue of jobs of the worker process, which also tells whether the one that is running is obsolete."""

from __future__ import annotations

import threading
from collections import deque
from typing import IO

from .worker import Head, read_frame


class Superseded(Exception):
    """A newer flattening has been requested, or the user has cancelled the job."""


class Jobs:
    """The queue of jobs; of several flattenings, only the newest is kept."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream
        self._waiting: deque[Head] = deque()
        self._changed = threading.Condition()
        self._newest = -1
        self._cancelled: set[int] = set()
        self._is_closed = False
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        while (frame := read_frame(self._stream)) is not None:
            job = frame[0]
            with self._changed:
                if job["do"] == "cancel":
                    self._cancelled.add(job["job"])
                    continue
                if job["do"] == "flatten":
                    self._newest = job["job"]
                    self._waiting = deque(waiting for waiting in self._waiting if waiting["do"] != "flatten")
                self._waiting.append(job)
                self._changed.notify()
        with self._changed:
            self._is_closed = True
            self._changed.notify()

    def next(self) -> Head | None:
        """Return the next job; None after the last one."""
        with self._changed:
            self._changed.wait_for(lambda: self._waiting or self._is_closed)
            return None if self._is_closed else self._waiting.popleft()

    def is_cancelled(self, job: Head) -> bool:
        """Return whether the user has cancelled a job."""
        return job["job"] in self._cancelled

    def is_stale(self, job: Head) -> bool:
        """Return whether a job is obsolete: cancelled, or followed by a flattening of other choices."""
        number = job["job"]
        newest = job.get("after", number if job["do"] == "flatten" else self._newest)
        return self._is_closed or self.is_cancelled(job) or newest != self._newest
