"""Constraints on the points of a layout during relaxation."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import FloatArray, IntArray
from ..base.text import plural
from ..errors import OptionError


@dataclass(frozen=True, eq=False)
class Lines:
    """Points that are constrained to lines.

    Attributes:
        points: (q,) point indices; a point on two lines is listed twice.
        line: (q,) the line of each point, from 0.
        directions: (l, 2) directions of the lines, of any length.
        offsets: (l,) position of each line: the dot product of its points with its unit normal, which is the direction
            rotated to the left by a quarter turn. NaN for a line that may move sideways. None: every line passes
            through its first point.
    """

    points: ArrayLike
    line: ArrayLike
    directions: ArrayLike
    offsets: ArrayLike | None = None


@dataclass(frozen=True, eq=False)
class PointConstraints:
    """Constraints on points; they need not hold at the start, but hold after relaxation.

    Attributes:
        pinned: (p,) indices of pinned points.
        places: (p, 2) final positions of the pinned points; None for their current positions.
        lines: points on lines; None for none.
        tied: (q,) half-edges of seams with prescribed translations.
        translations: (q, 2) the final translation of each tied half-edge: a point in the frame of its own triangle is
            the corresponding point in the frame of the opposite triangle, rotated by the seam's rotation, plus this.
        stride: largest fraction of the distance to the constraints per step; where lines turn, long steps fold them.
    """

    pinned: ArrayLike = ()
    places: ArrayLike | None = None
    lines: Lines | None = None
    tied: ArrayLike = ()
    translations: ArrayLike = ()
    stride: float = 1.0


@dataclass(frozen=True, eq=False)
class CheckedConstraints:
    """Validated constraints as arrays, with places and offsets filled in, and with unit directions."""

    pinned: IntArray
    places: FloatArray
    on_line: IntArray
    line: IntArray
    directions: FloatArray
    offsets: FloatArray
    tied: IntArray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    translations: FloatArray = field(default_factory=lambda: np.empty((0, 2)))


def check_constraints(constraints: PointConstraints, points: FloatArray) -> CheckedConstraints:
    """Return validated constraints on (u, 2) points.

    Raises:
        OptionError: shapes do not match, indices are out of range, or numbers are not finite.
    """
    pinned = _indices(constraints.pinned, len(points), "pinned")
    if len(np.unique(pinned)) < len(pinned):
        raise OptionError(f"pinned has {plural(len(pinned) - len(np.unique(pinned)), 'point')} twice")
    places = points[pinned] if constraints.places is None else _floats(constraints.places, "places")
    if places.shape != (len(pinned), 2):
        raise OptionError(
            f"places must have shape {(len(pinned), 2)}, one for each pinned point, got {places.shape}"
        )
    tied = np.asarray(constraints.tied, dtype=np.int64).ravel()
    translations = _floats(constraints.translations, "translations").reshape(-1, 2)
    if len(tied) != len(translations):
        raise OptionError(
            f"{plural(len(tied), 'half-edge')} tied, but {plural(len(translations), 'translation')} given for them"
        )
    on_line, line, directions, offsets = _checked_lines(constraints.lines, points)
    return CheckedConstraints(pinned, places, on_line, line, directions, offsets, tied, translations)


def _checked_lines(
    lines: Lines | None, points: FloatArray
) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """Return the points on lines, the line of each, unit directions and offsets, as in `CheckedConstraints`."""
    if lines is None:
        none = np.empty(0, dtype=np.int64)
        return none, none, np.empty((0, 2)), np.empty(0)
    on_line = _indices(lines.points, len(points), "points of lines")
    directions = _floats(lines.directions, "directions of lines").reshape(-1, 2)
    line = _indices(lines.line, len(directions), "line")
    if len(line) != len(on_line):
        raise OptionError(
            f"{plural(len(on_line), 'point')} of lines, but {plural(len(line), 'line')} given for them"
        )
    size = np.hypot(*directions.T)
    if not (size > 0).all():
        raise OptionError(f"{plural(int((size == 0).sum()), 'line')} with the direction (0, 0)")
    directions = directions / size[:, None]
    if lines.offsets is None:
        offsets = np.full(len(directions), np.nan)
        first, at = np.unique(line, return_index=True)
        offsets[first] = _across(directions[first], points[on_line[at]])
    else:
        offsets = np.asarray(lines.offsets, dtype=np.float64)
        if offsets.shape != (len(directions),) or np.isinf(offsets).any():
            raise OptionError(
                f"offsets of lines must be {plural(len(directions), 'number')}, or NaN, got shape {offsets.shape}"
            )
    return on_line, line, directions, offsets


def _across(directions: FloatArray, places: FloatArray) -> FloatArray:
    return directions[:, 0] * places[:, 1] - directions[:, 1] * places[:, 0]


def _indices(value: ArrayLike, count: int, name: str) -> IntArray:
    indices: Any = np.asarray(value)
    if indices.size == 0:
        return np.empty(0, dtype=np.int64)
    if indices.ndim != 1 or indices.dtype.kind not in "iu":
        raise OptionError(f"{name} must be a list of indices, got {indices.dtype} of shape {indices.shape}")
    if indices.min() < 0 or indices.max() >= count:
        raise OptionError(
            f"{name} must be below {count}, got indices from {indices.min()} to {indices.max()}"
        )
    return indices.astype(np.int64)


def _floats(value: ArrayLike, name: str) -> FloatArray:
    numbers = np.asarray(value, dtype=np.float64)
    if not np.isfinite(numbers).all():
        raise OptionError(
            f"{name} must be finite: {plural(int((~np.isfinite(numbers)).sum()), 'number')} not"
        )
    return numbers
