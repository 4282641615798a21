"""Charts in the plane: where they overlap."""

from .overlap import Overlaps, find_overlaps
from .regions import overlap_regions

__all__ = ["Overlaps", "find_overlaps", "overlap_regions"]
