"""Papers: page sizes, rolls, and pages as large as the pattern."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ...base import short_repr
from ...errors import OptionError
from ...options import Kind
from .units import length_of

#: Width and height of pages by name, mm.
PAGE_SIZES: Mapping[str, tuple[float, float]] = {
    "A0": (841.0, 1189.0),
    "A1": (594.0, 841.0),
    "A2": (420.0, 594.0),
    "A3": (297.0, 420.0),
    "A4": (210.0, 297.0),
    "A5": (148.0, 210.0),
    "letter": (215.9, 279.4),
    "legal": (215.9, 355.6),
    "tabloid": (279.4, 431.8),
}
#: Page sizes in inches, whose ruler is also in inches.
IN_INCHES = ("letter", "legal", "tabloid")
#: The border of a page that is not printed on, and how far neighbouring pages overlap, mm.
MARGIN, OVERLAP = 10.0, 10.0
#: Distance of pieces from the border of a sheet or of the printed part of a page, so that no line is on it, mm.
EDGE = 1.0
#: The longest side of a page of a PDF, mm: 14,400 points.
LONGEST = 5080.0
#: Length of the ruler, mm, and height of the strip for it below what is on a roll or on a page as large as the pattern.
RULER, RULER_STRIP = 100, 20.0
#: The narrowest page: the ruler and the margins, mm.
NARROWEST = RULER + 2 * MARGIN
#: The paper by default.
DEFAULT_PAPER = "A4"
_ROLL = "roll:"


@dataclass(frozen=True)
class Paper:
    """A paper.

    Attributes:
        name: as in PAGE_SIZES, roll:WIDTH, or none.
        width: mm; None for pages as large as the pattern.
        height: mm; None for rolls and pages as large as the pattern.
    """

    name: str
    width: float | None = None
    height: float | None = None

    @classmethod
    def of(cls, name: str) -> Paper:
        """Return the paper of a name.

        Raises:
            OptionError: there is none of this name, or a roll is narrower than the ruler or wider than a PDF allows.
        """
        by_name = {size.lower(): size for size in PAGE_SIZES}
        if name.lower() in by_name:
            size = by_name[name.lower()]
            return cls(size, *PAGE_SIZES[size])
        if name == "none":
            return cls(name)
        width = length_of(name.removeprefix(_ROLL)) if name.startswith(_ROLL) else None
        if width is None or not NARROWEST <= width <= LONGEST:
            raise OptionError(
                f"page must be {', '.join(PAGE_SIZES)}, none, or a roll of {NARROWEST:g} to {LONGEST:g} mm such as "
                f"roll:900mm, got {short_repr(name)}"
            )
        return cls(name, width)

    @property
    def inner_width(self) -> float:
        """The width without margins, mm; infinite for pages as large as the pattern."""
        return float("inf") if self.width is None else self.width - 2 * MARGIN

    @property
    def inner_height(self) -> float:
        """The height without margins and the ruler, mm; that of the longest page if it may vary."""
        return (LONGEST if self.height is None else self.height) - self.below - MARGIN

    @property
    def below(self) -> float:
        """The height of what is below the printed part of a page, mm: the margin, and the ruler where there is one."""
        return MARGIN + (RULER_STRIP if self.height is None else 0.0)


@dataclass(frozen=True)
class PaperName(Kind):
    """The name of a paper."""

    metavar: ClassVar[str] = "PAGE"

    def parse(self, name: str, value: Any) -> str:
        if not isinstance(value, str):
            raise OptionError(f"{name} must be the name of a paper such as A4, got {short_repr(value)}")
        return Paper.of(value).name
