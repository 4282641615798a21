"""Charts in the plane: splitting and gluing them, orienting them, and packing them into a texture."""

from .around import Moves, pack_around, similarities
from .border_runs import border_curves
from .charts import ChartLayout, Charts, Outlines, Seams
from .injective import injective_charts, separate_overlaps, with_charts
from .masks import rotated_boxes
from .pack import Frame, Packed, arrange_charts, pack_charts, turns_of_quantum
from .page_grid import PageGrid, pack_page_grid
from .rectangles import square_angle, straight_angle
from .split import as_disk, filled_disk
from .strips import SheetPacking, pack_sheets, pack_strip
from .tight_packing import Effort, pack_outlines
from .touch import round_safely, separate_touching

__all__ = [
    "ChartLayout", "Charts", "Effort", "Frame", "Moves", "Outlines", "Packed", "PageGrid", "Seams", "SheetPacking",
    "arrange_charts", "as_disk", "border_curves", "filled_disk", "injective_charts", "pack_around", "pack_charts",
    "pack_outlines", "pack_page_grid", "pack_sheets", "pack_strip", "rotated_boxes", "round_safely",
    "separate_overlaps", "separate_touching", "similarities", "square_angle", "straight_angle", "turns_of_quantum",
    "with_charts",
]  # fmt: skip
