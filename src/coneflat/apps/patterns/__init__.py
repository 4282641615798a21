"""Patterns of surfaces for cloth, paper and sheet, in millimetres; they need `coneflat[patterns]`."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

#: Where names are defined; they are imported when they are first used, since commands need the options alone.
_HOMES = {
    "KINDS": "options",
    "PATTERN_FORMATS": "files.files",
    "PATTERN_MEASURES": "report",
    "Pattern": "result",
    "PatternOptions": "options",
    "check_pattern_output": "files.files",
    "page_of_pattern": "page",
    "rows_of": "report",
    "write_pattern": "files.files",
}

__all__ = [
    "KINDS",
    "PATTERN_FORMATS",
    "PATTERN_MEASURES",
    "Pattern",
    "PatternOptions",
    "check_pattern_output",
    "page_of_pattern",
    "rows_of",
    "write_pattern",
]

if TYPE_CHECKING:
    from .files.files import PATTERN_FORMATS, check_pattern_output, write_pattern
    from .options import KINDS, PatternOptions
    from .page import page_of_pattern
    from .report import PATTERN_MEASURES, rows_of
    from .result import Pattern


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module("." + _HOMES[name], __name__), name)
