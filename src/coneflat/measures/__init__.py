"""Measures of a parameterization, reports and guarantees."""

from .distortion import angle_sum_errors, mean_qc, measure, measure_map
from .guarantees import undefined_measures, unmet_guarantees
from .report import (
    FIRST_ROWS,
    MAP_MEASURES,
    SUMMARY_MEASURES,
    Row,
    as_rows,
    map_rows,
    number_text,
    packing_row,
    path_text,
)
from .requirements import REPORTED, Requirement, breaches, parse_requirements
from .triangles import sum_angles
from .weighted import quantile

__all__ = [
    "FIRST_ROWS", "MAP_MEASURES", "REPORTED", "Requirement", "Row", "SUMMARY_MEASURES", "angle_sum_errors", "as_rows",
    "breaches", "map_rows", "mean_qc", "measure", "measure_map", "number_text", "packing_row",
    "parse_requirements", "path_text", "quantile", "sum_angles", "undefined_measures",
    "unmet_guarantees",
]  # fmt: skip
