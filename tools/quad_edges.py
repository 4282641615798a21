"""Figures of quad meshes: edges and irregular vertices."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from coneflat.apps.view import DOT_REACH, Eye, mark_scale, show_mesh
from coneflat.base import DOTS_PER_INCH

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from coneflat import QuadMesh
    from coneflat.base import FloatArray

#: Colours of vertices with less and with more than four quads; distinguishable in colour blindness and in grey.
FEWER_COLOR, MORE_COLOR = "#0072b2", "#e69f00"


def draw_quads(
    quads: QuadMesh,
    axes: Axes,
    *,
    eye: Eye = "front-right",
    up: str = "y",
    irregular: bool = True,
    colors: FloatArray | None = None,
    dpi: float = DOTS_PER_INCH,
) -> None:
    """Draw a quad mesh with its edges and dots at irregular vertices: blue for valence below four, orange above.

    Args:
        quads: the mesh.
        axes: matplotlib axes to draw in; their lines and ticks are turned off.
        irregular: draw the dots.
        colors: (p, 3) RGB of each quad, 0 to 1; None for one light grey.
        eye, up, dpi: as in `draw_checker`.

    Raises:
        OptionError: an option is invalid.
    """
    from matplotlib.collections import LineCollection

    plain = np.broadcast_to(np.array([0.94, 0.94, 0.95]), (len(quads.quads), 3))
    of_triangle = (plain if colors is None else colors).repeat(2, axis=0)
    picture = show_mesh(axes, quads.vertices, quads.triangles, eye, up, dpi, colors=of_triangle)
    camera = picture.camera
    ends = quads.vertices[quads.edges]
    pieces, visible = picture.split_segments(ends[:, 0], ends[:, 1])
    length = float(np.median(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1))) * camera.scale * 72.0 / dpi
    lines = LineCollection(list(pieces[visible]), colors="#30343b", linewidths=min(0.45, 0.07 * length))
    lines.set(zorder=4, gid="edges", capstyle="round")
    axes.add_collection(lines)
    if not irregular:
        return
    places = quads.vertices[quads.irregular]
    seen = picture.visible_points(places, DOT_REACH * max(camera.width, camera.height))
    points, valences = camera.project(places)[:, :2], quads.valences[quads.irregular]
    for name, color, chosen in (
        ("fewer", FEWER_COLOR, seen & (valences < 4)),
        ("more", MORE_COLOR, seen & (valences > 4)),
    ):
        axes.scatter(
            points[chosen, 0],
            points[chosen, 1],
            s=42.0 * mark_scale(axes),
            c=color,
            edgecolors="black",
            linewidths=0.6 * np.sqrt(mark_scale(axes)),
            zorder=6,
            clip_on=False,
            gid=name,
        )
