"""Jobs of the worker that somebody waits for: files, quads and curves. Flattenings are not among them."""

from __future__ import annotations

from typing import NamedTuple

from ...errors import StudioError
from .worker import Head

#: Jobs that report progress, and that a later flattening cancels.
LONG_JOBS = ("quads", "curve")


class Cancelled(StudioError):
    """The user has cancelled a job."""


class MadeQuads(NamedTuple):
    """The quads that were computed last.

    Attributes:
        number: number of quad meshes computed so far.
        job: number of the flattening of the choices for which they were computed; -1 if there are none.
        page: their page, HTML.
    """

    number: int = 0
    job: int = -1
    page: bytes = b""


class Requests:
    """The answers to jobs by their numbers, which are negative, unlike those of flattenings."""

    def __init__(self) -> None:
        self._count = 0
        self._answers: dict[int, tuple[Head, bytes]] = {}
        self._kinds: dict[int, str] = {}
        self._progress: dict[int, Head] = {}

    def begin(self, kind: str) -> int:
        """Return the number of a new job of a kind."""
        self._count -= 1
        self._kinds[self._count] = kind
        self._answers[self._count] = ({}, b"")
        return self._count

    def take(self, head: Head, body: bytes) -> bool:
        """Store a message of the worker if it is on a job, and return whether it is."""
        is_known = head["job"] in self._answers
        if is_known and "stage" in head:
            self._progress[head["job"]] = {**head, "kind": self._kinds[head["job"]]}
        elif is_known:
            self._answers[head["job"]] = (head, body)
        return is_known

    @property
    def running(self) -> Head | None:
        """Return the progress of the job that is running: its number and kind, the stage, the fraction; or None."""
        return next(iter(self._progress.values()), None)

    def fail(self, message: str) -> None:
        """Answer all jobs with an error."""
        for job in self._answers:
            self._answers[job] = ({"error": message}, b"")

    def is_answered(self, job: int) -> bool:
        """Return whether there is an answer to a job."""
        return bool(self._answers[job][0])

    def end(self, job: int) -> tuple[Head, bytes]:
        """Return the answer to a job, and forget it; the head is empty if there is none."""
        self._progress.pop(job, None)
        del self._kinds[job]
        return self._answers.pop(job)
