"""Drawings in millimetres: lines and texts on layers, which every file format writes alike."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ....base import FloatArray

#: Layers by name: outlines to cut, lines to fold, marks such as seam lines, notches and grain, and texts.
LAYERS = ("cut", "fold", "mark", "text")


@dataclass(frozen=True, eq=False)
class Line:
    """A polyline.

    Attributes:
        layer: one of `LAYERS`.
        points: (k, 2) mm, y upward.
        is_closed: whether the last point is connected to the first.
        dashes: lengths of dashes and gaps in turn, mm; empty for a solid line.
    """

    layer: str
    points: FloatArray
    is_closed: bool = False
    dashes: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class Text:
    """A text.

    Attributes:
        text: one line.
        place: (2,) its centre, or the middle of its left end, mm, y upward.
        size: height of capitals, mm.
        angle: radians, counterclockwise.
        layer: one of `LAYERS`.
        is_left: whether the text begins at its place.
    """

    text: str
    place: FloatArray
    size: float
    angle: float = 0.0
    layer: str = "text"
    is_left: bool = False


@dataclass(frozen=True, eq=False)
class Drawing:
    """Lines and texts on a sheet from (0, 0) to (width, height), mm, y upward.

    Attributes:
        notes: what had no room, one sentence each.
    """

    width: float
    height: float
    lines: tuple[Line, ...]
    texts: tuple[Text, ...] = ()
    notes: tuple[str, ...] = ()

    def moved(self, shift: FloatArray) -> Drawing:
        """Return the drawing with everything on it moved by (2,) mm on the same sheet."""
        lines = tuple(replace(line, points=line.points + shift) for line in self.lines)
        return replace(
            self,
            lines=lines,
            texts=tuple(replace(text, place=np.asarray(text.place) + shift) for text in self.texts),
        )
