"""Charts in the plane: splitting and gluing them, orienting them, and packing them into a texture."""

from .injective import separate_overlaps
from .orient import orient_charts
from .pack import Packed, arrange_charts, pack_charts
from .pack_cuts import cut_for_packing
from .touch import separate_touching

__all__ = [
    "Packed",
    "arrange_charts",
    "cut_for_packing",
    "orient_charts",
    "pack_charts",
    "separate_touching",
    "separate_overlaps",
]
