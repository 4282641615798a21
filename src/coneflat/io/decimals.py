"""Much decimal text to doubles and back, as exact as Python's own functions and many times as fast."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from functools import cache

import numpy as np

from .._arrays import FloatArray

#: Numbers to read from which on compiled code pays, which takes a while to load.
MANY = 10_000
_ROWS = 1 << 15  # written at a time


def read_many(text: bytes, count: int) -> FloatArray | None:
    """Return (count,) the words of a text, which ends with a blank, as numbers.

    None if there are not as many words, or if one of them is not a plain number: a case for a slower function,
    which may find that it is one.
    """
    from .decimal_kernel import read_doubles

    numbers = np.empty(count)
    return numbers if read_doubles(np.frombuffer(text, np.uint8), _powers(), numbers) else None


def lines_of(begin: bytes, rows: FloatArray, end: bytes) -> Iterator[bytes]:
    """Yield a text with a line for each row, its numbers short, but such that the same are read from it.

    Args:
        begin: how each line begins.
        rows: (r, k) numbers.
        end: how each line ends.
    """
    for i in range(0, len(rows), _ROWS):
        block = np.ascontiguousarray(rows[i : i + _ROWS], dtype=np.float64)
        text = _lines(begin, block, end)
        if text is None:
            line = begin.decode() + " %r" * rows.shape[1] + end.decode()
            text = (line * len(block) % tuple(block.reshape(-1).tolist())).encode("ascii")
        yield text


def _lines(begin: bytes, rows: FloatArray, end: bytes) -> bytes | None:
    """Return the text of some rows; None if one has a number that needs a slower function."""
    from .decimal_kernel import MOST_LETTERS, put_rows

    head, tail = (np.frombuffer(part, np.uint8) for part in (begin, end))
    out = np.empty(len(rows) * (len(head) + len(tail) + rows.shape[1] * (MOST_LETTERS + 1)), np.uint8)
    length = put_rows(rows, head, tail, _powers(), out)
    return None if length < 0 else out[:length].tobytes()


@cache
def _powers() -> FloatArray:
    """Return (p, 2) the powers of ten that the compiled code needs, each as the sum of two doubles."""
    from .decimal_kernel import LARGEST_POWER

    exact = [Fraction(10) ** exponent for exponent in range(-LARGEST_POWER, LARGEST_POWER + 1)]
    return np.array([(float(power), float(power - Fraction(float(power)))) for power in exact])
