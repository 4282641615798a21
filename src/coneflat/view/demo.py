"""The figure that shows a flattening at a glance."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..text import plural
from .camera import default_eye, fit_camera
from .figure import new_figure
from .panels import (
    NEGATIVE_COLOR,
    POSITIVE_COLOR,
    QC_COLORS,
    SEAM_COLOR,
    cone_area,
    draw_distortion,
    draw_layout,
    draw_textured,
    qc_top,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..result import Flattening

SIZE = (15.0, 5.5)  # inches
FLOOR, CEILING = 0.075, 0.845  # of the panels, as shares of the height
TITLE_SIZE, LABEL_SIZE, SMALL_SIZE = 13.0, 11.0, 9.5  # points


def demo_figure(result: Flattening, *, up: str = "y") -> Figure:
    """Return a figure of a flattening: the textured model, its layout, its distortion from two sides.

    Args:
        result: the flattening.
        up: the model's upward axis, "x", "y" or "z".

    Raises:
        OptionError: matplotlib is not installed, or `up` names no axis.
    """
    figure = new_figure(*SIZE)
    height = CEILING - FLOOR
    figure.text(0.012, 0.945, title(result), size=TITLE_SIZE, va="center", ha="left", weight="bold")

    draw_textured(figure.add_axes((0.012, FLOOR, 0.305, height)), result, up)
    _label(figure, 0.012, "Model, textured by its UVs")
    draw_layout(figure.add_axes((0.335, FLOOR, 0.305, height)), result)
    _label(figure, 0.335, "UV layout; a dot's area shows its cone's curvature")

    top = qc_top(result.distortion.qc)
    _label(figure, 0.652, "Quasi-conformal distortion, front and back")
    for behind, box in enumerate(_two_boxes(result, up, 0.652, FLOOR, 0.285, height)):
        draw_distortion(figure.add_axes(box), result, top, up, bool(behind))
    _color_bar(figure, top)
    _legend(figure, result)
    return figure


def title(result: Flattening) -> str:
    """Return the line of key numbers."""
    measures = result.distortion
    parts = [
        plural(len(result.faces), "triangle"),
        plural(len(result.cones), "cone"),
        f"QC mean {measures.qc_mean:.4f}",
        f"{measures.flipped:,} flipped",
        f"seam length {measures.seam_length:.2f} √area",
    ]
    source = getattr(result, "source", None)
    name = [source.path.name] if source is not None else []
    return "  ·  ".join(name + parts)


def _label(figure: Figure, x: float, text: str) -> None:
    figure.text(x, 0.878, text, size=LABEL_SIZE, va="center", ha="left", color="#333333")


def _two_boxes(
    result: Flattening, up: str, left: float, floor: float, width: float, height: float
) -> list[tuple[float, float, float, float]]:
    """Return the boxes of two views, (left, floor, width, height): whichever way is larger."""
    wide, tall = SIZE[0] * width, SIZE[1] * height
    views = [default_eye(up, behind) for behind in (False, True)]

    def scale(box: tuple[float, float]) -> float:
        # At a thousand pixels to the inch the camera's whole pixels do not matter.
        size = round(1000 * box[0]), round(1000 * box[1])
        return min(fit_camera(result.vertices, size, eye, up).scale for eye in views)

    if scale((wide, tall / 2)) >= scale((wide / 2, tall)):
        return [(left, floor + height / 2, width, height / 2), (left, floor, width, height / 2)]
    return [(left, floor, width / 2, height), (left + width / 2, floor, width / 2, height)]


def _color_bar(figure: Figure, top: float) -> None:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    axes = figure.add_axes((0.948, FLOOR + 0.09, 0.009, CEILING - FLOOR - 0.18))
    bar = figure.colorbar(ScalarMappable(Normalize(1.0, top), QC_COLORS), cax=axes, extend="max")
    bar.set_ticks(np.linspace(1.0, top, 6).tolist())
    bar.ax.yaxis.set_major_formatter("{x:.2f}")
    bar.ax.tick_params(labelsize=SMALL_SIZE, width=0.6)
    bar.outline.set_linewidth(0.6)


def _legend(figure: Figure, result: Flattening) -> None:
    """Name the marks that the figure has, below the left panel."""
    from matplotlib.lines import Line2D

    diameter = float(np.sqrt(cone_area(np.array([np.pi / 2]))[0]))
    dot: dict[str, Any] = {"linestyle": "", "marker": "o", "markersize": diameter, "markeredgecolor": "white"}
    marks: list[Any] = []
    if len(result.seams):
        marks.append(Line2D([], [], color=SEAM_COLOR, linewidth=1.3, label="seam"))
    if np.any(result.curvatures > 0.0):
        marks.append(Line2D([], [], color=POSITIVE_COLOR, label="cone, positive curvature", **dot))
    if np.any(result.curvatures < 0.0):
        marks.append(Line2D([], [], color=NEGATIVE_COLOR, label="cone, negative curvature", **dot))
    if marks:
        figure.legend(
            handles=marks,
            loc="lower left",
            bbox_to_anchor=(0.008, 0.0),
            ncols=len(marks),
            frameon=False,
            fontsize=SMALL_SIZE,
            handletextpad=0.4,
            columnspacing=1.6,
        )
