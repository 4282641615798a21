"""The page's colour maps: those of the figures in colour tables of the page's own, and curvature with its sign."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from .._arrays import FloatArray
from .quantity import ColorScale, Quantity

TITLES = {
    "qc": "QC distortion",
    "area": "Scale, against its mean",
    "curvature": "Curvature of the model, in π",
    "flat": "Curvature of the flat metric, in π",
}

DECADES = 4
"""Of the curvatures that have colours of their own, to either side of zero."""

EXTREME = 99.9
"""Percent of the curvatures that lie within the ends of their scale."""

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def page_scales(qc: Quantity, stretch: Quantity, curvature: FloatArray) -> dict[str, ColorScale]:
    """Return the scale of each colour map of a page; both curvatures have that of the model.

    curvature: on the model, in units of pi.
    """
    before = _curvature_scale(curvature)
    return {
        "qc": replace(qc.scale, colors="sequential"),
        "area": replace(stretch.scale, colors="diverging"),
        "curvature": before,
        "flat": before,
    }


def as_plain(name: str, scale: ColorScale) -> dict[str, Any]:
    """Return what the page's scripts know of a scale: its ticks are places from 0 to 1."""
    places = scale.position(np.array([value for value, _ in scale.ticks])).tolist()
    ticks = [(place, label) for place, (_, label) in zip(places, scale.ticks, strict=True)]
    return {
        "title": TITLES[name],
        "kind": scale.kind,
        "low": scale.low,
        "high": scale.high,
        "table": scale.colors,
        "ticks": ticks,
    }


def _curvature_scale(curvature: FloatArray) -> ColorScale:
    amounts = np.abs(curvature[np.isfinite(curvature) & (curvature != 0)])
    largest = float(np.percentile(amounts, EXTREME)) if len(amounts) else 1.0
    top = int(np.clip(np.ceil(np.log10(largest)), -12, 1))
    powers = (top, top - DECADES // 2)
    ticks = [(10.0**power, f"10{str(power).translate(_SUPERSCRIPTS)}" if power else "1") for power in powers]
    both = [*((-value, f"−{label}") for value, label in ticks), (0.0, "0"), *reversed(ticks)]
    return ColorScale(10.0 ** (top - DECADES), 10.0**top, "diverging", "signed log", tuple(both))
