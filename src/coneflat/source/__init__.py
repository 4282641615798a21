"""Preparation of the input: connected parts, each with the specification of its cones, metric and seams."""

from .constraints import vertex_numbers
from .copies import Copy, copied, find_copies
from .input_mesh import at_unit_size
from .parts import Part, Source

__all__ = ["Copy", "Part", "Source", "at_unit_size", "copied", "find_copies", "vertex_numbers"]
