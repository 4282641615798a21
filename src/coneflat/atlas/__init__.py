"""Charts in the plane: splitting and gluing them, orienting them, and packing them into a texture."""

from .charts import ChartLayout, Outlines, Seams
from .injective import separate_overlaps, with_charts
from .orient import square_angle, straight_angle
from .pack import Packed, arrange_charts, pack_charts
from .place import Effort, pack
from .split import as_disk
from .touch import round_safely, separate_touching

__all__ = [
    "ChartLayout", "Effort", "Outlines", "Packed", "Seams", "arrange_charts", "as_disk", "pack", "pack_charts",
    "round_safely", "separate_overlaps", "separate_touching", "square_angle", "straight_angle", "with_charts",
]  # fmt: skip
