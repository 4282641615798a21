"""Jobs of the worker that somebody waits for: files, quads and curves. Flattenings are not among them."""

from __future__ import annotations

from .worker import Head


class Requests:
    """The answers to jobs by their numbers, which are negative, unlike those of flattenings."""

    def __init__(self) -> None:
        self._count = 0
        self._answers: dict[int, tuple[Head, bytes]] = {}

    def begin(self) -> int:
        """Return the number of a new job."""
        self._count -= 1
        self._answers[self._count] = ({}, b"")
        return self._count

    def take(self, head: Head, body: bytes) -> bool:
        """Store a message of the worker if it is the answer to a job, and return whether it is."""
        is_answer = head["job"] in self._answers and "stage" not in head
        if is_answer:
            self._answers[head["job"]] = (head, body)
        return is_answer

    def fail(self, message: str) -> None:
        """Answer all jobs with an error."""
        for job in self._answers:
            self._answers[job] = ({"error": message}, b"")

    def is_answered(self, job: int) -> bool:
        """Return whether there is an answer to a job."""
        return bool(self._answers[job][0])

    def end(self, job: int) -> tuple[Head, bytes]:
        """Return the answer to a job, and forget it; the head is empty if there is none."""
        return self._answers.pop(job)
