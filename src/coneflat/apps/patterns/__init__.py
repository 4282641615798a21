"""Patterns of surfaces for cloth, paper and sheet, in millimetres; they need `coneflat[patterns]`."""

from __future__ import annotations

from .files import PATTERN_FORMATS, check_pattern_output, write_pattern
from .options import KINDS, PatternOptions
from .report import PATTERN_MEASURES
from .result import Pattern

__all__ = [
    "KINDS",
    "PATTERN_FORMATS",
    "PATTERN_MEASURES",
    "Pattern",
    "PatternOptions",
    "check_pattern_output",
    "write_pattern",
]
