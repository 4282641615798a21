"""Charts in the plane: splitting and gluing them, orienting them, and packing them into a texture."""

from .border_runs import border_curves
from .charts import ChartLayout, Outlines, Seams
from .injective import separate_overlaps, with_charts
from .pack import Packed, arrange_charts, pack_charts
from .rectangles import square_angle, straight_angle
from .split import as_disk, filled_disk
from .tight_packing import Effort, pack_outlines
from .touch import round_safely, separate_touching

__all__ = [
    "ChartLayout", "Effort", "Outlines", "Packed", "Seams", "arrange_charts", "as_disk", "border_curves",
    "filled_disk", "pack_charts", "pack_outlines", "round_safely", "separate_overlaps", "separate_touching",
    "square_angle", "straight_angle", "with_charts",
]  # fmt: skip
