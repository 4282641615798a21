"""Cones and corners as a user writes them."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..._arrays import FloatArray, IntArray
from ...errors import MeshFileError, OptionError

_CURVATURE = re.compile(
    r"(?P<number>[-+]?(?:\d+\.?\d*(?:e[-+]?\d+)?|\.\d+)?)\s*\*?\s*(?P<unit>pi|π|deg|°|rad)?\s*(?:/\s*(?P<by>\d+\.?\d*))?",
    re.IGNORECASE,
)
_UNITS = {"pi": math.pi, "π": math.pi, "deg": math.pi / 180, "°": math.pi / 180, "rad": 1.0, None: 1.0}


def parse_vertices(noun: str, words: Sequence[str], path: Path | None = None) -> dict[int, float | None]:
    """Return vertex -> curvature (radians, None where it is to be computed) from options and a file.

    Args:
        noun: "cone" or "corner", which is the option's name, too.
        words: values of the option, VERTEX or VERTEX:CURVATURE.
        path: a file with VERTEX [CURVATURE] on each line.

    Raises:
        OptionError: what stands there is neither, or a vertex is named twice.
        MeshFileError: the file cannot be read.
    """
    entries = [(word, word.split(":", 1), f"--{noun}") for word in words]
    if path is not None:
        for number, line in enumerate(_lines(path), start=1):
            text = line.split("#", 1)[0].strip()
            if text:
                entries.append((text, re.split(r"[\s,:;]+", text, maxsplit=1), f"{path}, line {number}:"))
        if not entries:
            raise OptionError(f"{path} holds no {noun}s")
    given: dict[int, float | None] = {}
    for text, parts, where in entries:
        try:
            vertex = int(parts[0])
        except ValueError as error:
            raise OptionError(f"{where} {text!r} is not VERTEX or VERTEX:CURVATURE") from error
        if vertex in given:
            raise OptionError(f"{where} vertex {vertex} is given as a {noun} twice")
        given[vertex] = parse_curvature(parts[1], f"{where} {text!r}") if len(parts) > 1 else None
    return given


def read_vertices(option: str, text: str) -> tuple[int, ...]:
    """Return vertices from "3,17,8", or from a text file of such.

    Raises:
        OptionError: it is neither.
        MeshFileError: the file cannot be read.
    """
    if is_file(text):
        lines = _lines(Path(text))
        option, text = text, " ".join(line.split("#", 1)[0] for line in lines)
    words = text.replace(",", " ").split()
    for word in words:
        if not re.fullmatch(r"[-+]?[0-9]{1,18}", word):
            raise OptionError(f"{option}: {word!r} is no vertex, and there is no such file")
    return tuple(dict.fromkeys(int(word) for word in words))


def read_pairs(path: Path) -> IntArray:
    """Return (k, 2) the two vertices on each line of a text file.

    Raises:
        OptionError: a line holds something else.
        MeshFileError: the file cannot be read.
    """
    pairs = []
    for number, line in enumerate(_lines(path), start=1):
        text = line.split("#", 1)[0].strip()
        if not text:
            continue
        if not re.fullmatch(r"[0-9]{1,18}(\s*[,;-]\s*|\s+)[0-9]{1,18}", text):
            raise OptionError(f"{path}, line {number}: {text!r} is not a pair of vertices")
        pairs.append([int(word) for word in re.findall(r"[0-9]+", text)])
    if not pairs:
        raise OptionError(f"{path} holds no pairs of vertices")
    return np.array(pairs, dtype=np.int64)


def read_weights(text: str) -> str | FloatArray:
    """Return the numbers of a file, or the text, which then is the name of a property.

    Raises:
        MeshFileError: the file cannot be read.
    """
    path = Path(text)
    if not is_file(text):
        if path.suffix:
            raise MeshFileError(f"cannot read weights from {path}: there is no such file")
        return text
    try:
        values = np.load(path, allow_pickle=False) if path.suffix == ".npy" else np.loadtxt(path, ndmin=1)
        return np.asarray(values, dtype=np.float64)
    except (OSError, ValueError, TypeError, EOFError) as error:
        reason = " ".join(str(error).split())
        raise MeshFileError(f"cannot read weights from {path}: {reason}") from error


def parse_angle(text: str) -> float:
    """Return radians from "1.57", "pi/2", "-0.5pi", "90deg".

    Raises:
        OptionError: it is none of these.
    """
    return parse_curvature(text, "", "angle")


def parse_curvature(text: str, where: str, noun: str = "curvature") -> float:
    """Return radians from "1.57", "pi/2", "-0.5pi", "90deg".

    Raises:
        OptionError: it is none of these.
    """
    place = f"{where}: " if where else ""
    match = _CURVATURE.fullmatch(text.strip())
    number = match["number"] if match else ""
    unit = match["unit"].lower() if match and match["unit"] else None
    if match is None or (number in ("", "+", "-") and unit not in ("pi", "π")):
        raise OptionError(f"{place}{text.strip()!r} is no {noun}; write 1.57, pi/2, -0.5pi or 90deg")
    factor = float(number + "1" if number in ("", "+", "-") else number)
    divisor = float(match["by"] or 1)
    if divisor == 0:
        raise OptionError(f"{place}division by zero")
    return factor * _UNITS[unit] / divisor


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise MeshFileError(f"cannot read {path}: {reason}") from error


def is_file(text: str) -> bool:
    """Whether an option's value names a file that is there."""
    try:
        return Path(text).is_file()
    except (OSError, ValueError):
        return False
