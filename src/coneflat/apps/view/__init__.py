"""Figures of meshes and flattenings; needs matplotlib (`pip install "coneflat[figures]"`)."""

from __future__ import annotations

from .figures.compose import FIGURE_FORMATS, check_figure_target, new_figure, save_figure
from .figures.kinds import KINDS, Look, demo_figure, make_figure
from .figures.model import draw_checker, draw_cone_curve, draw_cones, draw_curvature, draw_quality
from .figures.projection import MeshPicture, render_mesh
from .figures.uv_layout import draw_layout
from .quantity import ColorScale, Quantity

__all__ = [
    "FIGURE_FORMATS",
    "KINDS",
    "ColorScale",
    "Look",
    "MeshPicture",
    "Quantity",
    "check_figure_target",
    "demo_figure",
    "draw_checker",
    "draw_cone_curve",
    "draw_cones",
    "draw_curvature",
    "draw_layout",
    "draw_quality",
    "make_figure",
    "new_figure",
    "render_mesh",
    "save_figure",
]
