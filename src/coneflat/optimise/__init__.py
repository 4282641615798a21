"""A solver that reduces the distortion of a layout while the sides of seams stay rigid copies of each other."""

from .constraints import Lines, PointConstraints
from .energies import StretchEnergy
from .free_seams import embedded_disks, relaxed_disks, untangled_disk
from .relaxed_layouts import joined, mean_qc, relax_layouts
from .relaxing import Relaxed, relax, rest_sides
from .seam_chains import SeamChains, find_chains
from .seam_untangling import untangle_seams

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
    "relaxed_disks",
    "relax_layouts",
    "rest_sides",
    "untangle_seams",
    "untangled_disk",
]
