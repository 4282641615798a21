"""Scales of the colour maps: from which value to which, in what steps."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .._arrays import FloatArray
from .content import Content
from .quantity import qc_top

FACTORS = (1.1, 1.25, 1.5, 2.0, 3.0, 4.0, 5.0, 10.0, 20.0, 50.0, 100.0, 1000.0)
"""Where a scale of factors may end."""

WITHIN = 98.0
"""Percent of the area scales that lie within the ends of their scale."""

DECADES = 4
"""Of the curvatures that have colours of their own, to either side of zero."""

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class Scale:
    """A colour map's scale.

    Attributes:
        title: what is shown, with its unit.
        kind: how values lie on it: "linear", "log", or "signed log", which is logarithmic to both sides of a middle
            where less than `low` is zero.
        low, high: its ends; of a signed log, the smallest and the largest amount.
        table: "sequential" or "diverging".
        ticks: (place from 0 to 1, label).
    """

    title: str
    kind: str
    low: float
    high: float
    table: str
    ticks: tuple[tuple[float, str], ...]

    def place(self, values: FloatArray) -> FloatArray:
        """Return where values lie, 0 to 1; NaN for NaN."""
        if self.kind == "signed log":
            amount = np.maximum(np.abs(values), self.low)
            place = 0.5 + np.sign(values) * 0.5 * np.log(amount / self.low) / np.log(self.high / self.low)
        elif self.kind == "log":
            place = np.log(np.maximum(values, 1e-300) / self.low) / np.log(self.high / self.low)
        else:
            place = (values - self.low) / (self.high - self.low)
        return np.clip(place, 0.0, 1.0)


def scales_of(content: Content) -> dict[str, Scale]:
    """Return the scale of each colour map of a page."""
    curvature = _curvature_scale(np.abs(content.curvature))
    return {
        "qc": _qc_scale(content.qc),
        "area": _area_scale(content.area_scale),
        "curvature": curvature,
        "flat": replace(curvature, title="Curvature left in the layout, in π"),
    }


def _qc_scale(qc: FloatArray) -> Scale:
    top = qc_top(qc, np.ones(len(qc)))
    places = np.linspace(0, 1, 6)
    ticks = tuple((place, f"{1 + place * (top - 1):.2f}") for place in places.tolist())
    return Scale("QC distortion", "linear", 1.0, top, "sequential", ticks)


def _area_scale(factor: FloatArray) -> Scale:
    known = np.abs(np.log(factor[np.isfinite(factor) & (factor > 0)]))
    spread = float(np.exp(np.percentile(known, WITHIN))) if len(known) else 1.0
    end = next((each for each in FACTORS if each >= spread), FACTORS[-1])
    middle = float(np.sqrt(end))
    labels = (f"×{1 / end:.2g}", f"×{1 / middle:.2g}", "×1", f"×{middle:.3g}", f"×{end:.3g}")
    ticks = tuple((place, label) for place, label in zip((0.0, 0.25, 0.5, 0.75, 1.0), labels, strict=True))
    return Scale("Scale against its mean", "log", 1 / end, end, "diverging", ticks)


def _curvature_scale(amounts: FloatArray) -> Scale:
    known = amounts[np.isfinite(amounts) & (amounts > 0)]
    largest = float(np.percentile(known, 99.9)) if len(known) else 1.0
    top = int(np.clip(np.ceil(np.log10(largest)), -12, 1))
    powers = [f"10{str(power).translate(_SUPERSCRIPTS)}" if power else "1" for power in (top, top - 2)]
    labels = (f"−{powers[0]}", f"−{powers[1]}", "0", powers[1], powers[0])
    ticks = tuple((place, label) for place, label in zip((0.0, 0.25, 0.5, 0.75, 1.0), labels, strict=True))
    low, high = 10.0 ** (top - DECADES), 10.0**top
    return Scale("Curvature on the model, in π", "signed log", low, high, "diverging", ticks)
