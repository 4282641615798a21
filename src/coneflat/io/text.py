"""Lines, words and numbers of a text file, processed in blocks.

Blocks keep the arrays of lines and words small for files of any size.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import BoolArray, FloatArray, IntArray
from ..errors import MeshFileError

#: Bytes of a block: large enough that Python's time per block is negligible, small enough that its arrays fit in a
#: cache.
BLOCK_BYTES = 1 << 20

_NEWLINE, _SLASH = b"\n/"
_BOM = b"\xef\xbb\xbf"

_LINE_END = re.compile(rb"\r\n|[\r\n]")
# The end of a line that is not continued by a backslash.
_BLOCK_END = re.compile(rb"(?<!\\)(?<!\\\r)(?:\r\n|[\r\n])")
_RETURN = re.compile(rb"\r(?!\n)")
_OPEN_SLASH = re.compile(rb"/(?=\s)")
_COMMENT = re.compile(rb"#[^\r\n]*")
_COMMENT_LINE = re.compile(rb"(?<![^\r\n])[ \t]*#[^\r\n]*")
_CONTINUATION = re.compile(rb"\\(?:\r\n|[\r\n])")

# The forms that the number parser reads, used to find the word that it rejects.
_FLOAT = re.compile(rb"[-+]?(?:(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?|inf(?:inity)?|nan)", re.IGNORECASE)
_INTEGER = re.compile(rb"[-+]?\d+")
_CORNER = re.compile(rb"[-+]?\d+(?:/(?:[-+]?\d+)?){0,2}")


def newline_of(content: bytes) -> bytes:
    """Return the line ending of the first line of a text."""
    end = _LINE_END.search(content)
    return end[0] if end else b"\n"


def text_blocks(
    path: Path, content: bytes, begin: int = 0, *, comments: bool = True, continued: bool = False
) -> Iterator[TextBlock]:
    """Yield a text from a given position in blocks of complete lines.

    Args:
        path: the file, for messages.
        content: the whole file.
        begin: start of the first line.
        comments: whether a # begins a comment, to the end of the line.
        continued: whether a backslash at the end of a line that is not a comment joins the next line to it.
    """
    while begin < len(content):
        cut = _BLOCK_END.search(content, begin + BLOCK_BYTES)
        end = cut.end() if cut else len(content)
        yield TextBlock(path, content, begin, end, comments, continued)
        begin = end


class TextBlock:
    """Some lines of a text, split into words; comments are ignored.

    Attributes:
        raw: the text of the lines, verbatim.
        line_starts: (k + 1,) start of each of the k lines in `raw`, and the end of the last.
        counts: (k,) number of words of each line.
    """

    def __init__(
        self, path: Path, content: bytes, begin: int, end: int, comments: bool, continued: bool
    ) -> None:
        self._path, self._content, self._begin = path, content, begin
        self.raw = content[begin:end]
        text = _plain_lines(self.raw, comments, continued)
        self._codes = np.frombuffer(text, np.uint8)
        self._word_starts = _word_starts(self._codes)
        ends = np.flatnonzero(self._codes == _NEWLINE)
        self.line_starts = np.concatenate(([0], np.minimum(ends + 1, len(self.raw))))
        words_until = np.searchsorted(self._word_starts, ends)
        self.counts = np.diff(words_until, prepend=0)
        self._first_words = words_until - self.counts

    def heads(self) -> IntArray:
        """Return (k,) the first two characters of each line's first word as a 16-bit number; 0 without a word.

        The second character is a blank if the word is a single letter.
        """
        heads = np.zeros(len(self.counts), dtype=np.int64)
        filled = np.flatnonzero(self.counts)
        starts = self._word_starts[self._first_words[filled]]
        second = self._codes[starts + 1]
        second = np.where(_is_blank(second), np.uint8(ord(" ")), second)
        heads[filled] = self._codes[starts].astype(np.int64) << 8 | second
        return heads

    def beginning_with(self, word: bytes) -> IntArray:
        """Return the rows of the lines whose first word is a given lower-case word, ignoring case."""
        rows = np.flatnonzero(self.counts)
        last = len(self._codes) - 1
        for i, letter in enumerate(word):
            place = np.minimum(self._word_starts[self._first_words[rows]] + i, last)
            rows = rows[self._codes[place] | 32 == letter]
        behind = np.minimum(self._word_starts[self._first_words[rows]] + len(word), last)
        return rows[_is_blank(self._codes[behind])]

    def words(self, rows: IntArray, first: int | IntArray = 0, stop: int | IntArray | None = None) -> Words:
        """Return the words of some lines, from index `first` up to `stop` in each line; both may be (r,) arrays."""
        counts = self.counts[rows]
        begins = self._first_words[rows] + first
        counts = np.maximum((counts if stop is None else np.minimum(stop, counts)) - first, 0)
        is_filled = counts > 0
        places = np.append(self._word_starts, len(self._codes))
        bounds = np.stack([places[begins[is_filled]], places[(begins + counts)[is_filled]]], axis=1).reshape(
            -1
        )
        lengths = np.diff(bounds, prepend=0, append=len(self._codes))
        chosen = np.repeat(np.arange(len(lengths)) % 2 == 1, lengths)
        return Words(self, rows, counts, self._codes[chosen].tobytes())

    def fail(self, row: int, reason: str) -> NoReturn:
        """Raise an error about a line.

        Raises:
            MeshFileError: always.
        """
        raise MeshFileError(f"{self._path}, line {self.line_number(row)}: {reason}")

    def line_number(self, row: int) -> int:
        """Return the number of a line in the file, from 1."""
        return 1 + len(self._content[: self._begin + int(self.line_starts[row])].splitlines())


class Words:
    """Words of some lines of a block.

    Attributes:
        counts: (r,) number of words of each line.
    """

    def __init__(self, block: TextBlock, rows: IntArray, counts: IntArray, text: bytes) -> None:
        self.counts = counts
        self._block, self._rows, self._text = block, rows, text

    def points(self) -> FloatArray:
        """Return (r, 3) the first three numbers of each line, or (r, k) all if every line has k numbers.

        Raises:
            MeshFileError: a line has fewer than three numbers, or a word that is not a number.
        """
        counts = self.counts
        if not len(counts):
            return np.empty((0, 3))
        if counts.min() < 3:
            i = int(np.argmax(counts < 3))
            self._block.fail(int(self._rows[i]), f"a vertex needs 3 coordinates, but has {counts[i]}")
        numbers = self.floats()
        if np.all(counts == counts[0]):
            return numbers.reshape(len(counts), -1)
        return np.asarray(numbers[(np.cumsum(counts) - counts)[:, None] + np.arange(3)])

    def floats(self) -> FloatArray:
        """Return all words as numbers.

        Raises:
            MeshFileError: a word is not a number.
        """
        numbers = _numbers(self._text, int(self.counts.sum()), np.float64)
        return self._reject(_FLOAT) if numbers is None else numbers

    def integers(self, noun: str = "a number") -> IntArray:
        """Return all words as integers.

        Raises:
            MeshFileError: a word is not an integer; the message says that it is not `noun`.
        """
        numbers = _numbers(self._text, int(self.counts.sum()), np.int64)
        return self._reject(_INTEGER, noun) if numbers is None else numbers

    def corners(self) -> tuple[IntArray, IntArray | None, IntArray | None]:
        """Return the parts of words `v`, `v/vt`, `v//vn` or `v/vt/vn`.

        Returns:
            (c,) the `v` of every word; (c,) the `vt` and (c,) the `vn` of every word, 0 if it is missing, or None if
            no word has one.

        Raises:
            MeshFileError: a word is not of these forms.
        """
        if b"/" not in self._text:
            return self.integers(), None, None
        codes = np.frombuffer(self._text, np.uint8)
        slashes = np.flatnonzero(codes == _SLASH)
        parts = np.diff(np.searchsorted(slashes, _word_starts(codes)), append=len(slashes)) + 1
        text = self._text
        # A missing number becomes 0, so that every slash separates two numbers and the whole text can be
        # converted at once, for any mixture of forms.
        behind = codes[slashes + 1]
        if np.any(behind == _SLASH):
            text = text.replace(b"//", b"/0/")
        if np.any(_is_blank(behind)):
            text = _OPEN_SLASH.sub(b"/0", text)
        numbers = _numbers(text.replace(b"/", b" "), int(parts.sum()), np.int64)
        if numbers is None or parts.max() > 3:
            self._reject(_CORNER)
        first = np.cumsum(parts) - parts
        texture, normals = (
            np.where(parts > i, numbers[np.minimum(first + i, len(numbers) - 1)], 0) for i in (1, 2)
        )
        return numbers[first], texture if texture.any() else None, normals if normals.any() else None

    def _reject(self, form: re.Pattern[bytes], noun: str = "a number") -> NoReturn:
        """Raise MeshFileError for the first word that does not match a pattern."""
        words = self._text.split()
        i = next((i for i, word in enumerate(words) if not form.fullmatch(word)), len(words) - 1)
        row = self._rows[np.searchsorted(np.cumsum(self.counts), i, side="right")]
        # Quoted, and truncated if it is long.
        shown = repr(words[i].decode("utf-8", "replace")[:40])
        self._block.fail(int(row), f"{shown} is not {noun}")


def _plain_lines(text: bytes, comments: bool, continued: bool) -> bytes:
    """Return lines with comments and continuations blanked out, positions unchanged; each ends with one newline."""
    if text.startswith(_BOM):
        text = text.replace(_BOM, b"   ", 1)
    if continued and b"\\" in text:
        # The backslash at the end of a comment is text, often that of a Windows path.
        text = _CONTINUATION.sub(_blanks, _COMMENT_LINE.sub(_blanks, text))
    if comments and b"#" in text:
        text = _COMMENT.sub(_blanks, text)
    if b"\r" in text and text.count(b"\r") != text.count(b"\r\n"):
        text = _RETURN.sub(b"\n", text)
    return text if text.endswith(b"\n") else text + b"\n"


def _blanks(match: re.Match[bytes]) -> bytes:
    return b" " * len(match[0])


def _numbers(text: bytes, count: int, kind: type[np.generic]) -> NDArray[Any] | None:
    """Return (count,) the words of a text as numbers, or None if a word is not a number."""
    if count == 0:
        return np.empty(0, kind)
    # np.fromstring rounds as float() does, without a Python object for each word. It reads "1-2" as two numbers, so the
    # count is checked.
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        try:
            numbers = np.fromstring(text, dtype=kind, sep=" ")
        except (DeprecationWarning, ValueError):
            return None
    return numbers if len(numbers) == count else None


def _word_starts(codes: NDArray[np.uint8]) -> IntArray:
    """Return the start positions of words."""
    blank = _is_blank(codes)
    starts = ~blank
    starts[1:] &= blank[:-1]
    return np.flatnonzero(starts)


def _is_blank(codes: NDArray[np.uint8]) -> BoolArray:
    """Return flags for the characters that bytes.split() treats as blank: 9 to 13, and 32."""
    return (codes == ord(" ")) | (codes - np.uint8(9) < 5)


class Growing:
    """An array of rows that grows in place as blocks are appended.

    Concatenating a list of blocks at the end would need twice the memory, and would leave half of it fragmented.
    """

    def __init__(self, kind: type[np.generic], *columns: int) -> None:
        """Start without rows; `columns` is empty if each row is a single number."""
        self._rows: NDArray[Any] = np.empty((0, *columns), kind)
        self._length = 0

    def __len__(self) -> int:
        return self._length

    def add(self, rows: NDArray[Any]) -> None:
        """Append some rows."""
        end = self._length + len(rows)
        if end > len(self._rows):
            self._resize(max(end, 2 * len(self._rows)))
        self._rows[self._length : end] = rows
        self._length = end

    def done(self) -> NDArray[Any]:
        """Return all rows."""
        self._resize(self._length)
        return self._rows

    def _resize(self, length: int) -> None:
        # No other reference to the array exists yet, so it may be moved in memory.
        self._rows.resize((length, *self._rows.shape[1:]), refcheck=False)
