"""Figures without a display: made, and written to files. Matplotlib is imported only when one is made."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import OptionError
from ..io.atomic import atomic_write

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DOTS_PER_INCH = 150
"""Resolution of the figures; pictures inside are rendered for it."""


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure of a size in inches, tied to no window and to no global state.

    Raises:
        OptionError: matplotlib is not installed.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise OptionError('figures need matplotlib: pip install "coneflat[figures]"') from error
    figure = Figure(figsize=(width, height), dpi=DOTS_PER_INCH, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Figure, path: str | PathLike[str]) -> Path:
    """Write a figure as PNG; the file is there in full or not at all.

    Raises:
        MeshFileError: the file cannot be written.
    """
    with atomic_write(path, "wb") as stream:
        # Without the library's version in it, the same figure gives the same bytes for longer.
        figure.savefig(stream, format="png", dpi=DOTS_PER_INCH, metadata={"Software": None})
    return Path(path)
