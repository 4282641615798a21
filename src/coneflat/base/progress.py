"""Timing and progress of the stages of a computation."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from ..errors import OptionError

#: Called with a text on the current step and the fraction of the total work that is done.
Progress = Callable[[str, float], None]

_ask: ContextVar[Callable[[], None] | None] = ContextVar("coneflat_ask", default=None)
_stage: ContextVar[Stopwatch | None] = ContextVar("coneflat_stage", default=None)


@contextmanager
def cancel_with(ask: Callable[[], None]) -> Iterator[None]:
    """Call `ask` every few milliseconds during long computations in the block, from any thread.

    `ask` cancels the computation by raising an exception.
    """
    token = _ask.set(ask)
    try:
        yield
    finally:
        _ask.reset(token)


def check_cancelled() -> None:
    """Call the function that `cancel_with` has set, if any; it raises an exception to cancel the computation."""
    ask = _ask.get()
    if ask is not None:
        ask()


def report_detail(detail: str) -> None:
    """Report a detail of the stage that is running, if its progress is reported at all."""
    watch = _stage.get()
    if watch is not None:
        watch.report(detail)


class Stopwatch:
    """Timer of the stages, which also reports progress to a callback.

    Attributes:
        seconds: wall time of each stage so far, in order of first appearance.
        done: fraction of the total work that was done before the current component.
        share: fraction of the total work of the current component.
        component: which component it is, for the progress; empty if there is only one.

    Raises:
        OptionError: `progress` is not callable.
    """

    def __init__(self, progress: Progress | None = None) -> None:
        if progress is not None and not callable(progress):
            raise OptionError(
                f"progress must be a function of a text and a fraction, got {type(progress).__name__}"
            )
        self.seconds: dict[str, float] = {}
        self.done = self.share = self._within = 0.0
        self.component = self._name = ""
        self._progress = progress

    @contextmanager
    def __call__(self, name: str, until: float = 0.0) -> Iterator[None]:
        """Time the block as the named stage; the times of stages of the same name are added.

        until: approximate fraction of the current component that is done when the stage ends.
        """
        self._name = name
        self.report()
        start = time.perf_counter()
        token = _stage.set(self)
        try:
            yield
        finally:
            _stage.reset(token)
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start
        self._within = until

    def end_component(self) -> None:
        """Count the current component as done."""
        self.done += self.share
        self._within, self.component = 0.0, ""

    def report(self, detail: str = "") -> None:
        """Report the current stage and the fraction done to the callback, with an optional detail."""
        if self._progress is not None:
            place = ", ".join(filter(None, [self._name, self.component]))
            self._progress(
                f"{place}: {detail}" if detail else place, min(self.done + self.share * self._within, 1.0)
            )
