"""From cones to a layout: each method is a flat metric that knows how to lay itself out, a file per method."""

from .base import FlatMetric, LaidOut
from .exact.flatten import ExactChoices, exact_flattening
from .linear import linear_flattening

__all__ = ["ExactChoices", "FlatMetric", "LaidOut", "exact_flattening", "linear_flattening"]
