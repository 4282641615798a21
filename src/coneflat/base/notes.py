"""Notes on guarantees and requests that are not met, and the one warning that a public function gives for them.

Notes are sentences in `result.notes`. Those that are `Unmet` are warnings as well; the others inform, for example of
repairs of the input.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import wraps
from typing import Any, ParamSpec, TypeVar

from ..errors import GuaranteeWarning
from .text import plural

P = ParamSpec("P")
R = TypeVar("R")

# A number within a note.
_NUMBER = re.compile(r"\d[\d.,e+-]*")

# Notes in the text of a warning; the others are counted.
MAX_QUOTED = 3
# Frames from `warnings.warn` to the caller of the function that calls `warn_of`.
CALLER = 3

# Whether a public function of the package is running, which alone warns.
_is_inside: ContextVar[bool] = ContextVar("coneflat_is_inside", default=False)


class Unmet(str):
    """A note on a guarantee, or on a request of the user, that is not met."""

    __slots__ = ()


def counted_notes(notes: Iterable[Iterable[str]]) -> list[str]:
    """Return the notes on components; those that differ in numbers alone are one note, with a count of the others.

    Args:
        notes: the notes on each component.
    """
    similar: dict[tuple[type, str], list[str]] = {}
    for of_component in notes:
        for note in of_component:
            similar.setdefault((type(note), _NUMBER.sub("#", note)), []).append(note)
    counted = []
    for first, *repeated in similar.values():
        ending = f" (and similarly {plural(len(repeated), 'component')} more)."
        counted.append(type(first)(first.rstrip(".") + ending) if repeated else first)
    return counted


@contextmanager
def inner_calls() -> Iterator[None]:
    """Give no warnings of unmet guarantees in the block, in this thread and in those that `concurrently` starts."""
    token = _is_inside.set(True)
    try:
        yield
    finally:
        _is_inside.reset(token)


def warn_of(notes: Iterable[str], where: str) -> None:
    """Warn of unmet guarantees, once for all of them, at the line that called the function that calls this one.

    There is no warning within `inner_calls`.

    Args:
        notes: notes of any kind.
        where: the expression in which the caller finds all of them.

    Raises:
        GuaranteeWarning: there are unmet guarantees, and warnings are errors.
    """
    unmet = tuple(dict.fromkeys(note for note in notes if isinstance(note, Unmet)))
    if not unmet or _is_inside.get():
        return
    unquoted = len(unmet) - MAX_QUOTED
    place = (
        f"{plural(unquoted, 'more unmet guarantee')}; all are in {where}" if unquoted > 0 else f"see {where}"
    )
    text = f"{' '.join(unmet[:MAX_QUOTED])} ({place})"
    warnings.warn(GuaranteeWarning(text, tuple(map(str, unmet))), stacklevel=CALLER)


def new_notes(result: Any, *arguments: Any) -> Iterator[str]:
    """Yield the notes of a result that none of the arguments has: of those, another call has warned."""
    tuples = (getattr(argument, "notes", ()) for argument in arguments)
    old_notes = {
        note for notes in tuples if isinstance(notes, tuple) for note in notes if isinstance(note, str)
    }
    return (note for note in result.notes if note not in old_notes)


def warns(
    where: str = "result.notes", notes: Callable[..., Iterable[str]] = new_notes
) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator of a public function that warns of unmet guarantees, once for each call of it.

    Calls of such functions within others give no warning.

    Args:
        where: the expression in which the caller finds all notes.
        notes: returns the notes for a result and the arguments of the function.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        @wraps(function)
        def call(*args: P.args, **kwargs: P.kwargs) -> R:
            with inner_calls():
                result = function(*args, **kwargs)
            warn_of(notes(result, *args, *kwargs.values()), where)
            return result

        return call

    return decorate
