"""Charts in the plane: how they are split and glued, how they lie, and their places in a texture."""

from .charts import ChartLayout, Seams
from .injective import injective_charts, separate_overlaps
from .orient import orient_charts
from .pack import Packed, arrange_charts, pack_charts
from .touch import part_touching

__all__ = [
    "ChartLayout",
    "Seams",
    "Packed",
    "arrange_charts",
    "injective_charts",
    "orient_charts",
    "pack_charts",
    "part_touching",
    "separate_overlaps",
]
