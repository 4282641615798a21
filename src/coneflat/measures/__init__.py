"""Measures of a parameterization, reports and guarantees."""

from .distortion import angle_sum_errors, mean_qc, measure, measure_map, quantile, sum_angles
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
from .strain import largest_of_sides, strain_of

__all__ = [
    "FIRST_ROWS", "MAP_MEASURES", "REPORTED", "Requirement", "Row", "SUMMARY_MEASURES", "angle_sum_errors", "as_rows",
    "breaches", "largest_of_sides", "map_rows", "mean_qc", "measure", "measure_map", "number_text", "packing_row",
    "parse_requirements", "path_text", "quantile", "strain_of", "sum_angles", "undefined_measures",
    "unmet_guarantees",
]  # fmt: skip
