"""Values as they are written for the commands: vertices, curvatures, pairs, weights, angles, and files of these."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ...errors import MeshFileError, OptionError

if TYPE_CHECKING:
    from ...base import FloatArray, IntArray


_CURVATURE = re.compile(
    r"(?P<number>[-+]?(?:\d+\.?\d*(?:e[-+]?\d+)?|\.\d+)?)\s*\*?\s*(?P<unit>pi|π|deg|°|rad)?\s*(?:/\s*(?P<by>\d+\.?\d*))?",
    re.IGNORECASE,
)
_UNITS = {"pi": math.pi, "π": math.pi, "deg": math.pi / 180, "°": math.pi / 180, "rad": 1.0, None: 1.0}


def read_vertex_map(flag: str, noun: str, texts: Sequence[str]) -> dict[int, float | None]:
    """Return vertex -> curvature (radians, None where it is to be computed).

    Args:
        flag: the option's name.
        noun: "cone" or "corner".
        texts: each VERTEX[:CURVATURE], several of them with commas, or a file with VERTEX [CURVATURE] on each line.

    Raises:
        OptionError: what stands there is neither, or a vertex is named twice.
        MeshFileError: the file cannot be read.
    """
    given: dict[int, float | None] = {}
    for text, where in _entries(flag, noun, texts):
        parts = re.split(r"[\s,:;]+", text, maxsplit=1)
        try:
            vertex = int(parts[0])
        except ValueError as error:
            raise OptionError(
                f"{where} {text!r} is not VERTEX or VERTEX:CURVATURE, nor a file that is there"
            ) from error
        if vertex in given:
            raise OptionError(f"{where} vertex {vertex} is given as a {noun} twice")
        given[vertex] = parse_curvature(parts[1], f"{where} {text!r}") if len(parts) > 1 else None
    return given


def _entries(flag: str, noun: str, texts: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield what names a vertex, and where it stands."""
    for word in texts:
        if not is_file(word):
            yield from ((text.strip(), flag) for text in word.split(","))
            continue
        lines = [line.split("#", 1)[0].strip() for line in _lines(Path(word))]
        if not any(lines):
            raise OptionError(f"{word} holds no {noun}s")
        yield from ((text, f"{word}, line {number}:") for number, text in enumerate(lines, 1) if text)


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
            raise OptionError(f"{option}: {word!r} is not a vertex, and there is no such file")
    return tuple(dict.fromkeys(int(word) for word in words))


def read_pairs(name: str) -> IntArray:
    """Return (k, 2) the two vertices on each line of a text file.

    Raises:
        OptionError: a line holds something else.
        MeshFileError: the file cannot be read.
    """
    import numpy as np

    path, pairs = Path(name), []
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


def read_vertices_or_pairs(option: str, texts: Sequence[str]) -> IntArray:
    """Return vertices (k,) from "3,17,8" or files of such, or pairs (k, 2) from files with two on each line.

    Raises:
        OptionError: it is neither, or both are given.
        MeshFileError: a file cannot be read.
    """
    import numpy as np

    of_pairs = [text for text in texts if is_file(text) and _holds_pairs(Path(text))]
    if not of_pairs:
        return np.array([v for text in texts for v in read_vertices(option, text)], dtype=np.int64)
    if len(of_pairs) < len(texts):
        raise OptionError(f"{option} takes vertices or pairs of them, not both")
    return np.concatenate([read_pairs(text) for text in of_pairs])


def _holds_pairs(path: Path) -> bool:
    lines = [re.split(r"[\s,;-]+", line.split("#", 1)[0].strip()) for line in _lines(path)]
    return all(len(words) == 2 for words in lines if words != [""])


def read_weights(text: str) -> str | FloatArray:
    """Return the numbers of a file, or the text, which then is the name of a property.

    Raises:
        MeshFileError: the file cannot be read.
    """
    import numpy as np

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
