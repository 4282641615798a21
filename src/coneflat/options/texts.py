"""Values of options from text, as commands take them: vertices, curvatures, pairs, weights, and files of these."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import MeshFileError, OptionError

if TYPE_CHECKING:
    from ..base.arrays import FloatArray, IntArray


_CURVATURE = re.compile(
    r"(?P<number>[-+]?(?:\d+\.?\d*(?:e[-+]?\d+)?|\.\d+)?)\s*\*?\s*(?P<unit>pi|π|deg|°|rad)?\s*(?:/\s*(?P<by>\d+\.?\d*))?",
    re.IGNORECASE,
)
_UNITS = {"pi": math.pi, "π": math.pi, "deg": math.pi / 180, "°": math.pi / 180, "rad": 1.0, None: 1.0}


def read_word_or_vertex_map(flag: str, noun: str, texts: Sequence[str]) -> str | dict[int, float | None]:
    """Return the word of an option that takes one, or else its vertices as `read_vertex_map` does.

    Raises:
        OptionError: there are several words, or as of `read_vertex_map`.
        MeshFileError: a file cannot be read.
    """
    words = [text for text in texts if text.replace("-", "").isalpha() and not is_file(text)]
    if words and len(texts) > 1:
        raise OptionError(f"{flag} takes one choice, got {texts[0]} and {texts[1]}")
    return words[0] if words else read_vertex_map(flag, noun, texts)


def read_vertex_map(flag: str, noun: str, texts: Sequence[str]) -> dict[int, float | None]:
    """Return a map from vertex to curvature in radians; None for curvatures that must be computed.

    Args:
        flag: name of the option, for messages.
        noun: "cone" or "corner", for messages.
        texts: each is VERTEX[:CURVATURE], several of these separated by commas, or a file with one VERTEX [CURVATURE]
            per line.

    Raises:
        OptionError: a text cannot be parsed, or a vertex is given twice.
        MeshFileError: the file cannot be read.
    """
    curvatures: dict[int, float | None] = {}
    for text, where in _entries(flag, noun, texts):
        parts = re.split(r"[\s,:;]+", text, maxsplit=1)
        try:
            vertex = int(parts[0])
        except ValueError as error:
            raise OptionError(
                f"{where} {text!r} is not VERTEX or VERTEX:CURVATURE, and there is no such file"
            ) from error
        if vertex in curvatures:
            raise OptionError(f"{where} vertex {vertex} is given as a {noun} twice")
        curvatures[vertex] = parse_curvature(parts[1], f"{where} {text!r}") if len(parts) > 1 else None
    return curvatures


def _entries(flag: str, noun: str, texts: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield the text of each entry, and its place for messages."""
    for word in texts:
        if not is_file(word):
            yield from ((text.strip(), flag) for text in word.split(","))
            continue
        lines = _lines(Path(word))
        if not any(lines):
            raise OptionError(f"{word} contains no {noun}s")
        yield from ((text, f"{word}, line {number}:") for number, text in enumerate(lines, 1) if text)


def read_vertices(option: str, text: str) -> tuple[int, ...]:
    """Return the vertices of a text like "3,17,8", or of a text file.

    Raises:
        OptionError: the text cannot be parsed, and there is no such file.
        MeshFileError: the file cannot be read.
    """
    if is_file(text):
        option, text = text, " ".join(_lines(Path(text)))
    words = text.replace(",", " ").split()
    for word in words:
        if not re.fullmatch(r"[-+]?[0-9]{1,18}", word):
            raise OptionError(f"{option}: {word!r} is not a vertex, and there is no such file")
    return tuple(dict.fromkeys(int(word) for word in words))


def read_pairs(name: str) -> IntArray:
    """Return the (k, 2) pairs of vertices in a text file with one pair per line.

    Raises:
        OptionError: a line is not a pair of vertices.
        MeshFileError: the file cannot be read.
    """
    import numpy as np

    path, pairs = Path(name), []
    for number, text in enumerate(_lines(path), start=1):
        if not text:
            continue
        if not re.fullmatch(r"[0-9]{1,18}(\s*[,;-]\s*|\s+)[0-9]{1,18}", text):
            raise OptionError(f"{path}, line {number}: {text!r} is not a pair of vertices")
        pairs.append([int(word) for word in re.findall(r"[0-9]+", text)])
    if not pairs:
        raise OptionError(f"{path} contains no pairs of vertices")
    return np.array(pairs, dtype=np.int64)


def read_edges(flag: str, words: Sequence[str], texts: Sequence[str]) -> Any:
    """Return the (k, 2) pairs in files, one of the words of an option, or the word and the pairs.

    Raises:
        OptionError: a word is given twice, or a line of a file is not a pair of vertices.
        MeshFileError: a file cannot be read.
    """
    import numpy as np

    chosen = [text for text in texts if text in words]
    if len(chosen) > 1:
        raise OptionError(f"{flag} {chosen[0]} is given twice")
    files = [text for text in texts if text not in words]
    pairs = np.concatenate([read_pairs(text) for text in files]) if files else None
    if chosen and pairs is not None:
        return chosen[0], pairs
    return chosen[0] if chosen else pairs


def read_vertices_or_pairs(option: str, texts: Sequence[str]) -> IntArray:
    """Return (k,) vertices from texts like "3,17,8" or files of these, or (k, 2) pairs from files with one per line.

    Raises:
        OptionError: a text cannot be parsed, or both vertices and pairs are given.
        MeshFileError: a file cannot be read.
    """
    import numpy as np

    pair_files = [text for text in texts if is_file(text) and _holds_pairs(Path(text))]
    if not pair_files:
        return np.array([v for text in texts for v in read_vertices(option, text)], dtype=np.int64)
    if len(pair_files) < len(texts):
        raise OptionError(f"{option} takes vertices or pairs of them, not both")
    return np.concatenate([read_pairs(text) for text in pair_files])


def _holds_pairs(path: Path) -> bool:
    return all(len(re.split(r"[\s,;-]+", line)) == 2 for line in _lines(path) if line)


def read_numbers(noun: str, text: str) -> str | float | FloatArray:
    """Return the numbers in a file; or a number; or the text itself, which is then the name of a property.

    noun: what the numbers are, for messages.

    Raises:
        MeshFileError: the file cannot be read.
    """
    import numpy as np

    path = Path(text)
    if not is_file(text):
        with suppress(ValueError):
            return float(text)
        if path.suffix:
            raise MeshFileError(f"cannot read {noun} from {path}: there is no such file")
        return text
    try:
        values = np.load(path, allow_pickle=False) if path.suffix == ".npy" else np.loadtxt(path, ndmin=1)
        return np.asarray(values, dtype=np.float64)
    except (OSError, ValueError, TypeError, EOFError) as error:
        reason = "not a text file" if isinstance(error, UnicodeDecodeError) else " ".join(str(error).split())
        raise MeshFileError(f"cannot read {noun} from {path}: {reason}") from error


def parse_angle(text: str) -> float:
    """Return an angle in radians from "1.57", "pi/2", "-0.5pi" or "90deg".

    Raises:
        OptionError: the text is none of these.
    """
    return parse_curvature(text, "", "angle")


def parse_curvature(text: str, where: str, noun: str = "curvature") -> float:
    """Return a curvature in radians from "1.57", "pi/2", "-0.5pi" or "90deg".

    Raises:
        OptionError: the text is none of these.
    """
    place = f"{where}: " if where else ""
    match = _CURVATURE.fullmatch(text.strip())
    number = match["number"] if match else ""
    unit = match["unit"].lower() if match and match["unit"] else None
    if match is None or (number in ("", "+", "-") and unit not in ("pi", "π")):
        raise OptionError(f"{place}{text.strip()!r} is not a valid {noun}; write 1.57, pi/2, -0.5pi or 90deg")
    factor = float(number + "1" if number in ("", "+", "-") else number)
    divisor = float(match["by"] or 1)
    if divisor == 0:
        raise OptionError(f"{place}division by zero")
    return factor * _UNITS[unit] / divisor


def _lines(path: Path) -> list[str]:
    """Return the lines of a text file without their comments."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise MeshFileError(f"cannot read {path}: {reason}") from error
    return [line.split("#", 1)[0].strip() for line in lines]


def is_file(text: str) -> bool:
    """Return whether the value of an option is the path of an existing file."""
    try:
        return Path(text).is_file()
    except (OSError, ValueError):
        return False
