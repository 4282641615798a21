"""Colour tables, the same in pages and in figures; those of matplotlib can be chosen for figures."""

from __future__ import annotations

from functools import cache

import numpy as np

from ...base import FloatArray
from ...errors import OptionError

# The tables have no very dark or bright ends, which shading would make unreadable. Equal steps in value are about
# equal steps in CIE L*a*b*. Lightness is monotonic (sequential), or monotonic from the middle to both ends
# (diverging), so the tables can also be read without hue.
#: Hexadecimal colours at equal steps: from light to dark, and from blue over near white to red.
PALETTES = {
    "sequential": (
        "f6eec8 dee6b5 c5dea3 add595 95ca97 7cbf9a 5fb49c 48a89d 3f9a9c "
        "348d9b 26809b 1b7398 2b6491 345689 394882 3a3974 34285a 2c1841"
    ),
    "diverging": (
        "124987 255f99 3476ab 538dbc 72a4cb 90bcda b2cde1 d2dfe8 f1f1ef "
        "f3ddce f2c8ac efb48b e89c6e db7f54 ce613b aa492d 873220"
    ),
}
TABLE_SIZE = 256


@cache
def color_table(name: str) -> FloatArray:
    """Return (256, 3) colours from 0 to 1 of "sequential", "diverging" or a colour map of matplotlib."""
    steps = np.linspace(0.0, 1.0, TABLE_SIZE)
    if name not in PALETTES:
        from matplotlib import colormaps

        return np.asarray(colormaps[name](steps))[:, :3]
    colors = np.array([list(bytes.fromhex(color)) for color in PALETTES[name].split()]) / 255
    places = np.linspace(0.0, 1.0, len(colors))
    return np.stack([np.interp(steps, places, column) for column in colors.T], axis=1)


def check_color_map(name: str) -> None:
    """Raise OptionError if there is no such colour table, here or in matplotlib."""
    if name in PALETTES:
        return
    from matplotlib import colormaps

    if name not in colormaps:
        raise OptionError(f"matplotlib has no colour map {name!r}; try viridis, cividis or magma")
