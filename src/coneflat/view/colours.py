"""Colour tables for people with any colour vision: equal steps in value look like equal steps in colour.

Colours are interpolated between a few anchors in CIE L*a*b* (D65), where distances are about those that are seen.
The anchors' lightness runs one way (sequential) or symmetrically (diverging), so that the tables hold without hue.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import FloatArray
from .quantity import ColorScale, Quantity

STEPS = 256

# (L*, chroma, hue in degrees), from low values to high.
SEQUENTIAL_ANCHORS = (
    (94, 20, 100),
    (82, 38, 130),
    (65, 33, 180),
    (46, 30, 245),
    (29, 40, 296),
    (13, 30, 312),
)
LOW_ANCHORS = ((31, 40, 280), (50, 34, 262), (73, 22, 250), (95, 1, 100))
HIGH_ANCHORS = ((95, 1, 100), (74, 40, 60), (54, 58, 46), (33, 46, 40))

_WHITE = np.array([0.95047, 1.0, 1.08883])
_FROM_XYZ = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)


def sequential() -> NDArray[np.uint8]:
    """Return (256, 3) colours from light to dark."""
    return lab_to_srgb(_even_steps(SEQUENTIAL_ANCHORS, STEPS))


def diverging() -> NDArray[np.uint8]:
    """Return (256, 3) colours from blue over near white to red."""
    halves = (_even_steps(anchors, STEPS // 2) for anchors in (LOW_ANCHORS, HIGH_ANCHORS))
    return lab_to_srgb(np.concatenate(list(halves)))


def _even_steps(anchors: ArrayLike, count: int) -> FloatArray:
    """Return (count, 3) colours at equal distances along the line through the anchors."""
    lab = _lab(anchors)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(lab, axis=0), axis=1))])
    place = np.linspace(0.0, along[-1], count)
    return np.stack([np.interp(place, along, lab[:, k]) for k in range(3)], axis=1)


def _lab(anchors: ArrayLike) -> FloatArray:
    """Return (k, 3) L*, a*, b* of (k, 3) lightness, chroma and hue in degrees."""
    light, chroma, hue = np.asarray(anchors, dtype=np.float64).T
    angle = np.radians(hue)
    return np.stack([light, chroma * np.cos(angle), chroma * np.sin(angle)], axis=1)


def lab_to_srgb(lab: FloatArray) -> NDArray[np.uint8]:
    """Return (k, 3) sRGB colours, 0 to 255, of (k, 3) L*, a*, b*; what no screen shows is clipped."""
    y = (lab[:, 0] + 16) / 116
    f = np.stack([y + lab[:, 1] / 500, y, y - lab[:, 2] / 200], axis=1)
    xyz = np.where(f > 6 / 29, f**3, 3 * (6 / 29) ** 2 * (f - 4 / 29)) * _WHITE
    linear = np.clip(xyz @ _FROM_XYZ.T, 0, 1)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.round(255 * encoded).astype(np.uint8)


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
