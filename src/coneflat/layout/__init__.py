"""Layout of a flat metric on a disk as points in the plane."""

from .flat_disks import lay_out_flat_disks
from .lay_out import lay_out
from .least_squares import far_pins, least_squares_layout, pinned_least_squares
from .relax import Lines, PointConstraints, Relaxed, StretchEnergy, relax
from .relax.relax import rest_sides
from .relax.seam_chains import SeamChains, find_chains
from .relax_layouts import joined, mean_qc, relax_layouts
from .unfold import closed_chain, unfold
from .untangle_seams import embedded_disks, untangle_seams, untangled_disk

__all__ = [
    "Lines", "PointConstraints", "Relaxed", "SeamChains", "StretchEnergy", "closed_chain", "embedded_disks", "far_pins",
    "find_chains", "joined", "lay_out", "lay_out_flat_disks", "least_squares_layout", "mean_qc", "pinned_least_squares",
    "relax",     "relax_layouts", "rest_sides", "unfold", "untangle_seams", "untangled_disk",
]  # fmt: skip
