"""The drawing of a pattern: what is cut, folded and marked, with numbers and names."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ...base import IntArray
from .allowances import shapely
from .borders import Seam, Side
from .drawing import Drawing, Line, Text
from .finish import HEM, SEWN, Finish
from .labels import Labels
from .notches import notches_of
from .papers import EDGE
from .piece_texts import add_angle, add_grain, add_number, add_seam_name
from .result import Pattern
from .shapes import PieceShape, piece_shapes

# Dashes and gaps, mm: seam lines, folds away from the eye (mountains) and towards it (valleys).
SEAM_DASHES, MOUNTAIN, VALLEY = (4.0, 2.0), (7.0, 1.5, 1.0, 1.5), (4.0, 2.5)
# Radius of the circle around the tip of a dart, mm, and number of its sides.
TIP_RADIUS, TIP_SIDES = 1.5, 24


def drawing_of(pattern: Pattern) -> Drawing:
    """Return the drawing of a pattern, at its true size in millimetres.

    Raises:
        OptionError: options of the pattern cannot be met, or shapely is not installed.
    """
    finish = Finish.of(pattern.kind, pattern.settings)
    shapes = piece_shapes(pattern.surface, pattern.borders, finish, pattern.tabs)
    lines = [*_cut_lines(shapes), *_seam_lines(pattern, finish), *_tab_folds(pattern), *_folds(pattern)]
    lines += [*_notch_lines(pattern, finish), *_dart_tips(pattern)]
    width, height = np.max([shape.cut.bounds[2:] for shape in shapes], axis=0) + EDGE
    rooms = Rooms.of(shapes, float(width), float(height))
    for piece, room in enumerate(rooms.inside):
        lines += add_number(room, rooms.outside, piece, shapes[piece].inside.area)
        if pattern.kind in SEWN:
            lines += add_grain(room)
    for seam in sorted(pattern.seams, key=lambda seam: -min(seam.lengths)):
        for side, partner in (seam.sides, seam.sides[::-1]):
            name = name_of_side(seam, side, partner)
            add_seam_name(
                rooms.at(side.piece), name, pattern.surface.points[side.points], finish.width(seam.name)
            )
    piece_of_point = _piece_of_points(pattern)
    for ends, angle in zip(pattern.folds, pattern.fold_angles, strict=True):
        add_angle(rooms.inside[piece_of_point[ends[0]]], pattern.surface.points[ends], float(angle))
    for bend in pattern.bends:
        add_angle(rooms.inside[bend.piece], bend.line, bend.angle, bend.radius)
    return Drawing(float(width), float(height), tuple(lines), tuple(rooms.texts()))


@dataclass(frozen=True, eq=False)
class Rooms:
    """Where texts may be: in the pieces, in their allowances and tabs, and outside."""

    inside: list[Labels]
    allowances: list[Labels]
    outside: Labels

    @classmethod
    def of(cls, shapes: Sequence[PieceShape], width: float, height: float) -> Rooms:
        """Return the rooms of pieces on a sheet of a width and height, mm."""
        cut = [shape.cut for shape in shapes]
        return cls(
            [Labels(shape.inside) for shape in shapes],
            [Labels(shapely().difference(shape.cut, shape.inside)) for shape in shapes],
            Labels(shapely().difference(shapely().box(0, 0, width, height), shapely().union_all(cut))),
        )

    def at(self, piece: int) -> tuple[Labels, Labels, Labels]:
        """Return the rooms at a piece."""
        return self.inside[piece], self.allowances[piece], self.outside

    def texts(self) -> Iterator[Text]:
        """Yield all texts."""
        for room in (*self.inside, *self.allowances, self.outside):
            yield from room.texts


def name_of_side(seam: Seam, side: Side, partner: Side) -> str:
    """Return the text at a side of a seam: its name, the number of the piece to which it is sewn, and its ease."""
    if seam.is_dart:
        return f"dart {seam.name}"
    is_first = side is seam.sides[0]
    length, length_there = seam.lengths if is_first else seam.lengths[::-1]
    ease = f", ease {length - length_there:.1f} mm" if seam.is_eased and length > length_there else ""
    return f"{seam.name} ({partner.piece + 1}){ease}"


def _cut_lines(shapes: Sequence[PieceShape]) -> Iterator[Line]:
    return (Line("cut", ring, is_closed=True) for shape in shapes for ring in shape.cut_rings)


def _seam_lines(pattern: Pattern, finish: Finish) -> Iterator[Line]:
    """Yield the sides of seams and hems inside allowances."""
    names = [(seam.name, side) for seam in pattern.seams for side in seam.sides]
    for name, side in [*names, *((HEM, hem) for hem in pattern.borders.hems)]:
        if finish.width(name) > 0:
            yield Line("mark", pattern.surface.points[side.points], dashes=SEAM_DASHES)


def _tab_folds(pattern: Pattern) -> Iterator[Line]:
    return (Line("fold", tab.polygon[[0, -1]], dashes=MOUNTAIN) for tab in pattern.tabs)


def _folds(pattern: Pattern) -> Iterator[Line]:
    for ends, angle in zip(pattern.folds, pattern.fold_angles, strict=True):
        yield Line("fold", pattern.surface.points[ends], dashes=MOUNTAIN if angle > 0 else VALLEY)
    for bend in pattern.bends:
        yield Line("fold", bend.line, dashes=MOUNTAIN if bend.angle > 0 else VALLEY)


def _notch_lines(pattern: Pattern, finish: Finish) -> Iterator[Line]:
    for seam in pattern.seams if pattern.kind in SEWN else ():
        for notches in notches_of(seam, pattern.surface.points):
            for notch in notches:
                yield from (Line("mark", ends) for ends in notch.lines(finish.width(seam.name)))


def _dart_tips(pattern: Pattern) -> Iterator[Line]:
    """Yield a circle and a cross at the tip of each dart."""
    angles = 2 * np.pi * np.arange(TIP_SIDES) / TIP_SIDES
    circle = TIP_RADIUS * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    across = TIP_RADIUS * np.array([[-1.0, 0.0], [1.0, 0.0]])
    for dart in pattern.darts:
        tip = pattern.surface.points[dart.tip]
        yield Line("mark", tip + circle, is_closed=True)
        yield from (Line("mark", tip + arm) for arm in (across, across[:, ::-1]))


def _piece_of_points(pattern: Pattern) -> IntArray:
    surface = pattern.surface
    piece = np.zeros(len(surface.points), dtype=np.int64)
    piece[surface.corners] = surface.pieces[:, None]
    return piece
