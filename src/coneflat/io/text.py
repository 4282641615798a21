"""Numbers from the lines of a text file, many lines at a time."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from typing import Any, NoReturn, overload

import numpy as np

from .._arrays import FloatArray, IntArray

#: Called with the position of a line in the block and what is wrong with it; raises.
Fail = Callable[[int, str], NoReturn]

#: By character code, whether bytes.split() takes it for blank.
_IS_BLANK = np.isin(np.arange(256), np.frombuffer(b" \t\n\r\x0b\x0c", np.uint8))
_NEWLINE = 10
_SLASH = 47


def join_lines(lines: Sequence[bytes]) -> bytes:
    """Return one text with exactly one newline per line, without comments and line continuations."""
    text = b"".join(lines)
    if lines and not lines[-1].endswith(b"\n"):
        text += b"\n"
    if b"#" in text or b"\\" in text or text.count(b"\n") != len(lines):
        plain = (line.partition(b"#")[0].replace(b"\\\r", b" ").replace(b"\\\n", b" ") for line in lines)
        text = b"".join([line.replace(b"\r", b" ").replace(b"\n", b" ") + b"\n" for line in plain])
    return text


def tokens_per_line(text: bytes) -> IntArray:
    """Return (k,) how many words each of the k newline-terminated lines of a text has."""
    codes = np.frombuffer(text, np.uint8)
    ends = np.flatnonzero(codes == _NEWLINE)
    return np.diff(np.searchsorted(_word_starts(codes), ends), prepend=0).astype(np.int64)


def parse_points(lines: Sequence[bytes], fail: Fail) -> FloatArray:
    """Return (k, 3) the first three numbers of each of k lines, with those behind where all lines have as many.

    `fail` is told of the first bad line.
    """
    if not lines:
        return np.empty((0, 3))
    text = join_lines(lines)
    counts = tokens_per_line(text)
    if counts.min() < 3:
        i = int(np.argmax(counts < 3))
        fail(i, f"a vertex needs 3 coordinates, but has {counts[i]}")
    numbers = _numbers(text, int(counts.sum()), np.float64)
    if numbers is None:
        _blame(text.split(), counts, float, fail)
    if np.all(counts == counts[0]):
        return numbers.reshape(len(lines), -1)
    return np.asarray(numbers[(np.cumsum(counts) - counts)[:, None] + np.arange(3)])


def parse_indices(lines: Sequence[bytes], fail: Fail) -> tuple[IntArray, IntArray, IntArray | None]:
    """Return the corners of k lines of words `v`, `v/vt`, `v//vn` or `v/vt/vn`.

    Returns:
        (k,) number of words of each line; (c,) the `v` of every word; (c,) the `vn` of every word, 0 where
        there is none, or None where no word has one.
    """
    text = join_lines(lines)
    counts = tokens_per_line(text)
    total = int(counts.sum())
    if b"/" not in text:
        numbers = _numbers(text, total, np.int64)
        if numbers is None:
            _blame(text.split(), counts, np.int64, fail)
        return counts, numbers, None
    # An absent number becomes 0, so that every slash separates two numbers and the whole text can be
    # converted at once, whatever mixture of forms it holds.
    text = text.replace(b"//", b"/0/")
    for blank in (b" ", b"\n", b"\t", b"\r", b"\x0b", b"\x0c"):
        text = text.replace(b"/" + blank, b"/0" + blank)
    codes = np.frombuffer(text, np.uint8)
    slashes = np.flatnonzero(codes == _SLASH)
    owner = np.searchsorted(_word_starts(codes), slashes, side="right") - 1
    parts = np.bincount(owner, minlength=total) + 1
    numbers = _numbers(text.replace(b"/", b" "), int(parts.sum()), np.int64)
    if numbers is None or parts.max() > 3:
        _blame(join_lines(lines).split(), counts, _corner_numbers, fail)
    first = np.cumsum(parts) - parts
    if not np.any(parts == 3):
        return counts, numbers[first], None
    normals = np.where(parts == 3, numbers[np.minimum(first + 2, len(numbers) - 1)], 0)
    return counts, numbers[first], normals


@overload
def _numbers(text: bytes, count: int, kind: type[np.float64]) -> FloatArray | None: ...
@overload
def _numbers(text: bytes, count: int, kind: type[np.int64]) -> IntArray | None: ...
def _numbers(text: bytes, count: int, kind: type[np.generic]) -> np.ndarray[Any, np.dtype[Any]] | None:
    """Return (count,) the words of a text as numbers, or None if a word is none."""
    if count == 0:
        return np.empty(0, kind)
    # Three times as fast as converting split words. It takes "1-2" for two numbers, hence the count.
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        try:
            numbers = np.fromstring(text, dtype=kind, sep=" ")
        except (DeprecationWarning, ValueError):
            return None
    return numbers if len(numbers) == count else None


def _word_starts(codes: np.ndarray[tuple[int], np.dtype[np.uint8]]) -> IntArray:
    """Return the positions where a word begins."""
    blank = _IS_BLANK[codes]
    starts = ~blank
    starts[1:] &= blank[:-1]
    return np.flatnonzero(starts)


def _corner_numbers(word: bytes) -> None:
    parts = word.split(b"/")
    if len(parts) > 3:
        raise ValueError("too many slashes")
    for i, part in enumerate(parts):
        if part or i == 0:
            np.int64(part)


def first_unreadable(words: Sequence[bytes], convert: Callable[[bytes], object]) -> int:
    """Return the index of the first word that cannot be converted.

    Raises:
        ValueError: there is none.
    """
    return [_is_readable(word, convert) for word in words].index(False)


def shown(word: bytes) -> str:
    """Return a word as an error message shows it: in quotes, and not too long."""
    return repr(word.decode("utf-8", "replace")[:40])


def _is_readable(word: bytes, convert: Callable[[bytes], object]) -> bool:
    try:
        convert(word)
    except (ValueError, OverflowError):
        return False
    return True


def _blame(
    words: Sequence[bytes], counts: IntArray, convert: Callable[[bytes], object], fail: Fail
) -> NoReturn:
    """Call `fail` for the first word that cannot be converted."""
    i = first_unreadable(words, convert)
    fail(int(np.searchsorted(np.cumsum(counts), i, side="right")), f"{shown(words[i])} is not a number")
