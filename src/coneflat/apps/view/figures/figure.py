"""Figures without a display: made, and written to files. Matplotlib is imported only when one is made."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from ....errors import OptionError
from ....io import atomic_write, checked_target

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# What tells the time or the library's version is left out: the same figure gives the same bytes for longer.
_METADATA: dict[str, dict[str, Any]] = {
    ".png": {"Software": None},
    ".svg": {"Date": None, "Creator": None},
    ".pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}

#: Endings of the files that `save_figure` writes.
FIGURE_FORMATS = tuple(_METADATA)

# TrueType fonts, since many journals refuse those of Type 3, and names in SVG that are the same each time.
_SETTINGS = {"pdf.fonttype": 42, "svg.hashsalt": "coneflat"}


def new_figure(width: float, height: float, dpi: float = 150) -> Figure:
    """Return an empty figure of a size in inches, tied to no window and to no global state.

    Raises:
        OptionError: matplotlib is not installed.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise OptionError('figures need matplotlib: pip install "coneflat[figures]"') from error
    figure = Figure(figsize=(width, height), dpi=dpi, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def check_figure_target(path: str | PathLike[str]) -> Path:
    """Return the path if `save_figure` can be expected to succeed with it; worth asking before long work.

    Raises:
        UnknownFormatError: the ending is not one of `FIGURE_FORMATS`.
        MeshFileError: the folder is missing, the path is a folder, or writing is not permitted.
    """
    return checked_target(path, FIGURE_FORMATS, "figures are written as")


def save_figure(figure: Figure, path: str | PathLike[str]) -> Path:
    """Write a figure as PNG, SVG or PDF, by the path's ending; the file is there in full or not at all.

    Raises:
        UnknownFormatError: the ending is none of these.
        MeshFileError: the file cannot be written.
    """
    path = check_figure_target(path)
    with atomic_write(path) as stream:
        write_figure(figure, stream, path.suffix.lower())
    return path


def write_figure(figure: Figure, stream: IO[bytes], ending: str) -> None:
    """Write a figure to a binary stream; ending: one of `FIGURE_FORMATS`."""
    from matplotlib import rc_context

    with rc_context(_SETTINGS):
        figure.savefig(stream, format=ending[1:], dpi=figure.dpi, metadata=_METADATA[ending])
