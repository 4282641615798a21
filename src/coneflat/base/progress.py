"""Timing, progress and cancellation: a stage reports to the stopwatch of its context, which is set once at the top."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from ..errors import OptionError
from .search_time import check_time

#: Called with a text on the current step and the fraction of the total work that is done.
Progress = Callable[[str, float], None]

# Approximate fraction of the work on a component that is done when a stage ends. Layouts of all components are computed
# first ("layout" ends this work), then finished ("atlas" ends that).
DONE_AFTER = {"cones": 0.5, "metric": 0.8, "cut": 0.9, "layout": 1.0, "relax": 0.2, "atlas": 1.0}

# Fraction of what is left of a part of the work that counts as done after a step of an iteration, and the seconds
# between reports of steps.
STEP_SHARE, STEP_INTERVAL = 0.1, 0.1

_ask: ContextVar[Callable[[], None] | None] = ContextVar("coneflat_ask", default=None)
_stopwatch: ContextVar[Stopwatch | None] = ContextVar("coneflat_stopwatch", default=None)


def rising(progress: Progress) -> Progress:
    """Return a callback that reports the largest fraction so far, because searches begin several times."""
    largest = 0.0

    def report(text: str, fraction: float) -> None:
        nonlocal largest
        largest = max(largest, fraction)
        progress(text, largest)

    return report


def as_part(progress: Progress, start: float, end: float) -> Progress:
    """Return a callback that reports the progress of a part of the work, between two fractions of it."""
    return lambda text, fraction: progress(text, start + (end - start) * fraction)


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
    """Call the function that `cancel_with` has set, if any; it raises an exception to cancel the computation.

    Work within `within_time` is also ended here.
    """
    ask = _ask.get()
    if ask is not None:
        ask()
    check_time()


def begin_step() -> None:
    """Begin a step of an iteration of unknown length: progress moves, and the computation may be cancelled."""
    check_cancelled()
    stopwatch = _stopwatch.get()
    if stopwatch is not None:
        stopwatch.step()


@contextmanager
def timing(progress: Progress | None = None) -> Iterator[Stopwatch]:
    """Set a new stopwatch for the stages in the block, and yield it.

    progress: receives the progress of the stages.

    Raises:
        OptionError: `progress` is not callable.
    """
    stopwatch = Stopwatch(progress)
    token = _stopwatch.set(stopwatch)
    try:
        yield stopwatch
    finally:
        _stopwatch.reset(token)


@contextmanager
def stage(name: str) -> Iterator[None]:
    """Time the block, or the function that this decorates, as a stage on the stopwatch of the context, if there is one.

    A stage inside another counts as a part of that.
    """
    stopwatch = _stopwatch.get()
    if stopwatch is None or stopwatch.is_running:
        yield
        return
    with stopwatch(name, DONE_AFTER.get(name, 0.0)):
        yield


def report_detail(detail: str) -> None:
    """Report a detail of the stage that is running, if its progress is reported at all."""
    stopwatch = _stopwatch.get()
    if stopwatch is not None and stopwatch.is_running:
        stopwatch.report(detail)


@contextmanager
def part_of_work(share: float, detail: str = "") -> Iterator[None]:
    """Report the progress of the block as that of a part of the enclosing block, or of the stage that is running.

    Args:
        share: fraction of the work that is left in the enclosing block.
        detail: what is done, for the progress.
    """
    stopwatch = _stopwatch.get()
    if stopwatch is None:
        yield
        return
    with stopwatch.part(share, detail):
        yield


@contextmanager
def component_at_work(place: str, share: float) -> Iterator[None]:
    """Report the progress of the stages in the block as that of a component.

    Args:
        place: which component it is, or "" if there is only one.
        share: fraction of the total work of the component.
    """
    stopwatch = _stopwatch.get()
    if stopwatch is None:
        yield
        return
    stopwatch.begin_component(place, share)
    yield
    stopwatch.end_component()


class Stopwatch:
    """Timer of the stages, which also reports progress to a callback.

    Attributes:
        seconds: wall time of each stage so far, in order of first appearance.
        done: fraction of the total work that was done before the current component.
        share: fraction of the total work of the current component.
        component: which component it is, for the progress; empty if there is only one.
        is_running: a stage is running.

    Raises:
        OptionError: `progress` is not callable.
    """

    def __init__(self, progress: Progress | None = None) -> None:
        if progress is not None and not callable(progress):
            raise OptionError(
                f"progress must be a function of a text and a fraction, got {type(progress).__name__}"
            )
        self.seconds: dict[str, float] = {}
        self.done = self.share = self._within = self._reported = 0.0
        self.component = self._name = self._detail = ""
        self.is_running = False
        self._progress = progress
        # Where the part that is running ends, as a fraction of the work of the component, and its last report.
        self._end, self._last_report, self._thread = 1.0, 0.0, threading.get_ident()

    @contextmanager
    def __call__(self, name: str, until: float = 0.0) -> Iterator[None]:
        """Time the block as the named stage; the times of stages of the same name are added.

        until: approximate fraction of the current component that is done when the stage ends.
        """
        self._name, self._detail = name, ""
        self.report()
        self._end = max(until or 1.0, self._within)
        start = time.perf_counter()
        token = _stopwatch.set(self)
        self.is_running = True
        try:
            yield
        finally:
            self.is_running = False
            _stopwatch.reset(token)
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start
        self._within = max(self._within, until)

    @contextmanager
    def part(self, share: float, detail: str = "") -> Iterator[None]:
        """Report the block as a part of the work; arguments as of `part_of_work`."""
        if not self._is_reporting:
            yield
            return
        end, outer_detail = self._end, self._detail
        self._end = self._within + share * (end - self._within)
        self._detail = detail or outer_detail
        if detail:
            self.report(detail)
        try:
            yield
        finally:
            self._within, self._end, self._detail = self._end, end, outer_detail

    def step(self) -> None:
        """Count a step of an iteration as done, and report it unless another was reported just now."""
        if not self._is_reporting:
            return
        self._within += STEP_SHARE * (self._end - self._within)
        if time.perf_counter() - self._last_report > STEP_INTERVAL:
            self.report(self._detail)

    @property
    def _is_reporting(self) -> bool:
        """Whether progress is reported at all, in this thread, for a stage that is running."""
        return self._progress is not None and self.is_running and threading.get_ident() == self._thread

    def begin_component(self, place: str, share: float) -> None:
        """Report what follows as work on a component; arguments as of `component_at_work`."""
        self._within, self._end, self.component, self.share = 0.0, 1.0, place, share

    def end_component(self) -> None:
        """Count the current component as done."""
        self.done += self.share
        self._within, self.component, self.share = 0.0, "", 0.0

    def report(self, detail: str = "") -> None:
        """Report the current stage and the fraction done to the callback, with an optional detail."""
        if self._progress is not None:
            place = ", ".join(filter(None, [self._name, self.component]))
            self._last_report = time.perf_counter()
            self._reported = max(self._reported, min(self.done + self.share * self._within, 1.0))
            self._progress(f"{place}: {detail}" if detail else place, self._reported)


def stage_seconds() -> dict[str, float]:
    """Return the wall time of each stage so far on the stopwatch of the context."""
    stopwatch = _stopwatch.get()
    return {} if stopwatch is None else dict(stopwatch.seconds)
