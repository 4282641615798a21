"""Writing of patterns to files."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from ....io import checked_target
from ..pages.assembly import pattern_pages
from ..result import Pattern
from .dxf import write_dxf
from .pdf import write_pdf
from .svg import write_svg

#: The endings of files for patterns.
PATTERN_FORMATS = (".pdf", ".svg", ".dxf")


def check_pattern_output(path: str | PathLike[str]) -> Path:
    """Return a path if a pattern can be written there.

    Raises:
        UnknownFormatError, MeshFileError: the ending is not known, or the file cannot be written.
    """
    return checked_target(path, PATTERN_FORMATS, "patterns are written as")


def write_pattern(pattern: Pattern, path: str | PathLike[str]) -> Path:
    """Write a pattern, and return the path; see `Pattern.save`."""
    path = check_pattern_output(path)
    match path.suffix.lower():
        case ".svg":
            write_svg(pattern.drawing(), path)
        case ".dxf":
            write_dxf(pattern.drawing(), path)
        case _:
            write_pdf(pattern_pages(pattern, path.stem), path, path.stem)
    return path
