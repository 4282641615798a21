"""Charts in the plane: where they overlap."""

from .injective import injective_charts
from .layout import Layout, Seams
from .overlap import Overlaps, find_overlaps
from .regions import overlap_layers, overlap_regions

__all__ = [
    "Layout",
    "Seams",
    "Overlaps",
    "find_overlaps",
    "injective_charts",
    "overlap_layers",
    "overlap_regions",
]
