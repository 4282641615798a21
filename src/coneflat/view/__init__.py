"""Figures of meshes and flattenings; needs matplotlib (`pip install "coneflat[figures]"`)."""

from __future__ import annotations

from .demo import demo_figure
from .figure import new_figure, save_figure
from .projection import MeshPicture, render_mesh

__all__ = ["MeshPicture", "demo_figure", "new_figure", "render_mesh", "save_figure"]
