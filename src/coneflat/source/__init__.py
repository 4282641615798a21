"""Preparation of the input: connected parts, each with the specification of its cones, metric and seams."""

from .constraints import vertex_numbers
from .copies import Copy, copied, find_copies
from .input_mesh import at_unit_size, result_numbering
from .parts import Part, Prepared, Source

__all__ = [
    "Copy",
    "Part",
    "Prepared",
    "Source",
    "at_unit_size",
    "copied",
    "find_copies",
    "result_numbering",
    "vertex_numbers",
]
