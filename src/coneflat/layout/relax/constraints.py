"""What points of a layout must do while it is relaxed."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...base.arrays import FloatArray, IntArray
from ...base.text import plural
from ...errors import OptionError


@dataclass(frozen=True)
class Lines:
    """Points that lie on lines.

    Attributes:
        points: (q,) points; one on two lines is there twice.
        line: (q,) the line of each, from 0.
        directions: (l, 2) of the lines, of any length.
        offsets: (l,) where each line is: its unit normal, a quarter turn to the left of its direction, times its
            places. NaN for a line that may shift sideways. None: all are where their first point is.
    """

    points: ArrayLike
    line: ArrayLike
    directions: ArrayLike
    offsets: ArrayLike | None = None


@dataclass(frozen=True)
class PointConstraints:
    """What points must do; what does not hold in the beginning does in the end.

    Attributes:
        pinned: (p,) points.
        places: (p, 2) where these are in the end; None: where they are.
        lines: points on lines; None for none.
        held_seams: (k, 2) edges, as vertices, of seams whose two sides keep not only the rotation between them but the
            translation, too.
        tied: (q,) half-edges of seams.
        translations: (q, 2) what is added in the end to a point in the frame of the triangle across each, turned by the
            seam's rotation, to give the one in the frame of its own.
        quarter_turns: the sides of seams come to be the nearest quarter turns of each other, point by point, whatever
            they are as yet; else they must be rigid copies, and keep their rotations.
        nodes: vertices at which seams end in any case.
    """

    pinned: ArrayLike = ()
    places: ArrayLike | None = None
    lines: Lines | None = None
    held_seams: ArrayLike = ()
    tied: ArrayLike = ()
    translations: ArrayLike = ()
    quarter_turns: bool = False
    nodes: ArrayLike = ()


@dataclass(frozen=True, eq=False)
class CheckedConstraints:
    """The same as arrays that fit each other; offsets and places are given, with unit directions."""

    pinned: IntArray
    places: FloatArray
    on_line: IntArray
    line: IntArray
    directions: FloatArray
    offsets: FloatArray
    held_seams: IntArray = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))
    tied: IntArray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    translations: FloatArray = field(default_factory=lambda: np.empty((0, 2)))
    quarter_turns: bool = False
    nodes: IntArray = field(default_factory=lambda: np.empty(0, dtype=np.int64))


def check_constraints(constraints: PointConstraints, points: FloatArray) -> CheckedConstraints:
    """Return constraints on (u, 2) points, checked.

    Raises:
        OptionError: shapes do not fit, indices are out of range, or numbers are not finite.
    """
    pinned = _indices(constraints.pinned, len(points), "pinned")
    if len(np.unique(pinned)) < len(pinned):
        raise OptionError(f"pinned has {plural(len(pinned) - len(np.unique(pinned)), 'point')} twice")
    places = points[pinned] if constraints.places is None else _floats(constraints.places, "places")
    if places.shape != (len(pinned), 2):
        raise OptionError(
            f"places have shape {places.shape}, not {(len(pinned), 2)}, one for each pinned point"
        )
    held = np.asarray(constraints.held_seams, dtype=np.int64).reshape(-1, 2)
    tied = np.asarray(constraints.tied, dtype=np.int64).ravel()
    translations = _floats(constraints.translations, "translations").reshape(-1, 2)
    if len(tied) != len(translations):
        raise OptionError(
            f"{plural(len(tied), 'half-edge')} tied, but {plural(len(translations), 'translation')} for them"
        )
    nodes = np.asarray(constraints.nodes, dtype=np.int64).ravel()
    on_line, line, directions, offsets = _checked_lines(constraints.lines, points)
    return CheckedConstraints(
        pinned,
        places,
        on_line,
        line,
        directions,
        offsets,
        held,
        tied,
        translations,
        constraints.quarter_turns,
        nodes,
    )


def _checked_lines(
    lines: Lines | None, points: FloatArray
) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """Return points, the line of each, unit directions and offsets, as `CheckedConstraints` has them."""
    if lines is None:
        none = np.empty(0, dtype=np.int64)
        return none, none, np.empty((0, 2)), np.empty(0)
    on_line = _indices(lines.points, len(points), "points of lines")
    directions = _floats(lines.directions, "directions of lines").reshape(-1, 2)
    line = _indices(lines.line, len(directions), "line")
    if len(line) != len(on_line):
        raise OptionError(
            f"{plural(len(on_line), 'point')} of lines, but {plural(len(line), 'line')} for them"
        )
    size = np.hypot(*directions.T)
    if not (size > 0).all():
        raise OptionError(f"{plural(int((size == 0).sum()), 'line')} with direction (0, 0)")
    directions = directions / size[:, None]
    if lines.offsets is None:
        offsets = np.full(len(directions), np.nan)
        first, at = np.unique(line, return_index=True)
        offsets[first] = _across(directions[first], points[on_line[at]])
    else:
        offsets = np.asarray(lines.offsets, dtype=np.float64)
        if offsets.shape != (len(directions),) or np.isinf(offsets).any():
            raise OptionError(
                f"offsets of lines must be {plural(len(directions), 'number')}, or NaN, not of shape {offsets.shape}"
            )
    return on_line, line, directions, offsets


def _across(directions: FloatArray, places: FloatArray) -> FloatArray:
    across: FloatArray = directions[:, 0] * places[:, 1] - directions[:, 1] * places[:, 0]
    return across


def _indices(value: ArrayLike, count: int, name: str) -> IntArray:
    given: Any = np.asarray(value)
    if given.size == 0:
        return np.empty(0, dtype=np.int64)
    if given.ndim != 1 or given.dtype.kind not in "iu":
        raise OptionError(f"{name} must be a list of indices, not {given.dtype} of shape {given.shape}")
    if given.min() < 0 or given.max() >= count:
        raise OptionError(f"{name} has indices from {given.min()} to {given.max()}, of {count}")
    indices: IntArray = given.astype(np.int64)
    return indices


def _floats(value: ArrayLike, name: str) -> FloatArray:
    given = np.asarray(value, dtype=np.float64)
    if not np.isfinite(given).all():
        raise OptionError(f"{name} must be finite: {plural(int((~np.isfinite(given)).sum()), 'number')} not")
    return given
