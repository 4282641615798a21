"""Places for texts: inside a shape, without covering one another."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ...base import FloatArray
from .allowances import shapely
from .drawing import Text

if TYPE_CHECKING:
    from shapely import LineString, Polygon

# Mean width of a character of Helvetica, and height of a line of text with what is below its base line, both relative
# to the height of capitals; rather too large than too small.
CHARACTER_WIDTH, LINE_HEIGHT = 0.84, 1.5


@dataclass
class Labels:
    """Texts and marks in a shape, such as a piece.

    Attributes:
        shape: the shape inside which they must be.
        boxes: what is already covered.
        lines: lines that texts cross only where there is no other place.
        texts: the texts that have been placed.
    """

    shape: Polygon
    boxes: list[Polygon] = field(default_factory=list)
    lines: list[LineString] = field(default_factory=list)
    texts: list[Text] = field(default_factory=list)

    def __post_init__(self) -> None:
        shapely().prepare(self.shape)

    def is_free(self, box: Polygon, crosses_lines: bool = False) -> bool:
        """Return whether a shape is inside and covers nothing.

        Args:
            box: the shape.
            crosses_lines: whether it may cross lines.
        """
        obstacles = self.boxes if crosses_lines else [*self.boxes, *self.lines]
        return self.shape.contains(box) and not any(map(box.intersects, obstacles))

    def cover(self, shape: Polygon) -> None:
        """Let no text be placed on a shape."""
        self.boxes.append(shape)

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


def box_of(text: Text) -> Polygon:
    """Return the rectangle that a text covers."""
    half = np.array([text_width(text.text, text.size), LINE_HEIGHT * text.size]) / 2
    corners = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
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
