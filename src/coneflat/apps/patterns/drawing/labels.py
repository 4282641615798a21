"""Places for texts: inside a shape, without covering one another."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from ....base import FloatArray
from .allowances import shapely
from .drawing import Text

if TYPE_CHECKING:
    from shapely import Geometry, LineString, Polygon

# Mean width of a character of Helvetica, and height of a line of text with what is below its base line, both relative
# to the height of capitals; rather too large than too small.
CHARACTER_WIDTH, LINE_HEIGHT = 0.84, 1.5
# Side of the cells in which shapes are looked up, mm: about the width of a name; largest number of cells across.
CELL, MAX_CELLS = 8.0, 1000


class Shapes:
    """Shapes by the cells of a grid in which they are, so that those near a place are found quickly."""

    def __init__(self, extent: float) -> None:
        """Make a grid for shapes within an extent, mm."""
        self._cell = max(CELL, extent / MAX_CELLS)
        self._by_cell: dict[tuple[int, int], list[Geometry]] = {}

    def add(self, shape: Geometry) -> None:
        """Add a shape."""
        for cell in self._cells(shape):
            self._by_cell.setdefault(cell, []).append(shape)

    def meet(self, shape: Geometry) -> bool:
        """Return whether one of the shapes intersects another shape."""
        return any(
            shape.intersects(candidate)
            for cell in self._cells(shape)
            for candidate in self._by_cell.get(cell, ())
        )

    def _cells(self, shape: Geometry) -> Iterator[tuple[int, int]]:
        left, low, right, high = (int(bound // self._cell) for bound in shape.bounds)
        return product(range(left, right + 1), range(low, high + 1))


class Labels:
    """Texts and marks in a shape, such as a piece.

    Attributes:
        texts: the texts that have been placed.
    """

    def __init__(self, shape: Polygon) -> None:
        """Take the shape inside which they must be."""
        self.shape = shape
        self.texts: list[Text] = []
        left, low, right, high = shape.bounds
        extent = max(right - left, high - low)
        self._covered, self._lines = Shapes(extent), Shapes(extent)
        shapely().prepare(shape)

    def is_free(self, box: Polygon, crosses_lines: bool = False) -> bool:
        """Return whether a shape is inside and covers nothing.

        Args:
            box: the shape.
            crosses_lines: whether it may cross lines.
        """
        return (
            not self._covered.meet(box)
            and (crosses_lines or not self._lines.meet(box))
            and self.shape.contains(box)
        )

    def cover(self, shape: Geometry) -> None:
        """Let no text be placed on a shape."""
        self._covered.add(shape)

    def avoid(self, line: LineString) -> None:
        """Let texts cross a line only where there is no other place."""
        self._lines.add(line)

    def add(self, candidates: Iterable[Text], crosses_lines: bool = False) -> Text | None:
        """Place the first of some texts that has room, and return it; None if none has.

        Args:
            candidates: the texts.
            crosses_lines: whether texts may cross lines.
        """
        for text in candidates:
            box = box_of(text)
            if self.is_free(box, crosses_lines):
                self.cover(box)
                self.texts.append(text)
                return text
        return None


def text_width(text: str, size: float) -> float:
    """Return about how wide a text is, mm; size: height of its capitals, mm."""
    return CHARACTER_WIDTH * size * len(text)


def fitted_size(text: str, size: float, width: float) -> float:
    """Return the height of capitals of a text, mm, smaller than `size` if the text would be wider than `width`."""
    return min(size, size * width / max(text_width(text, size), np.finfo(float).tiny))


def box_of(text: Text) -> Polygon:
    """Return the rectangle that a text covers."""
    half = np.array([text_width(text.text, text.size), LINE_HEIGHT * text.size]) / 2
    corners = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    if text.is_left:
        corners[:, 0] += half[0]
    return shapely().Polygon(np.asarray(text.place) + rotated(corners, text.angle))


def rotated(points: FloatArray, angle: float) -> FloatArray:
    """Return points (k, 2) rotated about the origin; angle in radians."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return points @ np.array([[cosine, sine], [-sine, cosine]])


def readable_angle(direction: FloatArray) -> float:
    """Return the angle of a text along a direction (2,), radians, such that it is read from below or from the right."""
    angle = float(np.arctan2(direction[1], direction[0]))
    if angle > np.pi / 2 + 1e-6:
        return angle - np.pi
    return angle + np.pi if angle <= -np.pi / 2 - 1e-6 else angle
