"""Flat maps of the cerebral cortex, in the formats and measures of that field; needs nibabel (`coneflat[brains]`)."""

from __future__ import annotations

from .files import FLAT_FORMATS, kept_in_flat, read_flat
from .flat import FlatCortex, flatten_cortex
from .measures import FLAT_MEASURES, FlatMeasures, measure_flat, metric_distortion

__all__ = [
    "FLAT_FORMATS",
    "FLAT_MEASURES",
    "FlatCortex",
    "FlatMeasures",
    "flatten_cortex",
    "kept_in_flat",
    "measure_flat",
    "metric_distortion",
    "read_flat",
]
