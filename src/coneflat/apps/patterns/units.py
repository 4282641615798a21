"""Lengths with units, and the scale from a model to millimetres."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ...base import short_repr
from ...errors import OptionError
from ...options import Kind

#: Millimetres per unit.
MILLIMETRES: Mapping[str, float] = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
#: Strain below which a pattern is exact: 1 um of 1 m, far above rounding.
EXACT_STRAIN = 1e-6
_LENGTH = re.compile(r"\s*([0-9.]+(?:[eE][-+]?[0-9]+)?)\s*(mm|cm|m|in|)\s*")
_PERCENT = re.compile(r"\s*([0-9.]+(?:[eE][-+]?[0-9]+)?)\s*%\s*")


@dataclass(frozen=True)
class Length(Kind):
    """A length in millimetres, or a text with a unit such as "7mm", "0.5cm" or "1in".

    Attributes:
        optional: None is allowed, also as the word "none".
        is_positive: the length must be above 0, not only 0 or more.
        maximum: the largest length, mm.
    """

    metavar: ClassVar[str] = "LENGTH"
    optional: bool = False
    is_positive: bool = False
    maximum: float = math.inf

    def parse(self, name: str, value: Any) -> float | None:
        if self.optional and (value is None or (isinstance(value, str) and value == "none")):
            return None
        length = length_of(value)
        if length is None or not 0 <= length <= self.maximum or (self.is_positive and length == 0):
            bound = "above 0" if self.is_positive else "0 or more"
            bound += f" and at most {self.maximum:g} mm" if math.isfinite(self.maximum) else ""
            raise OptionError(
                f"{name} must be a length, {bound}, such as 7mm, 0.7cm or 0.25in, got {short_repr(value)}"
            )
        return length


@dataclass(frozen=True)
class Percentage(Kind):
    """A fraction, or a text such as "3%".

    Attributes:
        minimum, maximum: the smallest and the largest fraction.
        optional: None is allowed, also as the word "none".
    """

    metavar: ClassVar[str] = "PERCENT"
    minimum: float = 1e-4
    maximum: float = 1.0
    optional: bool = False

    def parse(self, name: str, value: Any) -> float | None:
        if self.optional and (value is None or (isinstance(value, str) and value == "none")):
            return None
        fraction = _fraction(value)
        if fraction is None or not self.minimum <= fraction <= self.maximum:
            raise OptionError(
                f"{name} must be from {100 * self.minimum:g} % to {100 * self.maximum:g} %, such as 3% or 0.03, got "
                f"{short_repr(value)}"
            )
        return fraction


def length_of(value: Any) -> float | None:
    """Return a length in millimetres from a number or a text with a unit; None if it is neither."""
    match = _LENGTH.fullmatch(value) if isinstance(value, str) else None
    try:
        number = float(match[1] if match else value) if match or not isinstance(value, str) else math.nan
    except (TypeError, ValueError, OverflowError):
        return None
    length = number * MILLIMETRES[match[2] or "mm"] if match else number
    return length if math.isfinite(length) else None


def _fraction(value: Any) -> float | None:
    """Return a fraction from a number below 1 or a text with a percentage; None if it is neither.

    A number of 1 or more is most probably meant as a percentage.
    """
    match = _PERCENT.fullmatch(value) if isinstance(value, str) else None
    try:
        number = float(match[1]) / 100 if match else float(value)
    except (TypeError, ValueError, OverflowError):
        return None
    return number if match or number < 1 else None


def text_of_size(extents: Any) -> str:
    """Return an extent of three lengths in millimetres as a text, such as "120 x 80 x 60 mm"."""
    unit, factor = ("m", 1000.0) if max(extents) >= 10_000 else ("mm", 1.0)
    lengths = [extent / factor for extent in extents]
    return (
        " x ".join(f"{length:,.0f}" if length >= 100 else f"{length:.3g}" for length in lengths) + f" {unit}"
    )


def text_of_direction(direction: Any) -> str:
    """Return a direction of three numbers as a text that the option axis takes, such as "0,0,1"."""
    return ",".join(f"{round(float(number), 6) + 0.0:.3g}" for number in direction)


def percentage(strain: float) -> str:
    """Return a strain in per cent, with two digits or more; 0 % if no one could measure it."""
    if abs(strain) < EXACT_STRAIN:
        return "0 %"
    return f"{100 * strain:,.0f} %" if abs(strain) >= 0.1 else f"{100 * strain:.2g} %"


def area_text(area: float) -> str:
    """Return an area in mm^2 as a text in square centimetres, with three digits or more."""
    centimetres = area / 100
    return f"{centimetres:.0f} cm\u00b2" if centimetres >= 100 else f"{centimetres:.3g} cm\u00b2"
