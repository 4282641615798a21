"""How the borders of pieces are finished: widths of seam allowances and their corners."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from ...base import list_some, short_repr
from ...errors import OptionError
from ...options import Kind
from .units import length_of

#: Kinds of patterns whose pieces are sewn: they get seam allowances, notches and a grain line.
SEWN = ("cloth", "gores")
#: Width of the seam allowance of sewn patterns, mm, and the name under which hems get another one.
ALLOWANCE, HEM = 7.0, "hem"
#: Largest width of an allowance, mm; a larger one is given in a wrong unit.
MAX_ALLOWANCE = 500.0


@dataclass(frozen=True)
class Finish:
    """Widths of seam allowances.

    Attributes:
        allowance: width of all that have no other, mm.
        by_name: widths of the seams with these names, mm; HEM for the sides that are sewn to nothing.
        is_round: round corners instead of mitred ones.
    """

    allowance: float = 0.0
    by_name: Mapping[str, float] = field(default_factory=dict)
    is_round: bool = False

    @classmethod
    def of(cls, kind: str, settings: Mapping[str, Any]) -> Finish:
        """Return the finish for a kind of patterns and its options.

        Raises:
            OptionError: `seam_allowances` cannot be read.
        """
        allowance = settings.get("allowance")
        if allowance is None:
            allowance = ALLOWANCE if kind in SEWN else 0.0
        by_name = read_allowances(settings.get("seam_allowances", ""))
        return cls(float(allowance), by_name, settings.get("corners", "mitred") == "round")

    def width(self, name: str) -> float:
        """Return the width at a seam, or at hems, mm."""
        return self.by_name.get(name, self.allowance)

    def check_names(self, names: Collection[str]) -> None:
        """Raise OptionError if a seam with a width of its own does not exist; names: those of all seams."""
        for name in self.by_name:
            if name not in names and name != HEM:
                raise OptionError(
                    f"seam_allowances names the seam {name}, which the pattern does not have: its seams are "
                    f"{list_some(names) or 'none'}; {HEM} stands for the other sides"
                )


@dataclass(frozen=True)
class Allowances(Kind):
    """Widths of seam allowances by name, as a text such as "A=10mm,B=0"."""

    metavar: ClassVar[str] = "NAME=LENGTH,..."

    def parse(self, name: str, value: Any) -> str:
        if not isinstance(value, str):
            raise OptionError(f"{name} must be a text such as A=10mm,B=0, got {short_repr(value)}")
        read_allowances(value)
        return value


def read_allowances(text: str) -> dict[str, float]:
    """Return widths in millimetres by name from a text such as "A=10mm,B=0".

    Raises:
        OptionError: the text is different.
    """
    widths: dict[str, float] = {}
    for word in filter(None, (word.strip() for word in text.split(","))):
        name, is_split, value = word.partition("=")
        width = length_of(value) if is_split else None
        if width is None or not 0 <= width <= MAX_ALLOWANCE or not name.strip():
            raise OptionError(
                f"seam_allowances must be names of seams with lengths up to {MAX_ALLOWANCE:g} mm, such as A=10mm,B=0, "
                f"got {short_repr(word)}"
            )
        if widths.setdefault(name.strip(), width) != width:
            raise OptionError(
                f"seam_allowances gives the seam {name.strip()} two widths, {widths[name.strip()]:g} and {width:g} mm: "
                "leave out one of them"
            )
    return widths
