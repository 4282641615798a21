"""The page's colour tables and scales, for people with any colour vision.

The page does without matplotlib, which is an extra, and without the vivid ends of its tables, which light and shade
would spoil. Equal steps in value are about equal steps of CIE L*a*b* here; lightness runs one way (sequential), or the
same way from the middle to both ends (diverging), so that the tables hold without hue.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base import FloatArray
from .quantity import ColorScale, Quantity

#: From light to dark, and from blue over near white to red: hexadecimal colours at equal steps.
SEQUENTIAL = (
    "f6eec8 dee6b5 c5dea3 add595 95ca97 7cbf9a 5fb49c 48a89d 3f9a9c "
    "348d9b 26809b 1b7398 2b6491 345689 394882 3a3974 34285a 2c1841"
)
DIVERGING = (
    "124987 255f99 3476ab 538dbc 72a4cb 90bcda b2cde1 d2dfe8 f1f1ef "
    "f3ddce f2c8ac efb48b e89c6e db7f54 ce613b aa492d 873220"
)


def color_table(colors: str) -> NDArray[np.uint8]:
    """Return (256, 3) colours between some that are given."""
    known = np.array([list(bytes.fromhex(color)) for color in colors.split()])
    place = np.linspace(0, len(known) - 1, 256)
    table = np.stack([np.interp(place, np.arange(len(known)), column) for column in known.T], axis=1)
    return np.round(table).astype(np.uint8)


TITLES = {
    "qc": "QC distortion",
    "area": "Scale, against its mean",
    "curvature": "Curvature of the model, in π",
    "flat": "Curvature of the flat metric, in π",
}

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def page_scales(
    qc: Quantity, stretch: Quantity, curvature: FloatArray, own: Quantity | None = None
) -> dict[str, ColorScale]:
    """Return the scale of each colour map of a page; both curvatures have that of the model.

    Args:
        qc, stretch: distortion.
        curvature: on the model, in units of pi.
        own: of the user.
    """
    before = _curvature_scale(curvature)
    more = {} if own is None else {"own": replace(own.scale, colors=_table(own.scale))}
    return {
        **more,
        "qc": replace(qc.scale, colors="sequential"),
        "area": replace(stretch.scale, colors="diverging"),
        "curvature": before,
        "flat": before,
    }


def _table(scale: ColorScale) -> str:
    """Return which of a page's tables stands for a colour map of matplotlib."""
    return "diverging" if scale.low < 0 < scale.high else "sequential"


def as_plain(title: str, scale: ColorScale) -> dict[str, Any]:
    """Return what the page's scripts know of a scale: its ticks are places from 0 to 1."""
    places = scale.position(np.array([value for value, _ in scale.ticks])).tolist()
    ticks = [(place, label) for place, (_, label) in zip(places, scale.ticks, strict=True)]
    return {
        "title": title,
        "kind": scale.kind,
        "low": scale.low,
        "high": scale.high,
        "table": scale.colors,
        "ticks": ticks,
    }


def _curvature_scale(curvature: FloatArray) -> ColorScale:
    """Return a scale of four decades to either side of zero; almost all curvatures lie within its ends."""
    amounts = np.abs(curvature[np.isfinite(curvature) & (curvature != 0)])
    largest = float(np.percentile(amounts, 99.9)) if len(amounts) else 1.0
    top = int(np.clip(np.ceil(np.log10(largest)), -12, 1))
    powers = (top, top - 2)
    ticks = [(10.0**power, f"10{str(power).translate(_SUPERSCRIPTS)}" if power else "1") for power in powers]
    both = [*((-value, f"−{label}") for value, label in ticks), (0.0, "0"), *reversed(ticks)]
    return ColorScale(10.0 ** (top - 4), 10.0**top, "diverging", "signed log", tuple(both))
