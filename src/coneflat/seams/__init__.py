"""Where to cut: seams that open a surface to a disk with every cone on its border."""

from .costs import detail_factors, edge_costs
from .cut import CutMesh, cut_open, open_along
from .find import find_seams
from .mirrored import mirrored_seams

__all__ = [
    "CutMesh",
    "cut_open",
    "detail_factors",
    "edge_costs",
    "find_seams",
    "mirrored_seams",
    "open_along",
]
