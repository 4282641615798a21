"""What has been computed, kept: with what it follows from, or until something else is asked for."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

Value = TypeVar("Value")


def kept_with(owner: object, name: str, compute: Callable[[], Value]) -> Value:
    """Return what follows from an object that does not change, computed once and kept with it.

    It is a `cached_property` for rooms above the one that the object's class is in.
    """
    known = owner.__dict__
    if name not in known:
        known[name] = compute()
    value: Value = known[name]
    return value


class Last(Generic[Value]):
    """The value that was computed last, with the key that it was asked for by."""

    def __init__(self) -> None:
        self._known: tuple[Hashable, Value] | None = None

    def of(self, key: Hashable, compute: Callable[[], Value]) -> Value:
        """Return the value of a key: the last one, or one that is computed and takes its place.

        Where that fails, or is given up, the last one stays.
        """
        if self._known is None or self._known[0] != key:
            self._known = key, compute()
        return self._known[1]
