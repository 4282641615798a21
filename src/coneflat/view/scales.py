"""Scales of the page's colour maps: from which value to which, in what steps."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .._arrays import FloatArray
from .quantity import Quantity

DECADES = 4
"""Of the curvatures that have colours of their own, to either side of zero."""

EXTREME = 99.9
"""Percent of the curvatures that lie within the ends of their scale."""

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
            place = np.log(np.maximum(values, self.low) / self.low) / np.log(self.high / self.low)
        else:
            place = (values - self.low) / (self.high - self.low)
        return np.clip(place, 0.0, 1.0)


def page_scales(qc: Quantity, stretch: Quantity, curvature: FloatArray) -> dict[str, Scale]:
    """Return the scale of each colour map of a page.

    curvature: on the model, in units of pi.
    """
    before = _curvature_scale(curvature)
    return {
        "qc": _as_in_figures(qc, "QC distortion", "sequential"),
        "area": _as_in_figures(stretch, "Scale, against its mean", "diverging"),
        "curvature": before,
        "flat": replace(before, title="Curvature of the flat metric, in π"),
    }


def _as_in_figures(quantity: Quantity, title: str, table: str) -> Scale:
    scale = quantity.scale
    places = scale.position(np.array([value for value, _ in scale.ticks]))
    ticks = zip(places.tolist(), (label for _, label in scale.ticks), strict=True)
    return Scale(title, "log" if scale.log else "linear", scale.low, scale.high, table, tuple(ticks))


def _curvature_scale(curvature: FloatArray) -> Scale:
    amounts = np.abs(curvature[np.isfinite(curvature) & (curvature != 0)])
    largest = float(np.percentile(amounts, EXTREME)) if len(amounts) else 1.0
    top = int(np.clip(np.ceil(np.log10(largest)), -12, 1))
    powers = [f"10{str(power).translate(_SUPERSCRIPTS)}" if power else "1" for power in (top, top - 2)]
    labels = (f"−{powers[0]}", f"−{powers[1]}", "0", powers[1], powers[0])
    ticks = tuple(zip((0.0, 0.25, 0.5, 0.75, 1.0), labels, strict=True))
    low, high = 10.0 ** (top - DECADES), 10.0**top
    return Scale("Curvature of the model, in π", "signed log", low, high, "diverging", ticks)
