"""Timing and progress of the stages of a computation."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Progress = Callable[[str, float], None]


class Stages:
    """A stopwatch per stage that tells a listener what begins.

    Attributes:
        seconds: wall time of each stage so far, in order of first appearance.
    """

    def __init__(self, progress: Progress | None = None) -> None:
        self.seconds: dict[str, float] = {}
        self.fraction = 0.0
        self._progress = progress

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        """Time the block as the named stage; stages of one name add up."""
        if self._progress is not None:
            self._progress(name, self.fraction)
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start
