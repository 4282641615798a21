"""Much decimal text to doubles and back, as exact as Python's own functions and many times as fast."""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction
from functools import cache

import numpy as np
from numpy.typing import NDArray

from .._arrays import FloatArray
from ..compiled import compiled

#: Numbers to read from which on compiled code pays, which takes a while to load.
MANY = 10_000
_ROWS = 1 << 15  # written at a time


def read_many(text: bytes, count: int) -> FloatArray | None:
    """Return (count,) the words of a text, which ends with a blank, as numbers.

    None if there are not as many words, or if one of them is not a plain number: a case for a slower function,
    which may find that it is one.
    """

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

    head, tail = (np.frombuffer(part, np.uint8) for part in (begin, end))
    out = np.empty(len(rows) * (len(head) + len(tail) + rows.shape[1] * (MOST_LETTERS + 1)), np.uint8)
    length = put_rows(rows, head, tail, _powers(), out)
    return None if length < 0 else out[:length].tobytes()


@cache
def _powers() -> FloatArray:
    """Return (p, 2) the powers of ten that the compiled code needs, each as the sum of two doubles."""

    exact = [Fraction(10) ** exponent for exponent in range(-LARGEST_POWER, LARGEST_POWER + 1)]
    return np.array([(float(power), float(power - Fraction(float(power)))) for power in exact])


#: The table of powers of ten goes from minus to plus this.
LARGEST_POWER = 80
# So many digits fit in 63 bits.
MOST_DIGITS = 18
# Halves the digits of a double (Dekker, "A floating-point technique for extending the available precision", 1971).
SPLITTER = 2.0**27 + 1
# What is left over by rounding may be half a unit in the last place, 2^-54 of the number, when taken this much larger:
# far more than it is wrong by.
MARGIN = 1 + 1e-12
# The longest are like -1.2345678901234567e-100.
MOST_LETTERS = 24

ZERO, NINE, PLUS, MINUS, POINT, LETTER_E, BLANK = (ord(letter) for letter in "09+-.e ")


@compiled
def scaled(x: float, rest: float, exponent: int, powers: FloatArray) -> tuple[float, float]:
    """Return (x + rest) * 10^exponent as the sum of two doubles."""
    high, low = powers[exponent + LARGEST_POWER, 0], powers[exponent + LARGEST_POWER, 1]
    product = x * high
    t = SPLITTER * x
    x1 = t - (t - x)
    x2 = x - x1
    t = SPLITTER * high
    h1 = t - (t - high)
    h2 = high - h1
    error = ((x1 * h1 - product) + x1 * h2 + x2 * h1) + x2 * h2
    return product, error + (x * low + rest * high)


@compiled
def to_double(digits: int, exponent: int, powers: FloatArray) -> float:
    """Return the double nearest to digits * 10^exponent, not negative; nan where in doubt."""
    if digits == 0:
        return 0.0
    if abs(exponent) > LARGEST_POWER:
        return math.nan
    x = float(digits)
    product, rest = scaled(x, float(digits - np.int64(x)), exponent, powers)
    value = product + rest
    rest -= value - product
    return value if value + rest * MARGIN == value else math.nan


@compiled
def to_decimal(value: float, powers: FloatArray) -> tuple[int, int]:
    """Return digits and their exponent that are read as a positive double; 0, 0 where in doubt.

    They are the nearest of their number, and the fewest but for some powers of two.
    """
    if not 1e-60 < value < 1e60:
        return 0, 0
    size = math.floor(math.log10(value))
    # The logarithm may round to the wrong side.
    if powers[size + LARGEST_POWER, 0] > value:
        size -= 1
    elif powers[size + 1 + LARGEST_POWER, 0] <= value:
        size += 1
    for count in (15, 16, 17):
        exponent = size + 1 - count
        product, rest = scaled(value, 0.0, -exponent, powers)
        whole = math.floor(product)
        up = (product - whole) + rest + 0.5
        digits = np.int64(whole) + np.int64(math.floor(up))
        if math.floor(up) == up:  # a tie goes to the even one
            digits -= digits % 2
        if to_double(digits, exponent, powers) == value:
            while digits % 10 == 0:
                digits //= 10
                exponent += 1
            return digits, exponent
    return 0, 0


@compiled
def is_blank(code: int) -> bool:
    return code == BLANK or 9 <= code <= 13


@compiled
def read_doubles(codes: NDArray[np.uint8], powers: FloatArray, out: FloatArray) -> bool:
    """Read the words of a text as numbers.

    Args:
        codes: the text, which ends with a blank.
        powers: (2 * LARGEST_POWER + 1, 2) each power of ten as the sum of two doubles.
        out: (k,) where the numbers go.

    Returns:
        Whether there were k words, all of them plain numbers without doubt.
    """
    i, end = 0, len(codes)
    for k in range(len(out)):
        while i < end and is_blank(codes[i]):
            i += 1
        if i == end:
            return False
        negative = codes[i] == MINUS
        if negative or codes[i] == PLUS:
            i += 1
        digits, used, seen, exponent, has_point = 0, 0, 0, 0, False
        while True:
            if ZERO <= codes[i] <= NINE:
                digits = 10 * digits + (codes[i] - ZERO)
                used += digits > 0
                seen += 1
                exponent -= has_point
            elif codes[i] == POINT and not has_point:
                has_point = True
            else:
                break
            i += 1
        if seen == 0 or used > MOST_DIGITS:
            return False
        if codes[i] | 32 == LETTER_E:
            i += 1
            sign = -1 if codes[i] == MINUS else 1
            if codes[i] == MINUS or codes[i] == PLUS:
                i += 1
            if is_blank(codes[i]):
                return False
            power = 0
            while ZERO <= codes[i] <= NINE:
                power = min(10 * power + (codes[i] - ZERO), 10_000)
                i += 1
            exponent += sign * power
        value = to_double(digits, exponent, powers)
        if not is_blank(codes[i]) or math.isnan(value):
            return False
        out[k] = -value if negative else value
    while i < end and is_blank(codes[i]):
        i += 1
    return i == end


@compiled
def put_digits(out: NDArray[np.uint8], i: int, number: int, count: int) -> int:
    """Write a number with leading zeros to so many digits, and return the place behind it."""
    for k in range(i + count - 1, i - 1, -1):
        out[k] = ZERO + number % 10
        number //= 10
    return i + count


@compiled
def put_integer(out: NDArray[np.uint8], i: int, number: int) -> int:
    """Write a whole number, and return the place behind it."""
    if number < 0:
        out[i] = MINUS
        i += 1
        number = -number
    count, rest = 1, number // 10
    while rest:
        count += 1
        rest //= 10
    return put_digits(out, i, number, count)


@compiled
def put_double(out: NDArray[np.uint8], i: int, value: float, powers: FloatArray) -> int:
    """Write a number as Python does, and return the place behind it; -1 where in doubt."""
    if value < 0 or (value == 0 and math.copysign(1.0, value) < 0):
        out[i] = MINUS
        i += 1
        value = -value
    digits, exponent = 0, 0
    if value != 0:
        digits, exponent = to_decimal(value, powers)
        if digits == 0:
            return -1
    count, limit = 1, 10
    while digits >= limit:
        count += 1
        limit *= 10
    before = count + exponent  # digits before the point
    if not -4 < before <= 16:
        i = put_digits(out, i, digits // 10 ** (count - 1), 1)
        if count > 1:
            out[i] = POINT
            i = put_digits(out, i + 1, digits % 10 ** (count - 1), count - 1)
        out[i] = LETTER_E
        out[i + 1] = MINUS if before < 1 else PLUS
        return put_digits(out, i + 2, abs(before - 1), 2)
    if exponent >= 0:
        i = put_digits(out, i, digits * 10**exponent, before)
        out[i] = POINT
        return put_digits(out, i + 1, 0, 1)
    whole = digits // 10**-exponent if -exponent < MOST_DIGITS else 0
    i = put_digits(out, i, whole, max(before, 1))
    out[i] = POINT
    return put_digits(out, i + 1, digits - whole * 10 ** min(-exponent, MOST_DIGITS), -exponent)


@compiled
def put_rows(
    rows: FloatArray,
    begin: NDArray[np.uint8],
    end: NDArray[np.uint8],
    powers: FloatArray,
    out: NDArray[np.uint8],
) -> int:
    """Write a line for each row: how it begins, its numbers after a blank each, how it ends.

    Returns:
        The length of the text; -1 where a number is in doubt.
    """
    i = 0
    for row in rows:
        for code in begin:
            out[i] = code
            i += 1
        for value in row:
            out[i] = BLANK
            i = put_double(out, i + 1, value, powers)
            if i < 0:
                return -1
        for code in end:
            out[i] = code
            i += 1
    return i
