"""How the layers of a drawing look."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

#: Height of capitals of Helvetica relative to the size of the font.
CAPITALS = 0.718


@dataclass(frozen=True)
class Pen:
    """The look of a layer.

    Attributes:
        colour: as in SVG, #rrggbb.
        width: of lines, mm.
        index: the colour's number in DXF (AutoCAD Color Index).
    """

    colour: str
    width: float
    index: int

    @property
    def rgb(self) -> tuple[float, float, float]:
        """Red, green and blue from 0 to 1."""
        red, green, blue = (int(self.colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
        return red, green, blue


#: By layer. The colours of DXF are those that most machines take for cutting (red), folding (blue) and marking (green).
PENS: Mapping[str, Pen] = {
    "cut": Pen("#000000", 0.35, 1),
    "fold": Pen("#1f4fd8", 0.25, 5),
    "mark": Pen("#6b6b6b", 0.2, 3),
    "text": Pen("#202020", 0.2, 7),
}
