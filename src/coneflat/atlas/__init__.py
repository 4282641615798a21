"""Charts in the plane: where they overlap, how they lie, and their places in a texture."""

from .injective import injective_charts
from .layout import Layout, Seams
from .orient import orient_charts
from .overlap import Overlaps, find_overlaps
from .pack import Packed, pack_charts
from .regions import overlap_layers, overlap_regions
from .together import pack_together
from .touch import part_touching

__all__ = [
    "Layout",
    "Seams",
    "Overlaps",
    "Packed",
    "find_overlaps",
    "injective_charts",
    "orient_charts",
    "overlap_layers",
    "overlap_regions",
    "pack_charts",
    "pack_together",
    "part_touching",
]
