"""Draw the pictures of the documentation: `python tools/make_images.py FOLDER`.

The folder holds the models fandisk.obj, bunny.obj and horse.ply; the sample comes with the package. Pictures are kept
small: 256 colours each.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

import coneflat
from coneflat.view import demo_figure
from coneflat.view.camera import view_aspect
from coneflat.view.compose import Panel, Row, compose
from coneflat.view.marks import mark_handles
from coneflat.view.quantity import curvature

IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"
DPI = 170.0

#: How to look at the models of the gallery.
LOOKS: dict[str, dict[str, Any]] = {
    "fandisk.obj": {"up": "x", "eyes": ["right-front", "left-back"]},
    "bunny.obj": {"eyes": ["front-right", "back-left"]},
    "horse.ply": {"up": "z", "eyes": ["right-back", "left-front"]},
}
#: The kinds that show one view, for two would be small.
SINGLE = ("quality", "curvature")


def save(figure: Any, name: str) -> None:
    """Write a figure with a palette instead of full colours."""
    stream = BytesIO()
    figure.savefig(stream, format="png", dpi=figure.dpi)
    with Image.open(stream) as picture:
        full = picture.convert("RGB")
        palette = full.quantize(255, Image.Quantize.MAXCOVERAGE)
        few = full.quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG)
        colors = palette.getpalette() or []
        numbers = np.asarray(few).copy()
        numbers[(np.asarray(full) == 255).all(axis=2)] = 255  # paper stays white
        few = Image.fromarray(numbers)
        few.putpalette([*colors[: 3 * 255], 255, 255, 255])
    path = IMAGES / f"{name}.png"
    few.save(path, optimize=True)
    print(f"{path.name}: {few.width} x {few.height}, {path.stat().st_size / 1000:.0f} KB", flush=True)


def curvature_figure(path: Path) -> Any:
    """Return a figure of what curvature a model has, and what the linear and the exact metric leave of it."""
    linear = coneflat.flatten(path, **coneflat.PAPER)
    exact = coneflat.flatten(path)
    labels = ("On the model", "After the linear metric", "After the exact metric")
    panels = [
        Panel(
            view_aspect(result.vertices), partial(coneflat.draw_curvature, result, flat=flat, dpi=DPI), label
        )
        for result, flat, label in zip((exact, linear, exact), (False, True, True), labels, strict=True)
    ]
    left = [
        replace(curvature(result, True), label=f"|K| left, {name} metric")
        for result, name in ((linear, "linear"), (exact, "exact"))
    ]
    return compose([Row(panels, left)], dpi=DPI, width=9.0)


def quarters_figure(path: Path) -> Any:
    """Return a figure of a model with a checkerboard: with any cones, and with cones of whole quarter turns."""
    free = coneflat.flatten(path)
    quarters = coneflat.flatten(path, quantum=np.pi / 2, correct_handles=True)
    assert quarters.rotations is not None
    off = f"{quarters.rotations.worst:.0e}"
    labels = (
        f"Any curvatures: {len(free.cones)} cones",
        f"Multiples of a quarter turn, to {off} rad: {len(quarters.cones)} cones",
    )
    panels = [
        Panel(
            view_aspect(result.vertices), partial(coneflat.draw_checker, result, cones=True, dpi=DPI), label
        )
        for result, label in zip((free, quarters), labels, strict=True)
    ]
    return compose([Row(panels)], marks=mark_handles(free), dpi=DPI)


def gallery(path: Path, **look: Any) -> None:
    """Draw a figure of every kind."""
    result = coneflat.flatten(path, charts="atlas")
    for kind in ("layout", "checker", "quality", "cones", "curvature"):
        eyes = look["eyes"][:1] if kind in SINGLE else look["eyes"]
        save(coneflat.make_figure(result, kind, dpi=DPI, **{**look, "eyes": eyes}), f"{path.stem}-{kind}")
    curve = coneflat.cone_curve(path)
    save(coneflat.make_figure(curve, "curve", dpi=DPI), f"{path.stem}-curve")


def main(folder: Path) -> None:
    """Draw everything."""
    save(demo_figure(coneflat.flatten(coneflat.sample_path(), charts="atlas")), "sample")
    save(curvature_figure(folder / "bunny.obj"), "curvature")
    save(quarters_figure(folder / "bunny.obj"), "quarters")
    for name, look in LOOKS.items():
        gallery(folder / name, **look)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
