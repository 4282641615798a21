"""Cones and seams in pictures."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ....base import FloatArray
from ....errors import OptionError
from .render import MeshPicture

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .... import Flattening

SEAM_COLOR = "#1a1a1a"
BOUNDARY_COLOR = "#7f8a99"
HIDDEN_SEAM_COLOR = "#a9aeb6"
POSITIVE_COLOR = "#d62222"
NEGATIVE_COLOR = "#000000"
HIDDEN_COLORS = {POSITIVE_COLOR: "#e6b3b4", NEGATIVE_COLOR: "#a3a5a9"}
"""Colours of cones that are hidden by the model."""

MARKER_SHARES = {"o": 1.0, "s": np.pi / 4}
"""Factors of the areas of matplotlib's markers, which are those of the squares around them, for equal areas."""

DOT_REACH = 0.01
"""Approximate radius of a dot, as a fraction of the longer side of the picture."""

SEAM_WIDTH = 1.2
"""Line width in points."""


def mark_scale(axes: Axes) -> float:
    """Return the factor of line widths and dot areas for the size of the axes, 1 for 360 points."""
    box = axes.get_window_extent()
    side = float(np.sqrt(box.width * box.height)) * 72.0 / axes.figure.dpi
    return float(np.clip(side / 360.0, 0.15, 1.5))


def cone_area(curvatures: FloatArray) -> FloatArray:
    """Return the areas of the dots of cones in square points, clamped to a minimum and a maximum."""
    return np.clip(60.0 * np.abs(curvatures) / (np.pi / 2), 15.0, 150.0)


def draw_dots(
    axes: Axes, points: FloatArray, curvatures: FloatArray, *, hidden: bool = False, share: float = 1.0
) -> None:
    """Draw cones: red discs of positive, black squares of negative curvature, with an area that grows with it.

    Args:
        axes: matplotlib axes to draw in.
        points: (k, 2) positions in the coordinates of the axes.
        curvatures: (k,) curvatures in radians.
        hidden: whether the cones are hidden by the model.
        share: factor of the areas of dots.
    """
    if not len(points):
        return
    factor = share * mark_scale(axes)
    is_positive = curvatures > 0.0
    signs = (("positive", POSITIVE_COLOR, "o", is_positive), ("negative", NEGATIVE_COLOR, "s", ~is_positive))
    for sign, color, marker, chosen in signs:
        if not chosen.any():
            continue
        axes.scatter(
            points[chosen, 0],
            points[chosen, 1],
            s=factor * MARKER_SHARES[marker] * cone_area(curvatures[chosen]),
            c=HIDDEN_COLORS[color] if hidden else color,
            marker=marker,
            edgecolors="none" if hidden else "white",
            linewidths=0.7 * np.sqrt(factor),
            zorder=3 if hidden else 6,
            clip_on=False,
            gid=f"{'hidden-' * hidden}{sign}-cones",
        )


def draw_seams_on_model(
    axes: Axes, picture: MeshPicture, result: Flattening, *, through: bool = False
) -> None:
    """Draw the visible parts of the seams on a picture of the model; with `through`, also the hidden parts, faintly."""
    from matplotlib.collections import LineCollection

    pieces, visible = picture.split_segments(*np.moveaxis(result.vertices[result.seams], 1, 0))
    width = SEAM_WIDTH * np.sqrt(mark_scale(axes))
    if through:
        hidden = LineCollection(list(pieces[~visible]), colors=HIDDEN_SEAM_COLOR, linewidths=0.6 * width)
        hidden.set(zorder=2, gid="hidden-seams", capstyle="round")
        axes.add_collection(hidden)
    lines = LineCollection(list(pieces[visible]), colors=SEAM_COLOR, linewidths=width)
    lines.set(zorder=4, gid="seams", capstyle="round")
    axes.add_collection(lines)


def draw_cones_on_model(
    axes: Axes, picture: MeshPicture, result: Flattening, *, through: bool = False
) -> None:
    """Draw the visible cones on a picture of the model; with `through`, also the hidden ones, faintly."""
    places, curvatures = result.vertices[result.cones], result.curvatures
    points = picture.camera.project(places)[:, :2]
    # A dot that extends beyond an outline counts as visible.
    visible = picture.visible_points(places, DOT_REACH * max(picture.camera.width, picture.camera.height))
    if through:
        draw_dots(axes, points[~visible], curvatures[~visible], hidden=True)
    draw_dots(axes, points[visible], curvatures[visible])


def mark_handles(result: Flattening, *, cones: bool = True, seams: bool = True) -> list[Any]:
    """Return the matplotlib legend handles of the marks that a result has."""
    from matplotlib.lines import Line2D

    diameter = float(np.sqrt(cone_area(np.array([np.pi / 2]))[0]))
    marks: list[Any] = []
    if seams and len(result.seams):
        marks.append(Line2D([], [], color=SEAM_COLOR, linewidth=SEAM_WIDTH, label="seam"))
    cone_signs = (
        ("positive cone", POSITIVE_COLOR, "o", result.curvatures > 0.0),
        ("negative cone", NEGATIVE_COLOR, "s", result.curvatures < 0.0),
    )
    for label, color, marker, has_sign in cone_signs:
        if cones and np.any(has_sign):
            size = diameter * np.sqrt(MARKER_SHARES[marker])
            look: dict[str, Any] = {
                "linestyle": "",
                "marker": marker,
                "markersize": size,
                "markeredgecolor": "white",
            }
            marks.append(Line2D([], [], color=color, label=label, **look))
    return marks


def pixels_of(axes: Axes, dpi: float) -> tuple[int, int]:
    """Return the width and height of the axes in pixels, at a resolution in dots per inch.

    Raises:
        OptionError: `dpi` is not between 10 and 2400.
    """
    check_dpi(dpi)
    box = axes.get_window_extent()
    factor = dpi / axes.figure.dpi
    return max(round(box.width * factor), 1), max(round(box.height * factor), 1)


def check_dpi(dpi: float) -> None:
    """Raise OptionError if the resolution is not between 10 and 2400 dots per inch."""
    if not 10 <= dpi <= 2400:
        raise OptionError(f"the resolution must be between 10 and 2400 dots per inch, got {dpi:g}")
