"""The panels of a figure: the model with its texture, its layout, and its distortion."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .._arrays import BoolArray, FloatArray, IntArray
from .camera import Camera, default_eye
from .projection import MeshPicture, render_mesh
from .raster import rasterise
from .shading import downsample

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..result import Flattening

CELLS_ACROSS = 40
"""Cells of the checkerboard along the longer side of the layout."""

MOST_EDGES_DRAWN = 40_000
"""Triangles above which a layout is filled without its inner edges: they would turn it grey."""

LEAST_QC_RANGE = 0.05
"""A colour scale shorter than this would show noise as if it were distortion."""

QC_COLORS = "viridis_r"
SEAM_COLOR = "#1a1a1a"
POSITIVE_COLOR = "#d62222"
NEGATIVE_COLOR = "#000000"
CHART_COLOR = "#e3e9f1"
EDGE_COLOR = "#a9b6c8"
UNDEFINED_COLOR = (0.6, 0.6, 0.6)


def draw_textured(axes: Axes, result: Flattening, up: str) -> None:
    """Draw the model with a checkerboard through its UVs, its seams and its cones."""
    extent = np.ptp(result.uv[np.unique(result.uv_faces)], axis=0).max() if len(result.uv_faces) else 1.0
    picture = render_mesh(
        result.vertices,
        result.faces,
        size=_pixels(axes),
        up=up,
        corner_uv=result.corner_uv,
        cell=float(extent) / CELLS_ACROSS,
    )
    show_picture(axes, picture)
    draw_seams(axes, picture, result)
    draw_cones_on_model(axes, picture, result)


def draw_distortion(axes: Axes, result: Flattening, top: float, up: str, behind: bool) -> None:
    """Draw the model with each face coloured by its quasi-conformal distortion, from 1 to `top`."""
    from matplotlib import colormaps

    share = (result.distortion.qc - 1.0) / (top - 1.0)
    colors = np.asarray(colormaps[QC_COLORS](np.clip(np.nan_to_num(share), 0.0, 1.0)))[:, :3]
    colors[np.isnan(share)] = UNDEFINED_COLOR
    # The light is evened out, or a shadow would read as distortion.
    picture = render_mesh(
        result.vertices,
        result.faces,
        size=_pixels(axes),
        eye=default_eye(up, behind),
        up=up,
        face_colors=colors,
        contrast=0.6,
    )
    show_picture(axes, picture)


def draw_layout(axes: Axes, result: Flattening) -> None:
    """Draw the charts filled, with their outlines, thin inner edges and cones."""
    from matplotlib.collections import LineCollection

    uv, faces = result.uv, result.uv_faces
    inner, outline = layout_edges(faces)
    used = uv[np.unique(faces)] if len(faces) else np.array([[0.0, 0.0], [1.0, 1.0]])
    low, high = used.min(axis=0), used.max(axis=0)
    image, extent = _fill(uv, faces, low, high, _pixels(axes))
    axes.imshow(image, extent=extent, interpolation="antialiased", zorder=0)
    if len(faces) <= MOST_EDGES_DRAWN:
        axes.add_collection(LineCollection(list(uv[inner]), colors=EDGE_COLOR, linewidths=0.18, zorder=1))
    lines = LineCollection(list(uv[outline]), colors=SEAM_COLOR, linewidths=0.7, capstyle="round", zorder=2)
    axes.add_collection(lines)
    vertex, point = layout_cones(result)
    curvature = dict(zip(result.cones.tolist(), result.curvatures.tolist(), strict=True))
    draw_cones(axes, uv[point], np.array([curvature[v] for v in vertex.tolist()]), share=0.45)
    margin = 0.03 * max(high - low)
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)
    axes.set_aspect("equal")
    axes.set_axis_off()


def layout_edges(uv_faces: IntArray) -> tuple[IntArray, IntArray]:
    """Return the (k, 2) edges between two triangles of a layout, and those on the outline of a chart."""
    sides = np.sort(uv_faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    edges, count = np.unique(sides, axis=0, return_counts=True)
    return edges[count > 1], edges[count == 1]


def layout_cones(result: Flattening) -> tuple[IntArray, IntArray]:
    """Return the cones' vertices and layout points, one pair for every point that a cone has there."""
    at_cone = np.isin(result.faces, result.cones)
    pairs = np.column_stack([result.faces[at_cone], result.uv_faces[at_cone]])
    vertex, point = np.unique(pairs, axis=0).reshape(-1, 2).T
    return vertex, point


def draw_cones(axes: Axes, points: FloatArray, curvatures: FloatArray, share: float = 1.0) -> None:
    """Draw cones as dots, red or black by the sign of their curvature and as large as its amount."""
    if not len(points):
        return
    colors = [POSITIVE_COLOR if curvature > 0.0 else NEGATIVE_COLOR for curvature in curvatures.tolist()]
    axes.scatter(
        points[:, 0],
        points[:, 1],
        s=share * cone_area(curvatures),
        c=colors,
        edgecolors="white",
        linewidths=0.5,
        zorder=4,
        clip_on=False,
    )


def cone_area(curvatures: FloatArray) -> FloatArray:
    """Return the area of cones' dots in square points; small cones stay visible, large ones in bounds."""
    return np.clip(60.0 * np.abs(curvatures) / (np.pi / 2), 14.0, 140.0)


def draw_seams(axes: Axes, picture: MeshPicture, result: Flattening) -> None:
    """Draw the visible parts of the seams on a picture of the model."""
    from matplotlib.collections import LineCollection

    pieces = picture.visible_segments(*np.moveaxis(result.vertices[result.seams], 1, 0))
    lines = LineCollection(list(pieces), colors=SEAM_COLOR, linewidths=1.3, capstyle="round", zorder=2)
    axes.add_collection(lines)


def draw_cones_on_model(axes: Axes, picture: MeshPicture, result: Flattening) -> None:
    """Draw the visible cones on a picture of the model."""
    places = result.vertices[result.cones]
    visible: BoolArray = picture.visible_points(places)
    draw_cones(axes, picture.camera.project(places[visible])[:, :2], result.curvatures[visible])


def show_picture(axes: Axes, picture: MeshPicture) -> None:
    """Show a picture so that the axes' coordinates are its pixels, row 0 at the top."""
    camera: Camera = picture.camera
    axes.imshow(picture.image, extent=(0, camera.width, camera.height, 0), interpolation="antialiased")
    axes.set_axis_off()


def qc_top(qc: FloatArray) -> float:
    """Return the upper end of the colour scale: the 95th percentile rounded up, at least 1.05."""
    finite = qc[np.isfinite(qc)]
    excess = float(np.percentile(finite, 95)) - 1.0 if len(finite) else 0.0
    step = LEAST_QC_RANGE if excess < 0.5 else 0.5
    # Less a little: a percentile at a step, up to rounding, stays there.
    return 1.0 + max(float(np.ceil(excess / step - 1e-9)) * step, LEAST_QC_RANGE)


def _fill(
    uv: FloatArray, faces: IntArray, low: FloatArray, high: FloatArray, size: tuple[int, int]
) -> tuple[FloatArray, tuple[Any, ...]]:
    """Return the charts as an RGBA image in one colour, and the rectangle it covers in the plane."""
    from matplotlib.colors import to_rgb

    span = np.maximum(high - low, 1e-9 * max(1.0, float(np.abs(high).max())))
    fine = 2
    scale = min(size[0] / span[0], size[1] / span[1])
    width, height = (max(int(np.ceil(side)), 1) for side in scale * span)
    points = np.column_stack([uv[:, 0] - low[0], high[1] - uv[:, 1], np.zeros(len(uv))]) * fine * scale
    covered = rasterise(points, faces, fine * width, fine * height).covered
    image = np.broadcast_to(np.array(to_rgb(CHART_COLOR)), (*covered.shape, 3))
    extent = (low[0], low[0] + width / scale, high[1] - height / scale, high[1])
    return downsample(image, covered, fine), extent


def _pixels(axes: Axes) -> tuple[int, int]:
    """Return the width and height of the axes in pixels."""
    box = axes.get_window_extent()
    return max(round(box.width), 1), max(round(box.height), 1)
