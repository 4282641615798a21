"""Preparation of the input: connected parts, each with the specification of its cones, metric and seams."""

from .coarse import coarse_component, is_large
from .components import Component, Prepared
from .congruent import Congruence, congruence
from .constraints import vertex_numbers
from .copies import find_copies, has_vertex_options
from .fill import Fill
from .input_mesh import InputMesh, at_unit_size, result_numbering
from .marked_edges import marked_edges
from .preparation import LatestCache, Source
from .rounding import rounding_notes

__all__ = [
    "Component", "Congruence", "Fill", "InputMesh", "LatestCache", "Prepared", "Source", "at_unit_size",
    "coarse_component", "congruence", "find_copies", "has_vertex_options", "is_large", "marked_edges",
    "result_numbering", "rounding_notes", "vertex_numbers",
]  # fmt: skip
