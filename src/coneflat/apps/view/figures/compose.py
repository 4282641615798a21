"""Composition and writing of figures: panels in rows, each row with a card that explains its colours.

No display is needed. Matplotlib is imported only when a figure is created.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from os import PathLike
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from ....base import DOTS_PER_INCH
from ....errors import OptionError
from ....io import atomic_write, checked_target, imported
from ..palettes import color_table
from ..quantity import Quantity
from .cone_marks import check_dpi

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class Inches:
    """Lengths in figures, in inches."""

    WIDTH = 7.0  # Two columns of a journal.
    MARGIN, GAP = 0.08, 0.12
    CARD, CARD_HEIGHT = 1.35, 1.4
    TITLE, LABEL, LEGEND = 0.3, 0.22, 0.28
    TICKS, LINE = 0.28, 0.135
    SCALE_LEFT, SCALE_BELOW = 0.55, 0.42  # Space for the ticks and labels of a graph.


class Points:
    """Sizes of text, in points."""

    TITLE, LABEL, NOTES = 10.0, 8.5, 7.5


TEXT_COLOR = "#333333"

MAX_PIXELS = 30e6
"""Largest number of pixels. Pictures need four samples per pixel and 16 bytes per sample: 2 GB."""


# Dates and the version of matplotlib are left out, so that equal figures give equal files.
_METADATA: dict[str, dict[str, Any]] = {
    ".png": {"Software": None},
    ".svg": {"Date": None, "Creator": None},
    ".pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}

#: Extensions of the files that `save_figure` writes.
FIGURE_FORMATS = tuple(_METADATA)

# TrueType fonts, because many journals reject fonts of Type 3, and reproducible names in SVG.
_SETTINGS = {"pdf.fonttype": 42, "svg.hashsalt": "coneflat"}


@dataclass(frozen=True)
class Panel:
    """A picture in a figure.

    Attributes:
        aspect: ratio of width to height.
        draw: function that draws it in axes.
        label: text above it.
        is_graph: whether it needs space for ticks and labels.
    """

    aspect: float
    draw: Callable[[Axes], object]
    label: str = ""
    is_graph: bool = False

    def fit_label(self, height: float) -> Panel:
        """Return a panel that is wide enough for its label at a height in inches."""
        return replace(self, aspect=max(self.aspect, text_width(self.label) / height))


@dataclass(frozen=True)
class Row:
    """Panels of equal height, at most `tallest` inches, and the quantities that their colours show."""

    panels: Sequence[Panel]
    quantities: Sequence[Quantity] = ()
    tallest: float = 4.5


def compose(
    rows: Sequence[Row],
    *,
    title: str = "",
    marks: Sequence[Any] = (),
    size: tuple[float, float] | None = None,
    dpi: float = DOTS_PER_INCH,
    width: float = Inches.WIDTH,
) -> Figure:
    """Return a figure of rows of panels.

    Args:
        rows: rows from top to bottom.
        title: title at the top.
        marks: matplotlib handles of the legend at the bottom.
        size: width and height in inches; None to fit the panels.
        dpi: resolution in dots per inch.
        width: largest width in inches if `size` is None.

    Raises:
        OptionError: the size is too small for the panels or has too many pixels, or matplotlib is not installed.
    """
    above = [Inches.LABEL * any(panel.label for panel in row.panels) for row in rows]
    fixed = sum(above) + Inches.GAP * (len(rows) - 1) + 2 * Inches.MARGIN
    fixed += Inches.TITLE * bool(title) + Inches.LEGEND * bool(marks)
    if size is None:
        size, heights = _fitted_size(rows, width, fixed, _legend_width(marks))
    else:
        heights = [(size[1] - fixed) / len(rows)] * len(rows)
        if heights[0] < max(_smallest_heights(rows)) or min(_panel_space(row, size[0]) for row in rows) < 0.3:
            raise OptionError(f"{size[0]:g} by {size[1]:g} inches are too small for the pictures")
    check_pixels(size, dpi)
    figure = new_figure(*size, dpi=dpi)
    from matplotlib import rc_context

    middle, space = size[1] - Inches.TITLE / 2 - Inches.MARGIN / 2, size[0] - 2 * Inches.MARGIN
    _write(figure, Inches.MARGIN, middle, title, space, size=Points.TITLE, weight="bold", va="center")
    top = size[1] - Inches.MARGIN - Inches.TITLE * bool(title)
    with rc_context({"font.size": Points.LABEL}):
        for row, height, label in zip(rows, heights, above, strict=True):
            top -= label + height
            _draw_row(figure, row, top, height)
            top -= Inches.GAP
    if marks:
        look = {"frameon": False, "fontsize": Points.NOTES, "labelcolor": TEXT_COLOR, "borderpad": 0.4}
        look |= {
            "loc": "lower left",
            "bbox_to_anchor": (0.0, 0.0),
            "handletextpad": 0.4,
            "columnspacing": 1.4,
        }
        figure.legend(handles=list(marks), ncols=len(marks), **look)
    return figure


def check_pixels(size: tuple[float, float], dpi: float) -> None:
    """Raise OptionError if a figure of this size in inches cannot be drawn at this resolution."""
    check_dpi(dpi)
    pixels = size[0] * size[1] * dpi**2
    if not 0 < min(size) <= pixels <= MAX_PIXELS:
        raise OptionError(
            f"{size[0]:g} by {size[1]:g} inches at {dpi:g} dots per inch are {pixels / 1e6:.0f} million pixels, above "
            f"the limit of {MAX_PIXELS / 1e6:g} million: choose a smaller size or resolution"
        )


def _panel_space(row: Row, width: float) -> float:
    """Return the width available for panels, in inches."""
    card = (Inches.CARD + Inches.GAP) * bool(row.quantities)
    return width - 2 * Inches.MARGIN - Inches.GAP * (len(row.panels) - 1) - card


def _aspect(row: Row) -> float:
    return sum(panel.aspect for panel in row.panels)


def _draw_row(figure: Figure, row: Row, floor: float, height: float) -> None:
    width = figure.get_figwidth()
    unit = _panel_space(row, width) / _aspect(row)
    left = Inches.MARGIN
    for panel in row.panels:
        space = unit * panel.aspect
        _write(figure, left, floor + height + 0.05, panel.label, space=space, size=Points.LABEL, va="bottom")
        x, y = (Inches.SCALE_LEFT, Inches.SCALE_BELOW) if panel.is_graph else (0.0, 0.0)
        panel.draw(_add_axes(figure, left + x, floor + y, space - x, height - y))
        left += space + Inches.GAP
    share = height / max(len(row.quantities), 1)
    for k, quantity in enumerate(row.quantities):
        _draw_card(figure, quantity, left, floor + height - (k + 1) * share, share)


def _draw_card(figure: Figure, quantity: Quantity, left: float, floor: float, height: float) -> None:
    """Draw the colour bar, the histogram and the percentiles of a quantity."""
    lines = [("median", 50), ("95% below", 95), ("99% below", 99), ("largest", 100)]
    text_height = Inches.LABEL + Inches.TICKS + (len(lines) + 0.7) * Inches.LINE
    graph = min(max(height - text_height, 0.25), 0.7)
    top = floor + min(height, (height + text_height + graph) / 2)
    _write(figure, left, top, quantity.label, space=Inches.CARD - 0.05, size=Points.LABEL, va="top")
    draw_histogram(
        _add_axes(figure, left + 0.05, top - Inches.LABEL - graph, Inches.CARD - 0.15, graph), quantity
    )
    for k, (name, percent) in enumerate(lines):
        y = top - Inches.LABEL - graph - Inches.TICKS - k * Inches.LINE
        write = partial(_write, figure, y=y, size=Points.NOTES, va="top")
        write(left, text=name)
        write(left + Inches.CARD - 0.05, text=quantity.text(percent), ha="right")


def draw_histogram(axes: Axes, quantity: Quantity) -> None:
    """Draw the histogram of a quantity above its colour bar; values outside the bar are counted at its ends."""
    values, weights = quantity.counted()
    position = quantity.scale.position(values)
    place = np.minimum((position * 36).astype(np.int64), 35)
    share = np.bincount(place, weights, 36)
    colors = color_table(quantity.scale.colors)
    heights = share / (share.max() or 1.0)
    axes.bar(np.arange(36) / 36, heights, 1.0 / 36, align="edge", color="#8d95a1", zorder=1)
    axes.imshow(colors[None], extent=(0.0, 1.0, -0.22, -0.04), aspect="auto", zorder=2)
    axes.set(xlim=(0.0, 1.0), ylim=(-0.22, 1.02))
    axes.set_yticks([])
    at = quantity.scale.position(np.array([value for value, _ in quantity.scale.ticks]))
    axes.set_xticks(at.tolist(), [text for _, text in quantity.scale.ticks])
    axes.tick_params(labelsize=Points.NOTES, width=0.5, length=2.0, pad=1.5, colors=TEXT_COLOR)
    for spine in axes.spines.values():
        spine.set_visible(False)


def _add_axes(figure: Figure, left: float, floor: float, width: float, height: float) -> Axes:
    """Return new axes in a box given in inches."""
    wide, tall = figure.get_size_inches()
    return figure.add_axes((left / wide, floor / tall, width / wide, height / tall))


def _write(figure: Figure, x: float, y: float, text: str, space: float | None = None, **look: Any) -> None:
    """Write text at a position in inches, in a smaller font if it is wider than `space` inches."""
    if not text:
        return
    wide, tall = figure.get_size_inches()
    look = {"ha": "left", "color": TEXT_COLOR, **look}
    written = figure.text(x / wide, y / tall, text, parse_math=False, **look)
    if space is not None:
        needed = written.get_window_extent().width / figure.dpi
        written.set_fontsize(float(look["size"]) * min(1.0, space / needed))


def text_width(text: str, size: float = Points.LABEL) -> float:
    """Return the approximate width of a text in inches; size: font size in points."""
    return len(text) * 0.6 * size / 72.0


def _smallest_heights(rows: Sequence[Row]) -> list[float]:
    """Return the smallest height in inches of each row."""
    return [max(Inches.CARD_HEIGHT * len(row.quantities), 0.3) for row in rows]


def _fitted_size(
    rows: Sequence[Row], width: float, fixed: float, legend_width: float
) -> tuple[tuple[float, float], list[float]]:
    """Return width and height of a figure that fit its panels, and the height of each row, all in inches.

    Args:
        rows: rows from top to bottom.
        width: largest width of the rows.
        fixed: height of everything but the rows.
        legend_width: width that the legend needs.
    """
    natural = [min(_panel_space(row, width) / _aspect(row), row.tallest) for row in rows]
    spare = min(_panel_space(row, width) - h * _aspect(row) for row, h in zip(rows, natural, strict=True))
    heights = np.maximum(natural, _smallest_heights(rows)).tolist()
    return (max(width - spare, legend_width), sum(heights) + fixed), heights


def _legend_width(marks: Sequence[Any]) -> float:
    """Return the approximate width of a legend of marks in inches."""
    return sum(0.45 + text_width(str(mark.get_label()), Points.NOTES) for mark in marks)


def new_figure(width: float, height: float, dpi: float = 150) -> Figure:
    """Return an empty figure of a size in inches, independent of windows and of the state of pyplot.

    Raises:
        OptionError: matplotlib is not installed.
    """
    module = imported("matplotlib.figure", "figures need matplotlib", '"coneflat[figures]"')
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure: Figure = module.Figure(figsize=(width, height), dpi=dpi, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def check_figure(path: str | PathLike[str]) -> Path:
    """Return the path if `save_figure` can write to it; for use before long computations.

    Raises:
        UnknownFormatError: the extension is not one of `FIGURE_FORMATS`.
        MeshFileError: the folder is missing, the path is a folder, or writing is not permitted.
    """
    return checked_target(path, FIGURE_FORMATS, "figures are written as")


def save_figure(figure: Figure, path: str | PathLike[str]) -> Path:
    """Write a figure as PNG, SVG or PDF, by the extension of the path; no incomplete file is left.

    Args:
        figure: figure of `make_figure`.
        path: file that ends in .png, .svg or .pdf.

    Raises:
        UnknownFormatError: the extension is none of these.
        MeshFileError: the file cannot be written.

    Examples:
        >>> import tempfile
        >>> result = coneflat.flatten(np.eye(4)[:, :3], [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     coneflat.save_figure(coneflat.make_figure(result, "layout"), folder + "/layout.svg").name
        'layout.svg'
    """
    path = check_figure(path)
    with atomic_write(path) as stream:
        write_figure(figure, stream, path.suffix.lower())
    return path


def write_figure(figure: Figure, stream: IO[bytes], ending: str) -> None:
    """Write a figure to a binary stream; ending: one of `FIGURE_FORMATS`."""
    from matplotlib import rc_context

    with rc_context(_SETTINGS):
        figure.savefig(stream, format=ending[1:], dpi=figure.dpi, metadata=_METADATA[ending])
