"""Kinds of options: how values are parsed, and the errors for invalid ones."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from numbers import Integral
from typing import TYPE_CHECKING, Any, ClassVar

from ..base.text import short_repr
from ..errors import OptionError
from .texts import parse_curvature

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..base.arrays import IntArray

# NumPy is imported late, because commands that only print their help do not need it.


@dataclass(frozen=True)
class Kind:
    """The values that an option takes; the base class takes any value.

    Attributes:
        metavar: what helps show for a text that is a word or something else, such as "curvature|NAME".
    """

    metavar: ClassVar[str] = ""

    def parse(self, name: str, value: Any) -> Any:
        """Return a value in the form that the rest of the package uses.

        Args:
            name: of the option, for messages.
            value: as the user gave it.

        Raises:
            OptionError: the value is invalid.
        """
        return value


@dataclass(frozen=True)
class Choice(Kind):
    """One of several words."""

    words: tuple[str, ...]

    def parse(self, name: str, value: Any) -> str:
        if not isinstance(value, str) or value not in self.words:
            raise OptionError(f"unknown {name} {short_repr(value)}: choose from {', '.join(self.words)}")
        return value


@dataclass(frozen=True)
class Flag(Kind):
    """True or False."""

    def parse(self, name: str, value: Any) -> bool:
        import numpy as np

        if not isinstance(value, (bool, np.bool_)):
            raise OptionError(f"{name} must be True or False, got {short_repr(value)}")
        return bool(value)


@dataclass(frozen=True)
class Number(Kind):
    """A number; a strength is from 0 and also accepts True (1) and False (0).

    An angle is in radians, and may be a text such as "40deg" or "pi/2".

    Attributes:
        minimum, maximum: inclusive bounds.
        is_integer: the number must be an integer.
        is_positive: the number must be finite and above 0.
        is_angle, is_strength: the number is an angle, or a strength.
        optional: None is allowed, also as the word "none".
    """

    minimum: float = -math.inf
    maximum: float = math.inf
    is_integer: bool = False
    is_positive: bool = False
    is_angle: bool = False
    is_strength: bool = False
    optional: bool = False

    def parse(self, name: str, value: Any) -> float | None:
        if self.optional and (value is None or (isinstance(value, str) and value == "none")):
            return None
        if self.is_strength and type(value).__name__ in ("bool", "bool_"):
            value = float(value)
        if self.is_angle and isinstance(value, str):
            value = parse_curvature(value, name, "angle")
        number = as_integer(name, value) if self.is_integer else as_number(name, value)
        if not self.minimum <= number <= self.maximum or (self.is_positive and not 0 < number < math.inf):
            raise OptionError(f"{name} must be {self.text}, got {number:,{'' if self.is_integer else '.6g'}}")
        return number

    @property
    def text(self) -> str:
        """A description of the valid numbers, for messages."""
        noun = "an integer" if self.is_integer else "a number"
        if self.is_positive or self.minimum == -math.inf:
            return f"{noun} above 0" if self.is_positive else noun
        if self.maximum == math.inf:
            return f"{noun}, {self.minimum:g} or more"
        return f"{noun} from {self.minimum:g} to {self.maximum:,g}"


ANGLE, ANGLE_OR_NONE = Number(is_angle=True), Number(is_angle=True, optional=True)
POSITIVE = Number(is_positive=True)
COUNT = Number(0, is_integer=True, optional=True)


def strength(maximum: float) -> Number:
    """Return the kind of a strength from 0 to `maximum`."""
    return Number(0, maximum, is_strength=True)


def integer(maximum: float = math.inf) -> Number:
    """Return the kind of an integer from 1 to `maximum`."""
    return Number(1, maximum, is_integer=True)


@dataclass(frozen=True)
class Vertices(Kind):
    """Vertex indices from 0, parsed to a tuple; None for no vertices."""

    def parse(self, name: str, value: Any) -> tuple[int, ...]:
        if value is None:
            return ()
        noun = name.replace("_", " ").removesuffix("s")
        if isinstance(value, Mapping):
            raise OptionError(f"{noun}s must be a list of vertices without curvatures, got a map")
        return tuple(given_vertices(noun, value))


@dataclass(frozen=True)
class WordOrVertices(Kind):
    """A word, or vertices with or without curvatures (radians), parsed to a map from vertex to curvature or None.

    Attributes:
        words: the words.
        noun: the noun for such a vertex in messages.
        empty_error: error message for an empty list; "" if it is allowed.
        may_differ: some vertices may have a curvature and others not; else all or none must have one.
    """

    words: tuple[str, ...]
    noun: str
    empty_error: str = ""
    may_differ: bool = False

    def parse(self, name: str, value: Any) -> str | dict[int, float | None]:
        if isinstance(value, str):
            return Choice(self.words).parse(name, value)
        curvatures = given_vertices(self.noun, value, self.may_differ)
        if self.empty_error and not curvatures:
            raise OptionError(self.empty_error)
        return curvatures


@dataclass(frozen=True)
class Edges(Kind):
    """Edges as (k, 2) pairs of vertices, a word, or a word with such pairs; None for no edges."""

    words: tuple[str, ...]

    def parse(self, name: str, value: Any) -> str | IntArray | tuple[str, IntArray] | None:
        if isinstance(value, str):
            return Choice(self.words).parse(name, value)
        if isinstance(value, (tuple, list)) and len(value) == 2 and isinstance(value[0], str):
            return Choice(self.words).parse(name, value[0]), _pairs(name, value[1])
        return None if value is None else _pairs(name, value)


@dataclass(frozen=True)
class VerticesOrEdges(Kind):
    """Vertices (k,), from 0, or edges as pairs of vertices (k, 2); None for no edges."""

    def parse(self, name: str, value: Any) -> IntArray | None:
        import numpy as np

        if value is None:
            return None
        indices = _indices(name, value)
        if (
            indices.ndim not in (1, 2)
            or indices.shape[1:] not in ((), (2,))
            or indices.dtype.kind not in "iu"
        ):
            raise OptionError(
                f"{name} must be vertices (k,) or pairs of vertices (k, 2), got shape {indices.shape} and type "
                f"{indices.dtype}"
            )
        return indices.astype(np.int64)


@dataclass(frozen=True)
class Weights(Kind):
    """A number for each vertex, or for some; or the name of a vertex property in the file; checked with the mesh."""


@dataclass(frozen=True)
class Direction(Kind):
    """A direction in space as three numbers, not all 0, or a word; None for no direction.

    Attributes:
        words: the words.
    """

    words: tuple[str, ...] = ()

    def parse(self, name: str, value: Any) -> tuple[float, float, float] | str | None:
        import numpy as np

        if value is None:
            return None
        if isinstance(value, str) and value in self.words:
            return value
        direction = _array(name, value)
        is_one = direction.shape == (3,) and direction.dtype.kind in "fiu"
        if not (is_one and np.isfinite(direction).all() and direction.any()):
            raise OptionError(
                f"{name} must be {' or '.join([*self.words, 'a direction'])}, three numbers that are not all 0, "
                f"got {short_repr(value)}"
            )
        direction = direction.astype(np.float64)
        largest = np.abs(direction).max()
        # The squared length must be neither 0 nor infinite in double precision.
        x, y, z = (direction if abs(np.frexp(largest)[1]) < 300 else direction / largest).tolist()
        return x, y, z


def as_number(name: str, value: object) -> float:
    """Return a value as a float, or raise OptionError.

    Raises:
        OptionError: the value is not a number; the message begins with `name`.
    """
    import numpy as np

    is_scalar = np.ndim(value) == 0 if isinstance(value, np.ndarray) else not isinstance(value, (str, bytes))
    if not is_scalar or isinstance(value, (bool, np.bool_, complex, np.complexfloating)):
        raise OptionError(f"{name} must be a number, got {short_repr(value)}")
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError) as error:
        raise OptionError(f"{name} must be a number, got {short_repr(value)}") from error


def as_integer(name: str, value: object) -> int:
    """Return a value as an integer, or raise OptionError.

    Raises:
        OptionError: the value is not an integer; the message begins with `name`.
    """
    import numpy as np

    number = math.nan if isinstance(value, (bool, np.bool_)) else as_number(name, value)
    if not number.is_integer() or abs(number) >= 2**62:
        raise OptionError(f"{name} must be an integer, got {short_repr(value)}")
    return int(number)


def _array(name: str, value: object) -> NDArray[Any]:
    import numpy as np

    try:
        return np.asarray(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise OptionError(f"{name}: {error}") from error


def _indices(name: str, value: object) -> NDArray[Any]:
    """Return a value as an array, of integers if it is empty."""
    values = _array(name, list(value) if isinstance(value, (set, frozenset)) else value)
    return values if values.size else values.astype("i8")


def _pairs(noun: str, value: object) -> IntArray:
    """Return (k, 2) pairs of vertices."""
    import numpy as np

    pairs = _indices(noun, value)
    if not pairs.size:
        return np.empty((0, 2), dtype=np.int64)
    if pairs.ndim != 2 or pairs.shape[1] != 2 or pairs.dtype.kind not in "iu":
        raise OptionError(
            f"{noun} must be pairs of vertices (k, 2), got shape {pairs.shape} and type {pairs.dtype}"
        )
    return pairs.astype(np.int64)


def given_vertices(noun: str, vertices: object, may_differ: bool = False) -> dict[int, float | None]:
    """Return a map from vertex to curvature, None where it must be computed.

    Args:
        noun: the noun for such a vertex in messages.
        vertices: vertices, or a map from vertex to curvature.
        may_differ: some vertices may have a curvature and others not; else all or none must have one.

    Raises:
        OptionError: the value is invalid.
    """
    import numpy as np

    if isinstance(vertices, Mapping):
        curvatures: dict[int, float | None] = {
            as_integer(f"a {noun}'s vertex", v): None if k is None else as_number(f"a {noun}'s curvature", k)
            for v, k in vertices.items()
        }
    elif isinstance(vertices, Iterable) and not isinstance(vertices, (str, bytes)):
        if isinstance(vertices, np.ndarray) and np.ndim(vertices) != 1:
            raise OptionError(f"{noun}s must be a list of vertices, got {short_repr(vertices)}")
        listed = [as_integer(f"a {noun}'s vertex", v) for v in vertices]
        curvatures = dict.fromkeys(listed)
        if len(curvatures) < len(listed):
            twice = next(v for i, v in enumerate(listed) if v in listed[:i])
            raise OptionError(f"vertex {twice} is given as a {noun} twice")
    else:
        is_count = noun == "cone" and isinstance(vertices, Integral) and int(vertices) > 0
        advice = f": for a number of cones use cone_count={short_repr(vertices)}" if is_count else ""
        raise OptionError(
            f"{noun}s must be vertices, or a map from vertex to curvature, got {type(vertices).__name__}{advice}"
        )
    unknown = [v for v, k in curvatures.items() if k is None]
    if unknown and len(unknown) < len(curvatures) and not may_differ:
        known_count = len(curvatures) - len(unknown)
        raise OptionError(
            f"{known_count} of {len(curvatures)} {noun}s have a curvature and vertex {unknown[0]} has "
            "none: give curvatures for all, or for none"
        )
    for v, k in curvatures.items():
        if k is not None and not math.isfinite(k):
            raise OptionError(f"the curvature of {noun} {v} must be finite, got {k}")
    return curvatures
