"""Measures of a parameterization, reports and guarantees.

Modules that need NumPy are imported on first use, because the commands list the measures in their help texts.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .requirements import REPORTED, Requirement, breaches, parse_requirements

if TYPE_CHECKING:
    from .distortion import Distortion, angle_sum_errors, measure, measure_map, quantile, sum_angles
    from .guarantees import unmet_guarantees
    from .report import MAP_MEASURES, Row, as_rows, map_rows, number_text, packing_row, path_text

__all__ = [
    "as_rows", "angle_sum_errors", "Distortion", "MAP_MEASURES", "REPORTED", "Requirement", "Row", "breaches",
    "unmet_guarantees", "map_rows", "measure", "measure_map", "number_text", "packing_row", "parse_requirements",
    "path_text", "quantile", "sum_angles",
]  # fmt: skip

_DISTORTION = ("angle_sum_errors", "Distortion", "measure", "measure_map", "quantile", "sum_angles")


def __getattr__(name: str) -> Any:
    if name in __all__:
        home = (
            "distortion" if name in _DISTORTION else "guarantees" if name == "unmet_guarantees" else "report"
        )
        return getattr(import_module("." + home, __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
