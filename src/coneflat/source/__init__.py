"""Preparation of the input: connected parts, each with the specification of its cones, metric and seams."""

from .components import Component, Prepared
from .constraints import vertex_numbers
from .copies import find_copies
from .input_mesh import at_unit_size, result_numbering
from .preparation import LatestCache, Source
from .rounding import rounding_notes

__all__ = [
    "Component", "LatestCache", "Prepared", "Source", "at_unit_size", "find_copies", "result_numbering",
    "rounding_notes", "vertex_numbers",
]  # fmt: skip
