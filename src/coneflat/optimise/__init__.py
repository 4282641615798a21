"""A solver that reduces the distortion of a layout while the sides of seams stay rigid copies of each other."""

from .constraints import Lines, PointConstraints
from .energies import StretchEnergy
from .relaxed_layouts import joined, mean_qc, relax_layouts
from .relaxing import Relaxed, relax, rest_sides
from .seam_chains import SeamChains, find_chains
from .seam_untangling import embedded_disks, untangle_seams, untangled_disk

__all__ = [
    "Lines",
    "PointConstraints",
    "Relaxed",
    "SeamChains",
    "StretchEnergy",
    "embedded_disks",
    "find_chains",
    "joined",
    "mean_qc",
    "relax",
    "relax_layouts",
    "rest_sides",
    "untangle_seams",
    "untangled_disk",
]
