"""Small helpers for messages."""

from __future__ import annotations

import math
import signal
from collections.abc import Iterable
from itertools import islice

# Largest numbers of array elements and of characters that a message shows.
MAX_SHOWN_ELEMENTS, MAX_SHOWN_CHARACTERS = 4, 80
MAX_LISTED = 5


def plural(count: int, noun: str, nouns: str | None = None) -> str:
    """Return a count with its noun: "1 cone", "2 cones"."""
    return f"{count:,} {noun if count == 1 else nouns or noun + 's'}"


def list_some(items: Iterable[object], total: int | None = None) -> str:
    """Return the first five items as text, with dots if there are more.

    total: the number of items, if `items` does not contain all.
    """
    shown = list(islice(iter(items), MAX_LISTED + 1))
    is_cut = len(shown) > MAX_LISTED or (total is not None and total > MAX_LISTED)
    return ", ".join(str(item) for item in shown[:MAX_LISTED]) + (", ..." if is_cut else "")


def printable(text: object) -> str:
    """Return a text of one line that can be encoded as UTF-8.

    Invalid bytes of file names are escaped, such as \\udcff, and line breaks become spaces.
    """
    return " ".join(str(text).splitlines()).encode("utf-8", "backslashreplace").decode("utf-8")


def short_repr(value: object) -> str:
    """Return a short one-line description of a value, for messages."""
    import numpy as np  # imported late: commands that only print their help do not need it

    if isinstance(value, np.ndarray) and value.size > MAX_SHOWN_ELEMENTS:
        return f"an array of shape {value.shape} and type {value.dtype}"
    try:
        text = " ".join(repr(value).split())
    except Exception:  # `repr` of a foreign class may raise anything
        text = f"a {type(value).__name__}"
    return text if len(text) <= MAX_SHOWN_CHARACTERS else f"{text[:MAX_SHOWN_CHARACTERS]}..."


def error_text(residual: float) -> str:
    """Return the part of a message that states an error: "off by 0.1 rad"."""
    if not math.isfinite(residual):
        return "off by more than double precision can represent"
    return f"off by {residual:.2g} rad"


def exit_text(code: int) -> str:
    """Return a text that says how a process with this exit code ended."""
    if -code in set(signal.Signals):
        return f"was ended by {signal.Signals(-code).name}, possibly because memory ran out"
    return f"ended with code {code}"
