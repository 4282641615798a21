"""Layout of a flat metric on a disk as points in the plane."""

from ..geometry.unfolding import closed_chain, unfold
from .flat_disks import NEARLY_FLAT, is_flat_inside, lay_out_flat_disks
from .laying_out import lay_out
from .least_squares import far_pins, least_squares_layout, pinned_least_squares

__all__ = [
    "NEARLY_FLAT",
    "closed_chain",
    "far_pins",
    "is_flat_inside",
    "lay_out",
    "lay_out_flat_disks",
    "least_squares_layout",
    "pinned_least_squares",
    "unfold",
]
