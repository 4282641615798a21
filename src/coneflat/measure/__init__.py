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
    "as_rows",
    "angle_sum_errors",
    "Distortion",
    "MAP_MEASURES",
    "REPORTED",
    "Requirement",
    "Row",
    "breaches",
    "unmet_guarantees",
    "map_rows",
    "measure",
    "measure_map",
    "number_text",
    "packing_row",
    "parse_requirements",
    "path_text",
    "quantile",
    "sum_angles",
]

_HOMES = {
    "as_rows": "report",
    "angle_sum_errors": "distortion",
    "Distortion": "distortion",
    "MAP_MEASURES": "report",
    "Row": "report",
    "unmet_guarantees": "guarantees",
    "map_rows": "report",
    "measure": "distortion",
    "measure_map": "distortion",
    "number_text": "report",
    "packing_row": "report",
    "path_text": "report",
    "quantile": "distortion",
    "sum_angles": "distortion",
}


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module("." + _HOMES[name], __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
