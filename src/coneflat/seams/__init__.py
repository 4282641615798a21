"""Seams that cut a surface open to a disk, with holes or without, with every cone on its border."""

from .costs import edge_costs, seam_costs
from .tree import NO_EDGES, TIE_BREAK, cut_to_disk, find_seams, without_loose_ends

__all__ = [
    "NO_EDGES",
    "TIE_BREAK",
    "cut_to_disk",
    "edge_costs",
    "find_seams",
    "seam_costs",
    "without_loose_ends",
]
