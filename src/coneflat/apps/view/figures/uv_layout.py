"""Drawing of the UV layout."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .... import TriangleMesh
from ....base import FloatArray, IntArray
from ....mesh import end_corners, label_faces, open_along
from ...uv_measures import chart_tiles
from ..quantity import Quantity
from .cone_marks import BOUNDARY_COLOR, SEAM_COLOR, draw_dots, mark_scale, pixels_of
from .render import render_mesh

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.path import Path

    from .... import Flattening

MAX_DRAWN_TRIANGLES = 40_000
"""Number of triangles above which inner edges are not drawn, because they would fill the charts with grey."""

CHART_COLOR = "#e3e9f1"
CHART_COLORS = ("#cfe3f3", "#fbe3c4", "#cdeade", "#f6dbe9", "#fbf6c4", "#d8d4ea", "#f7d3c4", "#dddddd")
"""Tints of the colours of Okabe and Ito, which colour-blind people can distinguish."""
EDGE_COLOR = "#9fadc0"
FRAME_COLOR = "#b8bcc2"


def draw_layout(
    result: Flattening,
    axes: Axes,
    *,
    color_charts: bool = False,
    edges: bool = True,
    crop: bool = False,
) -> None:
    """Draw the charts in the unit square: filled polygons, the edges of their triangles, and the cones.

    Outlines and edges are vector graphics in formats that support them. Seams are black, the boundary of the model is
    grey. Above 40,000 triangles inner edges are left out. Cones of positive curvature are red, those of negative
    curvature black, with a dot at each of their points. The area of a dot grows with the curvature.

    Args:
        result: the flattening.
        axes: matplotlib axes to draw in; their own lines and ticks are hidden.
        color_charts: give the charts different colours.
        edges: draw the edges of triangles.
        crop: show only the charts, not the unit square or the tiles of several textures.
    """
    from matplotlib.patches import PathPatch

    scale = np.sqrt(mark_scale(axes))
    paths = chart_paths(result.uv, result.uv_faces)
    for k, path in enumerate(paths):
        fill = CHART_COLORS[k % len(CHART_COLORS)] if color_charts else CHART_COLOR
        chart = PathPatch(path, facecolor=fill, edgecolor="none", zorder=0)
        chart.set_gid(f"chart-{k + 1}")
        axes.add_patch(chart)
    if edges and len(result.faces) <= MAX_DRAWN_TRIANGLES:
        mesh = TriangleMesh(result.uv, result.uv_faces)
        inner = result.uv[mesh.edges[~mesh.is_boundary_edge]]
        _draw_segments(axes, inner, "edges", color=EDGE_COLOR, width=0.2 * scale, zorder=1)
    draw_outlines(axes, result, paths, 0.8 * scale)
    if not crop:
        _draw_tiles(axes, chart_tiles(result.uv, result.uv_faces))
    vertex, point = layout_cones(result)
    curvature = dict(zip(result.cones.tolist(), result.curvatures.tolist(), strict=True))
    values = np.array([curvature[v] for v in vertex.tolist()])
    draw_dots(axes, result.uv[point], values, share=0.6)
    frame_layout(axes, result, crop)


def fill_layout(axes: Axes, result: Flattening, quantity: Quantity, dpi: float) -> None:
    """Draw the layout coloured by a quantity: a pixel image with vector outlines."""
    flat = np.column_stack([result.uv, np.zeros(len(result.uv))])
    size, colors = pixels_of(axes, dpi), quantity.colors()
    picture = render_mesh(flat, result.uv_faces, size=size, eye=(0.0, 0.0, 1.0), colors=colors, contrast=0.0)
    camera = picture.camera
    width, height = camera.width / camera.scale / 2, camera.height / camera.scale / 2
    x, y = camera.centre[:2]
    axes.imshow(
        picture.image, extent=(x - width, x + width, y - height, y + height), interpolation="antialiased"
    )
    paths = chart_paths(result.uv, result.uv_faces)
    draw_outlines(axes, result, paths, 0.5 * np.sqrt(mark_scale(axes)))
    frame_layout(axes, result, crop=True)


def draw_outlines(axes: Axes, result: Flattening, paths: list[Path], width: float) -> None:
    """Draw the outlines of the charts, with lines of `width` points; the boundary of the model is lighter."""
    from matplotlib.patches import PathPatch

    for path in paths:
        line = PathPatch(path, fill=False, edgecolor=SEAM_COLOR, linewidth=width, joinstyle="round", zorder=2)
        axes.add_patch(line)
    model = TriangleMesh(result.vertices, result.faces)
    sides, corners = model.edge_halfedges[model.is_boundary_edge, 0], result.uv_faces.ravel()
    ends = result.uv[np.stack([corners[end] for end in end_corners(sides)], axis=1)]
    _draw_segments(axes, ends, "boundary", color=BOUNDARY_COLOR, width=1.2 * width, zorder=2.5)


def frame_layout(axes: Axes, result: Flattening, crop: bool) -> None:
    """Set the limits of the axes: around the charts if `crop`, else around the tiles of all textures."""
    low, high = layout_box(result, crop)
    margin = 0.02 * max(high - low)
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)
    axes.set_aspect("equal")
    axes.set_axis_off()


def layout_box(result: Flattening, crop: bool) -> tuple[FloatArray, FloatArray]:
    """Return the (2,) lower left and upper right corners of the box around the charts and, unless `crop`, the tiles."""
    points = result.uv[np.unique(result.uv_faces)]
    if not crop:
        tiles = chart_tiles(result.uv, result.uv_faces)
        points = np.concatenate([tiles, tiles + 1, points])
    return points.min(axis=0), points.max(axis=0)


def layout_aspect(result: Flattening, crop: bool) -> float:
    """Return the ratio of width to height of this box, clamped to 1/4 to 4."""
    low, high = layout_box(result, crop)
    width, height = high - low
    return float(np.clip(width / max(height, np.finfo(np.float64).tiny), 0.25, 4.0))


def chart_paths(uv: FloatArray, uv_faces: IntArray) -> list[Path]:
    """Return a matplotlib path for each chart: its closed outline and those of its holes."""
    from matplotlib.path import Path

    # Where an outline touches itself, the triangles on each side of the point have a copy of it.
    mesh = open_along(TriangleMesh(uv, uv_faces), np.empty(0, dtype=np.int64)).mesh
    charts, chart = np.unique(label_faces(uv_faces, len(uv))[1], return_inverse=True)
    outlines: list[list[Path]] = [[] for _ in charts]
    for walk in mesh.boundary_walks():
        points = mesh.tails[walk]
        outlines[chart[walk[0] // 3]].append(Path(mesh.vertices[[*points, points[0]]], closed=True))
    return [Path.make_compound_path(*loops) for loops in outlines]


def layout_cones(result: Flattening) -> tuple[IntArray, IntArray]:
    """Return the vertices of cones and their layout points, one pair for each point of a cone in the layout."""
    at_cone = np.isin(result.faces, result.cones)
    pairs = np.column_stack([result.faces[at_cone], result.uv_faces[at_cone]])
    vertex, point = np.unique(pairs, axis=0).reshape(-1, 2).T
    return vertex, point


def _draw_tiles(axes: Axes, tiles: FloatArray) -> None:
    """Draw the frames of textures, with their UDIM numbers if there are several."""
    from matplotlib.patches import Rectangle

    for u, v in tiles.tolist():
        axes.add_patch(Rectangle((u, v), 1, 1, fill=False, edgecolor=FRAME_COLOR, linewidth=0.5, zorder=-1))
        if len(tiles) > 1:
            axes.text(
                u + 0.02, v + 0.98, f"{1001 + u + 10 * v:.0f}", color=FRAME_COLOR, va="top", size="small"
            )


def _draw_segments(
    axes: Axes, ends: FloatArray, name: str, *, color: str, width: float, zorder: float
) -> None:
    """Draw (k, 2, 2) line segments, thousands in one path; a path for each would make files several times larger."""
    from matplotlib.collections import PathCollection
    from matplotlib.path import Path

    paths = []
    for start in range(0, len(ends), 4000):
        points = ends[start : start + 4000].reshape(-1, 2)
        path = Path(points, np.tile(np.array([Path.MOVETO, Path.LINETO], dtype=np.uint8), len(points) // 2))
        path.should_simplify = False
        paths.append(path)
    lines = PathCollection(paths, facecolors="none", edgecolors=color, linewidths=width, zorder=zorder)
    lines.set(gid=name, capstyle="round")
    axes.add_collection(lines)
