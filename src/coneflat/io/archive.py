"""Reading NumPy archives that may be damaged, or be none of ours: array by array, each checked."""

from __future__ import annotations

import json
import math
import zipfile
from collections.abc import Callable, Iterable
from io import BytesIO
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import FloatArray, IntArray
from ..errors import ConeflatError, MeshFileError
from .raw import read_bytes

Made = TypeVar("Made")

#: Results are not packed; programs that pack them gain a factor of a few.
_MOST_UNPACKED = 30


class CheckedArrays:
    """Arrays of an archive, each of which must be what it should be there.

    Attributes:
        path: the archive.
        arrays: by name, as they are.
    """

    def __init__(self, path: Path, arrays: dict[str, NDArray[Any]]) -> None:
        self.path, self.arrays = path, arrays

    def need(self, names: Iterable[str], what: str) -> None:
        """Raise MeshFileError if arrays are missing; what: the file is to hold."""
        for name in names:
            if name not in self.arrays:
                raise MeshFileError(f"{self.path} holds no {what}: {name!r} is missing")

    def floats(self, name: str, shape: tuple[int | None, ...]) -> FloatArray:
        """Return an array of numbers of a shape; None stands for any length.

        Raises:
            MeshFileError: it has another shape, or is of no numbers.
        """
        values = self.arrays[name]
        lengths = [
            np.shape(values)[i : i + 1] == (length,) or length is None for i, length in enumerate(shape)
        ]
        if values.dtype.kind not in "iuf" or values.ndim != len(shape) or not all(lengths):
            wanted = ", ".join("any" if length is None else f"{length}" for length in shape)
            raise MeshFileError(
                f"{self.path}: {name!r} has the shape {values.shape} and the type {values.dtype}, not the shape "
                f"({wanted}) and a type of numbers"
            )
        return values.astype(np.float64)

    def finite(self, name: str, shape: tuple[int | None, ...]) -> FloatArray:
        """Return an array of finite numbers of a shape.

        Raises:
            MeshFileError: it has another shape, or numbers that are not finite.
        """
        values = self.floats(name, shape)
        if not np.isfinite(values).all():
            raise MeshFileError(f"{self.path}: {name!r} has numbers that are not finite")
        return values

    def indices(
        self, name: str, shape: tuple[int | None, ...], bound: int | None, least: int = 0
    ) -> IntArray:
        """Return an array of whole numbers from `least` up to a bound, or to what an index can be.

        Raises:
            MeshFileError: it has another shape, or numbers beyond.
        """
        values = self.floats(name, shape)
        end = 2**53 if bound is None else bound
        if values.size and not (
            values.min() >= least and values.max() < end and np.all(values == np.floor(values))
        ):
            there = "indices can be" if bound is None else f"the {bound} there are"
            raise MeshFileError(f"{self.path}: {name!r} has indices beyond {there}")
        return values.astype(np.int64)

    def notes(self, report: dict[str, Any]) -> tuple[str, ...]:
        """Return the notes of a report.

        Raises:
            ValueError: they are no list of texts.
        """
        notes = report["notes"]
        if not isinstance(notes, list) or not all(isinstance(note, str) for note in notes):
            raise ValueError("its report has notes that are no text")
        return tuple(notes)

    def report(self) -> dict[str, Any]:
        """Return what the archive says in JSON, of which all numbers are finite or None.

        Raises:
            ValueError: it is none.
        """
        report = json.loads(str(self.arrays["report"]))
        if not isinstance(report, dict):
            raise ValueError(f"its report is a {type(report).__name__}")
        return report


def number(value: Any) -> Any:
    """Return a number of a report; JSON has no NaN, for which it has None.

    Raises:
        ValueError: it is none.
    """
    if value is not None and not isinstance(value, (int, float)):
        raise ValueError(f"its report has {str(value)[:20]!r} for a number")
    return math.nan if value is None else value


def read_archive(path: Path, names: Iterable[str], made: Callable[[CheckedArrays], Made]) -> Made:
    """Return what is made of the arrays of an .npz file; others than those named are left unread.

    Raises:
        MeshFileError: the file is not there, may not be read, or is damaged.
    """
    content = read_bytes(path)
    try:
        return made(CheckedArrays(path, _arrays(path, content, names)))
    except (ConeflatError, MemoryError):
        raise
    except Exception as error:
        # Whatever a damaged file makes NumPy do, the caller sees one kind of error.
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise MeshFileError(f"{path} is not a readable NPZ file: {reason}") from error


def _arrays(path: Path, content: bytes, names: Iterable[str]) -> dict[str, NDArray[Any]]:
    """Return the arrays of some names, none of which is larger than it can be in a file of this size.

    NumPy allocates what the header of an array asks for, and unpacks whatever an archive holds.
    """
    arrays: dict[str, NDArray[Any]] = {}
    left = _MOST_UNPACKED * len(content)
    with zipfile.ZipFile(BytesIO(content)) as archive:
        for name in names:
            try:
                member = archive.getinfo(f"{name}.npy")
            except KeyError:
                continue
            left -= member.file_size
            if left < 0:
                raise MeshFileError(
                    f"{path} unpacks to more than {_MOST_UNPACKED} times its size: it is no result"
                )
            with archive.open(member) as stream:
                arrays[name] = _array(stream.read())
    return arrays


def _array(content: bytes) -> NDArray[Any]:
    """Return the array that a .npy file holds."""
    stream = BytesIO(content)
    version = np.lib.format.read_magic(stream)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, is_fortran, kind = read(stream)
    if kind.hasobject:
        raise ValueError("it holds Python objects")
    count = math.prod(shape)
    if min(shape, default=0) < 0 or count * kind.itemsize != len(content) - stream.tell():
        raise ValueError(f"an array of the shape {shape} is not as large as it should be")
    values = np.frombuffer(content, kind, count, stream.tell()) if count else np.empty(0, kind)
    return values.reshape(shape, order="F" if is_fortran else "C")
