"""The drawing of a pattern: what is cut, folded and marked, with numbers and names."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ....base import FloatArray, list_some
from ..finish import HEM, Finish
from ..result import Pattern
from .allowances import shapely
from .drawing import Drawing, Line, Text
from .labels import Labels
from .notches import notches_of
from .piece_texts import add_angle, add_grain, add_number, add_seam_name
from .seam_names import names_of
from .shapes import PieceShape, fold_of_tab

if TYPE_CHECKING:
    from shapely import Polygon

# Dashes and gaps, mm: seam lines, folds away from the eye (mountains) and towards it (valleys).
SEAM_DASHES, MOUNTAIN, VALLEY = (4.0, 2.0), (7.0, 1.5, 1.0, 1.5), (4.0, 2.5)
# Radius of the circle around the tip of a dart, mm, and number of its sides.
TIP_RADIUS, TIP_SIDES = 1.5, 24


def drawing_of(pattern: Pattern) -> Drawing:
    """Return the drawing of a pattern, at its true size in millimetres.

    Raises:
        OptionError: options of the pattern cannot be met, or shapely is not installed.
    """
    finish, shapes = pattern.finish, pattern.shapes
    lines = [*_cut_lines(shapes), *_seam_lines(pattern, finish), *_tab_folds(pattern), *_folds(pattern)]
    lines += [Line("mark", ends) for _, ends in _notches(pattern, finish)]
    lines += _dart_tips(pattern)
    rooms = Rooms.of(shapes, *pattern.sheet_size)
    points, piece_of_point = pattern.surface.points, pattern.surface.piece_of_point
    for dart in pattern.darts:
        rooms.inside[dart.sides[0].piece].cover(shapely().Point(points[dart.tip]).buffer(TIP_RADIUS))
    for piece, ends in _notches(pattern, finish):
        for room in (rooms.inside[piece], rooms.allowances[piece]):
            room.cover(shapely().LineString(ends))
    for ends in pattern.folds:
        rooms.inside[piece_of_point[ends[0]]].avoid(shapely().LineString(points[ends]))
    pages = _pages(pattern)
    for piece, room in enumerate(rooms.inside):
        lines += add_number(room, rooms.outside, piece, shapes[piece].inside.area, pages)
        if pattern.has_grain:
            lines += add_grain(room)
    unnamed = list[str]()
    for seam in sorted(pattern.seams, key=lambda seam: -min(seam.lengths)):
        for name in names_of(pattern.kind, seam, points, is_single=pattern.piece_count == 1):
            leaders = add_seam_name(rooms.at(name.piece), name.text, name.line, finish.width(seam.name))
            lines += leaders or []
            unnamed += [f"{name.text} of piece {name.piece + 1}"] if leaders is None else []
    for ends, angle in zip(pattern.folds, pattern.fold_angles, strict=True):
        add_angle(rooms.inside[piece_of_point[ends[0]]], points[ends], float(angle))
    for bend in pattern.bends:
        add_angle(rooms.inside[bend.piece], bend.line, bend.angle, bend.radius)
    notes = (
        ()
        if not unnamed
        else (f"no room for the name of the seam {list_some(unnamed)}: see the table of seams",)
    )
    return Drawing(*pattern.sheet_size, tuple(lines), tuple(rooms.texts()), notes)


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


def _pages(pattern: Pattern) -> list[Polygon]:
    """Return the rectangles of the pages onto which a pattern is tiled."""
    return [shapely().box(*tile.low, *tile.high) for tile in pattern.tiles]


def _cut_lines(shapes: Sequence[PieceShape]) -> Iterator[Line]:
    for shape in shapes:
        yield from (Line("cut", ring, is_closed=True) for ring in shape.cut_rings)


def _seam_lines(pattern: Pattern, finish: Finish) -> Iterator[Line]:
    """Yield the sides of seams and hems inside allowances."""
    names = [(seam.name, side) for seam in pattern.seams for side in seam.sides]
    for name, side in [*names, *((HEM, hem) for hem in pattern.borders.hems)]:
        if finish.width(name) > 0:
            yield Line("mark", pattern.surface.points[side.points], dashes=SEAM_DASHES)


def _tab_folds(pattern: Pattern) -> Iterator[Line]:
    for tab in pattern.tabs:
        yield Line("fold", fold_of_tab(pattern.surface, pattern.borders, tab), dashes=MOUNTAIN)


def _folds(pattern: Pattern) -> Iterator[Line]:
    for ends, angle in zip(pattern.folds, pattern.fold_angles, strict=True):
        yield Line("fold", pattern.surface.points[ends], dashes=MOUNTAIN if angle > 0 else VALLEY)
    for bend in pattern.bends:
        yield Line("fold", bend.line, dashes=MOUNTAIN if bend.angle > 0 else VALLEY)


def _notches(pattern: Pattern, finish: Finish) -> Iterator[tuple[int, FloatArray]]:
    """Yield the lines (2, 2) of notches, and their pieces."""
    for seam in pattern.seams if pattern.is_sewn else ():
        for side, notches in zip(seam.sides, notches_of(seam, pattern.surface.points), strict=True):
            for notch in notches:
                yield from ((side.piece, ends) for ends in notch.lines(finish.width(seam.name)))


def _dart_tips(pattern: Pattern) -> Iterator[Line]:
    """Yield a circle and a cross at the tip of each dart; nets and sheets have none, where the sides are glued."""
    angles = 2 * np.pi * np.arange(TIP_SIDES) / TIP_SIDES
    circle = TIP_RADIUS * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    across = TIP_RADIUS * np.array([[-1.0, 0.0], [1.0, 0.0]])
    for dart in pattern.darts:
        tip = pattern.surface.points[dart.tip]
        yield Line("mark", tip + circle, is_closed=True)
        yield from (Line("mark", tip + arm) for arm in (across, across[:, ::-1]))
