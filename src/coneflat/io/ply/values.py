"""Values of PLY files, text and binary, as one array for each property of an element."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from ...base.arrays import FloatArray, IntArray
from ...errors import MeshFileError
from ..text import Growing, text_blocks
from .header import Element, Property

#: One property of an element in all rows.
Column: TypeAlias = "np.ndarray[tuple[int, ...], np.dtype[Any]]"


class EndOfFile(Exception):
    """Signals that the file is shorter than its header declares."""


def stored_element(element: Element, form: str) -> Element:
    """Return an element with the stored types of its properties; for text they are those of `text_values`."""
    order = ">" if form == "binary_big_endian" else "<"

    def kind(code: str) -> str:
        return "<d" if form == "ascii" else order + code

    stored = [Property(p.name, kind(p.kind), p.count and kind(p.count), p.word) for p in element.properties]
    return replace(element, properties=tuple(stored))


def decode(content: bytes, start: int, element: Element, chosen: list[int]) -> tuple[list[Column], int]:
    """Return the chosen columns of an element, a list as two columns (lengths, items), and its end position."""
    lists = [i for i, p in enumerate(element.properties) if p.count]
    first = _row(content, start, element)[1] if element.length else [0] * len(lists)
    lengths = dict(zip(lists, first, strict=True))
    fields: list[tuple[str, str] | tuple[str, str, int]] = []
    for i, p in enumerate(element.properties):
        fields += [(f"n{i}", p.count), (f"p{i}", p.kind, lengths[i])] if p.count else [(f"p{i}", p.kind)]
    row = np.dtype(fields)
    stop = start + element.length * row.itemsize
    if stop <= len(content):
        rows = np.frombuffer(content, row, element.length, start)
        if all(np.all(rows[f"n{i}"] == lengths[i]) for i in lists):
            columns: list[Column] = []
            for i in chosen:
                if i in lengths:
                    columns.append(np.full(element.length, lengths[i], dtype=np.int64))
                columns.append(rows[f"p{i}"].reshape(-1))
            return columns, stop
    if not lists or element.length > len(content):
        raise EndOfFile
    return _decode_lists(content, start, element, chosen)


def _decode_lists(
    content: bytes, start: int, element: Element, chosen: list[int]
) -> tuple[list[Column], int]:
    """Return the same as `decode` for an element whose lists differ in length."""
    codes = np.frombuffer(content, np.uint8)
    starts = [start]
    for _ in range(element.length):
        starts.append(_row(content, starts[-1], element)[0])

    def read(places: IntArray, kind: str) -> Column:
        every = np.lib.stride_tricks.sliding_window_view(codes, np.dtype(kind).itemsize)
        return every[places].reshape(-1).view(kind)

    places: IntArray = np.array(starts[:-1])
    columns: dict[int, list[Column]] = {}
    for i, p in enumerate(element.properties):
        size = np.dtype(p.kind).itemsize
        lengths: IntArray = np.ones(element.length, np.int64)
        if p.count:
            lengths = read(places, p.count).astype(np.int64)
            places = places + np.dtype(p.count).itemsize
        if i in chosen:
            within = np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths, lengths)
            items = read(np.repeat(places, lengths) + within * size, p.kind)
            columns[i] = [lengths, items] if p.count else [items]
        places = places + lengths * size
    return [column for i in chosen for column in columns[i]], starts[-1]


def _row(content: bytes, start: int, element: Element) -> tuple[int, list[int]]:
    """Return the end position of a row of an element, and the lengths of its lists.

    Raises:
        EndOfFile: the content ends within the row.
    """
    lengths = []
    for size, count in element.steps:
        if count is not None:
            if start + count.size > len(content):
                raise EndOfFile
            (length,) = count.unpack_from(content, start)
            if not 0 <= length < 2**31 or length != int(length):
                raise ValueError(f"a list has the length {length}")
            lengths.append(int(length))
            size = count.size + size * lengths[-1]
        start += size
    if start > len(content):
        raise EndOfFile
    return start, lengths


def text_values(path: Path, content: bytes, start: int, elements: Sequence[Element]) -> bytes:
    """Return all numbers of a text body, as little-endian doubles.

    Raises:
        MeshFileError: a word is not a number, or a line does not have the numbers that its element needs.
    """
    numbers, counts = Growing(np.float64), Growing(np.int64)
    for block in text_blocks(path, content, start, comments=False):
        numbers.add(block.words(np.arange(len(block.counts))).floats())
        counts.add(block.counts[block.counts > 0])
    values, lengths = numbers.done(), counts.done()
    # Some files have rows of several lines.
    if len(lengths) == sum(element.length for element in elements):
        needed = _needed(elements, values, lengths)
        wrong = np.flatnonzero(needed != lengths)
        if len(wrong):
            i = int(wrong[0])
            ends = np.cumsum([element.length for element in elements])
            name = elements[int(np.searchsorted(ends, i, side="right"))].name
            reason = (
                f"the list of this {name} has no valid length"
                if needed[i] < 0
                else f"the properties of this {name} need {needed[i]:,} numbers, but the line has {lengths[i]:,}"
            )
            raise MeshFileError(f"{path}, line {_filled_line(path, content, start, i)}: {reason}")
    return values.astype("<f8", copy=False).tobytes()


def _needed(elements: Sequence[Element], values: FloatArray, lengths: IntArray) -> IntArray:
    """Return (k,) how many numbers each line of a text body needs, given those of all lines; -1 for an invalid list.

    lengths: (k,) numbers on each line.
    """
    needed = np.empty(len(lengths), np.int64)
    first, begin = np.cumsum(lengths) - lengths, 0
    for element in elements:
        rows = slice(begin, begin + element.length)
        place, is_valid = first[rows].copy(), np.ones(element.length, dtype=bool)
        for declared in element.properties:
            if declared.count:
                size = values[np.minimum(place, len(values) - 1)] if len(values) else np.zeros(len(place))
                is_valid &= (size >= 0) & (size <= len(values)) & (size == np.floor(size))
                place += np.where(is_valid, np.nan_to_num(size), 0).astype(np.int64)
            place += 1
        needed[rows] = np.where(is_valid, place - first[rows], -1)
        begin += element.length
    return needed


def _filled_line(path: Path, content: bytes, start: int, i: int) -> int:
    """Return the number of the i-th line with words of a text body."""
    for block in text_blocks(path, content, start, comments=False):
        rows = np.flatnonzero(block.counts)
        if i < len(rows):
            return block.line_number(int(rows[i]))
        i -= len(rows)
    raise AssertionError("there is no such line")
