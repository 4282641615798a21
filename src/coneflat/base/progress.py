"""Timing and progress of the stages of a computation."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from ..errors import OptionError

#: Called with what is being done and the fraction of the whole that is done.
Progress = Callable[[str, float], None]

_ask: ContextVar[Callable[[], None] | None] = ContextVar("coneflat_ask", default=None)


@contextmanager
def asking(ask: Callable[[], None]) -> Iterator[None]:
    """Have long work inside ask, every few milliseconds and from any thread, whether to go on: who asks may raise."""
    token = _ask.set(ask)
    try:
        yield
    finally:
        _ask.reset(token)


def check_cancelled() -> None:
    """Ask whether to go on, within `asking`."""
    ask = _ask.get()
    if ask is not None:
        ask()


class Stopwatch:
    """A stopwatch per stage that tells a listener what begins.

    Attributes:
        seconds: wall time of each stage so far, in order of first appearance.
        done: fraction of the whole that is done before the part at hand.
        share: fraction of the whole that the part at hand makes up.

    Raises:
        OptionError: the listener cannot be called.
    """

    def __init__(self, progress: Progress | None = None) -> None:
        if progress is not None and not callable(progress):
            raise OptionError(
                f"progress must be a function of a text and a fraction, not {type(progress).__name__}"
            )
        self.seconds: dict[str, float] = {}
        self.done = 0.0
        self.share = 0.0
        self._name = ""
        self._within = 0.0
        self._progress = progress

    @contextmanager
    def __call__(self, name: str, until: float = 0.0) -> Iterator[None]:
        """Time the block as the named stage; stages of one name add up.

        until: roughly the fraction of the part at hand that is done when the stage ends.
        """
        self._name = name
        self.tell()
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start
        self._within = until

    def end_part(self) -> None:
        """Count the part at hand as done."""
        self.done += self.share
        self._within = 0.0

    def tell(self, detail: str = "") -> None:
        """Tell the listener what is being done, with a detail about the stage."""
        if self._progress is not None:
            text = f"{self._name}: {detail}" if detail else self._name
            self._progress(text, min(self.done + self.share * self._within, 1.0))
