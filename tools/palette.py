"""Small PNG files with a palette."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"
MAX_BYTES = 250_000  # Largest size of an image of the documentation in bytes.
COLORS = (128, 192, 255)
#: Of 255: fewer colours are taken if by the root mean square they are off by no more than this beyond the most colours.
UNSEEN = 1.2


def save_figure_small(figure: Any, name: str) -> None:
    """Write a figure to the documentation's images."""
    stream = BytesIO()
    figure.savefig(stream, format="png", dpi=figure.dpi)
    with Image.open(stream) as picture:
        save_small(picture, name)


def save_small(picture: Image.Image, name: str, *, dither: bool = True) -> None:
    """Write a picture to the documentation's images: in as few colours as look the same, or fewer if it is large.

    dither: for shaded models; flat grounds stay flat without.
    """
    path, full = IMAGES / f"{name}.png", picture.convert("RGB")
    smallest = error_of(_with_palette(full, COLORS[-1], dither), full)
    for colors in COLORS:
        few = _with_palette(full, colors, dither)
        if error_of(few, full) <= smallest + UNSEEN:
            break
    few.save(path, optimize=True)
    for colors in (128, 64, 32):
        if path.stat().st_size > MAX_BYTES:
            _with_palette(full, colors, dither).save(path, optimize=True)
    print(f"{path.name}: {picture.width} x {picture.height}, {path.stat().st_size / 1000:.0f} KB", flush=True)


def error_of(few: Image.Image, full: Image.Image) -> float:
    """Return the root mean square of the differences between two pictures, of 255, of all channels together."""
    off = np.asarray(few.convert("RGB"), dtype=np.float64) - np.asarray(full)
    return float(np.sqrt((off**2).sum(axis=2).mean()))


def _with_palette(full: Image.Image, colors: int, dither: bool) -> Image.Image:
    palette = full.quantize(colors, Image.Quantize.MAXCOVERAGE, kmeans=3)
    few = full.quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG if dither else Image.Dither.NONE)
    chosen = palette.getpalette() or []
    numbers = np.asarray(few).copy()
    numbers[(np.asarray(full) == 255).all(axis=2)] = colors  # The background remains white.
    few = Image.fromarray(numbers)
    few.putpalette([*chosen[: 3 * colors], 255, 255, 255])
    return few
