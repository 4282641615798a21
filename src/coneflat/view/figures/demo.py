"""The figure that shows a flattening at a glance."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ...result.from_uv import is_own
from ...text import plural
from ..quantity import conformal_distortion
from .camera import view_aspect
from .compose import Panel, Row, compose
from .cone_marks import mark_handles
from .model import draw_checker, draw_quality
from .uv_layout import draw_layout, layout_aspect

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ...result.flattening import Flattening

DOTS_PER_INCH = 220.0
FRONT, BACK = "front-right", "back-left"


def demo_figure(result: Flattening, *, up: str = "y") -> Figure:
    """Return a figure of a flattening: the textured model, its layout, its distortion from two sides.

    Args:
        result: the flattening.
        up: the model's upward axis, "x", "y" or "z".

    Raises:
        OptionError: matplotlib is not installed, or `up` names no axis.
    """
    vertices = result.vertices[np.unique(result.faces)]
    checker = partial(draw_checker, result, up=up, cones=True, dpi=DOTS_PER_INCH)
    distortion = partial(draw_quality, result, up=up, dpi=DOTS_PER_INCH)
    panels = [
        Panel(view_aspect(vertices, FRONT, up), checker, "Model, textured by its UVs"),
        Panel(layout_aspect(result, crop=True), partial(draw_layout, result, crop=True), "UV layout"),
        Panel(view_aspect(vertices, FRONT, up), partial(distortion, eye=FRONT), "Distortion, front and back"),
        Panel(view_aspect(vertices, BACK, up), partial(distortion, eye=BACK)),
    ]
    rows = [Row(panels, [conformal_distortion(result)])]
    return compose(rows, title=title(result), marks=mark_handles(result), dpi=DOTS_PER_INCH, width=10.0)


def title(result: Flattening) -> str:
    """Return the line of key numbers."""
    measures = result.distortion
    parts = [
        plural(len(result.faces), "triangle"),
        *([] if is_own(result) else [plural(len(result.cones), "cone")]),
        f"QC mean {measures.qc_mean:.4f}",
        f"{measures.flipped:,} flipped",
        f"seam length {measures.seam_length:.2f} √area",
    ]
    source = getattr(result, "source", None)
    name = [source.path.name] if source is not None else []
    return "  ·  ".join(name + parts)
