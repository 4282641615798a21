"""The time of a search: work that can only improve a result is abandoned when the time of its context is up.

`search_time` sets the time once at the top. A search wraps everything but its first result in `within_time`; loops that
run in it call `check_cancelled` (`progress.py`), which then ends the work.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import TypeVar

Argument = TypeVar("Argument")
Result = TypeVar("Result")

_time: ContextVar[SearchTime | None] = ContextVar("coneflat_search_time", default=None)
# Whether the work of the context may be abandoned.
_is_optional: ContextVar[bool] = ContextVar("coneflat_is_optional", default=False)


class TimeUpError(Exception):
    """Ends work within `within_time`, which catches it."""


@dataclass(eq=False)
class SearchTime:
    """The time of a search.

    Attributes:
        seconds: the time; infinite if there is no limit.
        start: when it began, by the clock.
        end: when the search that is running has to end, by the clock.
        ended_after: seconds from the start to when work was abandoned last; None if none was.
        attempts: how much optional work was completed.
    """

    seconds: float
    start: float
    end: float
    ended_after: float | None = None
    attempts: int = 0

    @staticmethod
    def clock() -> float:
        """Return seconds since any fixed time."""
        return time.monotonic()

    @property
    def is_ended(self) -> bool:
        """Whether work was abandoned because the time was up."""
        return self.ended_after is not None

    def is_up(self) -> bool:
        """Return whether the search has to end, which is recorded."""
        if not math.isfinite(self.end):
            return False
        now = self.clock()
        if now < self.end:
            return False
        self.ended_after = now - self.start
        return True


@contextmanager
def search_time(seconds: float | None) -> Iterator[SearchTime]:
    """Limit the time of the searches in the block; None for no limit."""
    start, allowed = SearchTime.clock(), math.inf if seconds is None else seconds
    limit = SearchTime(allowed, start, start + allowed)
    token = _time.set(limit)
    try:
        yield limit
    finally:
        _time.reset(token)


@contextmanager
def portion_of_time(share: float) -> Iterator[None]:
    """Limit the search in the block to a share of the time that is left."""
    limit = _time.get()
    if limit is None or not math.isfinite(limit.end):
        yield
        return
    end, now = limit.end, limit.clock()
    limit.end = now + share * max(end - now, 0.0)
    try:
        yield
    finally:
        limit.end = end


def within_time(call: Callable[[], Result]) -> Result | None:
    """Return the result of optional work, or None if the time of the search is up before it is complete."""
    limit = _time.get()
    if limit is None:
        return call()
    if limit.is_up():
        return None
    token = _is_optional.set(True)
    try:
        result = call()
    except TimeUpError:
        return None
    finally:
        _is_optional.reset(token)
    limit.attempts += 1
    return result


def each_within_time(
    function: Callable[[Argument], Result], arguments: Iterable[Argument]
) -> Iterator[Result | None]:
    """Yield the results of a function, None for those for which the time of the search is up."""
    for argument in arguments:
        yield within_time(lambda argument=argument: function(argument))  # type: ignore[misc]


def is_time_up() -> bool:
    """Return whether the search of the context has to end."""
    limit = _time.get()
    return limit is not None and limit.is_up()


def check_time() -> None:
    """End optional work if the time of the search is up.

    Raises:
        TimeUpError: it is; `within_time` catches it.
    """
    if _is_optional.get() and is_time_up():
        raise TimeUpError


def current_time() -> SearchTime | None:
    """Return the time of the search of the context."""
    return _time.get()
