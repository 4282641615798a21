"""Small PNG files: a palette instead of full colours."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"
MOST = 250_000  # bytes of an image in the documentation


def save_figure_small(figure: Any, name: str) -> None:
    """Write a figure to the documentation's images."""
    stream = BytesIO()
    figure.savefig(stream, format="png", dpi=figure.dpi)
    with Image.open(stream) as picture:
        save_small(picture, name)


def save_small(picture: Image.Image, name: str, *, dither: bool = True) -> None:
    """Write a picture to the documentation's images: in 256 colours, or fewer where it would be large.

    dither: for shaded models; flat grounds stay flat without.
    """
    path = IMAGES / f"{name}.png"
    for colors in (255, 128, 64, 32):
        _with_palette(picture.convert("RGB"), colors, dither).save(path, optimize=True)
        if path.stat().st_size <= MOST:
            break
    print(f"{path.name}: {picture.width} x {picture.height}, {path.stat().st_size / 1000:.0f} KB", flush=True)


def _with_palette(full: Image.Image, colors: int, dither: bool) -> Image.Image:
    palette = full.quantize(colors, Image.Quantize.MAXCOVERAGE)
    few = full.quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG if dither else Image.Dither.NONE)
    chosen = palette.getpalette() or []
    numbers = np.asarray(few).copy()
    numbers[(np.asarray(full) == 255).all(axis=2)] = colors  # paper stays white
    few = Image.fromarray(numbers)
    few.putpalette([*chosen[: 3 * colors], 255, 255, 255])
    return few
