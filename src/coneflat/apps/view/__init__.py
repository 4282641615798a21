"""Figures and interactive pages of meshes and flattenings; figures need matplotlib (`coneflat[figures]`)."""

from __future__ import annotations

from .comparison import common_ranges, comparison_html
from .faults import UVFaults, uv_faults
from .figures.camera import Eye, eye_direction, view_aspect
from .figures.compose import Panel, Row, check_figure, compose, new_figure, save_figure, write_figure
from .figures.cone_marks import DOT_REACH, mark_handles, mark_scale
from .figures.kinds import Look, demo_figure, make_figure
from .figures.model import draw_checker, draw_cones, draw_quantity, show_mesh
from .figures.render import Barycentrics
from .figures.uv_layout import draw_layout, fill_layout, layout_aspect
from .from_uv import own_flattening, shown_rows, uv_flattening
from .page.content import Model, content_of, outline_halfedges
from .page.parts import FoldLines, PageParts
from .page.payload import PageText, head_and_block, pack, text_of
from .page.webpage import (
    check_page,
    notebook_html,
    open_address,
    open_page,
    page_around,
    page_html,
    write_page,
)
from .quad_page import page_of_quads
from .quantity import Quantity, Ranges, conformal_distortion, own_quantity
from .upward import upward_axis

__all__ = [
    "Barycentrics", "DOT_REACH", "Eye", "FoldLines", "Look", "Model", "PageParts", "PageText", "Panel", "Quantity",
    "Ranges", "Row", "UVFaults", "check_figure", "check_page", "common_ranges", "comparison_html", "compose",
    "conformal_distortion", "content_of", "demo_figure", "draw_checker", "draw_cones", "draw_layout", "draw_quantity",
    "eye_direction", "fill_layout", "head_and_block", "layout_aspect", "make_figure", "mark_handles", "mark_scale",
    "new_figure", "notebook_html", "open_address", "open_page", "outline_halfedges", "own_flattening", "own_quantity",
    "pack", "page_around", "page_html", "page_of_quads", "save_figure", "show_mesh", "shown_rows",
    "text_of", "upward_axis", "uv_faults", "uv_flattening", "view_aspect", "write_figure", "write_page",
]  # fmt: skip
