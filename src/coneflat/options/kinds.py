"""Kinds of options: what values they take, and what is said of others."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..errors import OptionError
from ..text import shown

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .._arrays import IntArray

# NumPy is imported late: commands that only print their help need none.


@dataclass(frozen=True)
class Kind:
    """What values an option takes: this one takes anything."""

    def parse(self, name: str, value: Any) -> Any:
        """Return a value in the one form that the rest of the package knows.

        Raises:
            OptionError: it makes no sense.
        """
        return value

    @property
    def bounds(self) -> str:
        """What values there are, for tables."""
        return ""


@dataclass(frozen=True)
class Choice(Kind):
    """One of a few words."""

    words: tuple[str, ...]

    def parse(self, name: str, value: Any) -> str:
        if not isinstance(value, str) or value not in self.words:
            raise OptionError(f"unknown {name} {shown(value)}: choose from {', '.join(self.words)}")
        return value

    @property
    def bounds(self) -> str:
        return ", ".join(f"`{word}`" for word in self.words)


@dataclass(frozen=True)
class Flag(Kind):
    """Yes or no."""

    def parse(self, name: str, value: Any) -> bool:
        import numpy as np

        if not isinstance(value, (bool, np.bool_)):
            raise OptionError(f"{name} is True or False, not {shown(value)}")
        return bool(value)


@dataclass(frozen=True)
class Number(Kind):
    """A number; an angle is one in radians.

    Attributes:
        is_angle: it is an angle.
        optional: None stands for no number.
        positive: it is finite and above 0.
    """

    is_angle: bool = False
    optional: bool = False
    positive: bool = False

    def parse(self, name: str, value: Any) -> float | None:
        if value is None and self.optional:
            return None
        number = as_number(name, value)
        if self.positive and not 0 < number < math.inf:
            raise OptionError(f"{name} must be a positive number, not {number:g}")
        return number

    @property
    def bounds(self) -> str:
        return "above 0" if self.positive else "radians" if self.is_angle else ""


@dataclass(frozen=True)
class Strength(Kind):
    """A number from 0 to a largest one; True and False are 1 and 0."""

    most: float

    def parse(self, name: str, value: Any) -> float:
        import numpy as np

        number = float(value) if isinstance(value, (bool, np.bool_)) else as_number(name, value)
        if not 0 <= number <= self.most:
            raise OptionError(f"{name} must be a number from 0 to {self.most:g}, not {number:g}")
        return number

    @property
    def bounds(self) -> str:
        return f"0 to {self.most:g}"


@dataclass(frozen=True)
class Count(Kind):
    """A whole number from 0; None for none."""

    def parse(self, name: str, value: Any) -> int | None:
        if value is None:
            return None
        count = as_whole(name, value)
        if count < 0:
            raise OptionError(f"{name} cannot be negative ({value})")
        return count

    @property
    def bounds(self) -> str:
        return "from 0"


@dataclass(frozen=True)
class Whole(Kind):
    """A whole number from 1 to a largest one."""

    most: int

    def parse(self, name: str, value: Any) -> int:
        number = as_whole(name, value)
        if not 1 <= number <= self.most:
            raise OptionError(f"{name} must be from 1 to {self.most:,}, not {number:,}")
        return number

    @property
    def bounds(self) -> str:
        return f"1 to {self.most:,}"


@dataclass(frozen=True)
class Most(Kind):
    """The largest number of cones."""

    def parse(self, name: str, value: Any) -> int:
        import numpy as np

        is_number = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
        if not is_number or not float(value).is_integer() or value < 1:
            raise OptionError(
                f"the largest number of cones must be a whole number from 1, not {shown(value)}"
            )
        return int(value)


@dataclass(frozen=True)
class Vertices(Kind):
    """Vertices, from 0, as a tuple; None stands for none, or, if `optional`, for no choice."""

    optional: bool = False

    def parse(self, name: str, value: Any) -> tuple[int, ...] | None:
        if value is None:
            return None if self.optional else ()
        noun = name.replace("_", " ").removesuffix("s")
        if isinstance(value, Mapping):
            raise OptionError(f"{noun}s are vertices alone, without curvatures: give a list of them")
        return tuple(given_vertices(noun, value))


@dataclass(frozen=True)
class WordOrVertices(Kind):
    """A word, or vertices, with curvatures (radians) or without: a map to curvature or None.

    Attributes:
        words: the words.
        noun: what a vertex becomes.
        lacking: what is said of no vertices; "" if they may be none.
        may_differ: some may have a curvature and others none; else all or none have.
    """

    words: tuple[str, ...]
    noun: str
    lacking: str = ""
    may_differ: bool = False

    def parse(self, name: str, value: Any) -> str | dict[int, float | None]:
        if isinstance(value, str):
            return Choice(self.words).parse(name, value)
        given = given_vertices(self.noun, value, self.may_differ)
        if self.lacking and not given:
            raise OptionError(self.lacking)
        return given

    @property
    def bounds(self) -> str:
        return Choice(self.words).bounds + ", or vertices"


@dataclass(frozen=True)
class Edges(Kind):
    """Edges as (k, 2) pairs of vertices, a word, or a word and such pairs; None for none."""

    words: tuple[str, ...] = ()

    def parse(self, name: str, value: Any) -> str | IntArray | tuple[str, IntArray] | None:
        if isinstance(value, str) and self.words:
            return Choice(self.words).parse(name, value)
        if self.words and isinstance(value, (tuple, list)) and len(value) == 2 and isinstance(value[0], str):
            return Choice(self.words).parse(name, value[0]), _pairs(name.replace("_", " "), value[1])
        return None if value is None else _pairs(name.replace("_", " "), value)

    @property
    def bounds(self) -> str:
        return (Choice(self.words).bounds + ", or " if self.words else "") + "pairs of vertices"


@dataclass(frozen=True)
class Weights(Kind):
    """A number for each vertex, or for some; or the name of a property in the file; checked with the mesh."""

    @property
    def bounds(self) -> str:
        return "(n,) numbers from 0, some vertices with theirs, or the name of a property"


@dataclass(frozen=True)
class Direction(Kind):
    """A direction in space, not 0, as three numbers; None for none."""

    def parse(self, name: str, value: Any) -> tuple[float, float, float] | None:
        import numpy as np

        if value is None:
            return None
        direction = _array(name, value)
        is_one = direction.shape == (3,) and direction.dtype.kind in "fiu"
        if not (is_one and np.isfinite(direction).all() and direction.any()):
            raise OptionError(
                f"{name} must be a direction, three numbers that are not all 0, not {shown(value)}"
            )
        direction = direction.astype(np.float64)
        largest = np.abs(direction).max()
        # The squared length of what is used must be neither 0 nor infinite in double precision.
        x, y, z = (direction if 1e-100 < largest < 1e100 else direction / largest).tolist()
        return x, y, z


def as_number(name: str, value: object) -> float:
    """Return a number, or raise OptionError."""
    import numpy as np

    is_scalar = np.ndim(value) == 0 if isinstance(value, np.ndarray) else not isinstance(value, (str, bytes))
    if not is_scalar or isinstance(value, (bool, np.bool_, complex, np.complexfloating)):
        raise OptionError(f"{name} must be a number, not {shown(value)}")
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError) as error:
        raise OptionError(f"{name} must be a number, not {shown(value)}") from error


def as_whole(name: str, value: object) -> int:
    """Return a whole number, or raise OptionError."""
    import numpy as np

    number = math.nan if isinstance(value, (bool, np.bool_)) else as_number(name, value)
    if not number.is_integer() or abs(number) >= 2**62:
        raise OptionError(f"{name} must be a whole number, not {shown(value)}")
    return int(number)


def _array(name: str, value: object) -> NDArray[Any]:
    import numpy as np

    try:
        return np.asarray(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise OptionError(f"{name}: {error}") from error


def _pairs(noun: str, given: object) -> IntArray:
    """Return (k, 2) pairs of vertices."""
    import numpy as np

    pairs = _array(noun, list(given) if isinstance(given, (set, frozenset)) else given)
    if not pairs.size:
        return np.empty((0, 2), dtype=np.int64)
    if pairs.ndim != 2 or pairs.shape[1] != 2 or pairs.dtype.kind not in "iu":
        raise OptionError(
            f"{noun} must be pairs of vertices (k, 2), not of shape {pairs.shape} and type {pairs.dtype}"
        )
    return pairs.astype(np.int64)


def given_vertices(noun: str, vertices: object, may_differ: bool = False) -> dict[int, float | None]:
    """Return vertex -> curvature, None where it is to be computed: for all or for none, unless they may differ."""
    import numpy as np

    if isinstance(vertices, Mapping):
        given: dict[int, float | None] = {
            as_whole(f"a {noun}'s vertex", v): None if k is None else as_number(f"a {noun}'s curvature", k)
            for v, k in vertices.items()
        }
    elif isinstance(vertices, Iterable) and not isinstance(vertices, (str, bytes)):
        if isinstance(vertices, np.ndarray) and np.ndim(vertices) != 1:
            raise OptionError(f"{noun}s must be a list of vertices, not {shown(vertices)}")
        listed = [as_whole(f"a {noun}'s vertex", v) for v in vertices]
        given = dict.fromkeys(listed)
        if len(given) < len(listed):
            twice = next(v for i, v in enumerate(listed) if v in listed[:i])
            raise OptionError(f"vertex {twice} is given as a {noun} twice")
    else:
        raise OptionError(
            f"{noun}s must be vertices, or a map from vertex to curvature, not {type(vertices).__name__}"
        )
    unknown = [v for v, k in given.items() if k is None]
    if unknown and len(unknown) < len(given) and not may_differ:
        raise OptionError(
            f"{len(given) - len(unknown)} of {len(given)} {noun}s have a curvature and vertex {unknown[0]} has "
            "none: give curvatures to all, or to none"
        )
    for v, k in given.items():
        if k is not None and not math.isfinite(k):
            raise OptionError(f"the curvature of {noun} {v} is {k}")
    return given
