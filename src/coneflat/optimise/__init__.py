"""A solver that reduces the distortion of a layout while the sides of seams stay rigid copies of each other."""

from .elements import ElementPattern
from .energies import StretchEnergy
from .free_seams import embedded_disks, relaxed_disks, untangle_seams, untangled_disk
from .relaxed_layouts import relax_layouts
from .relaxing import Relaxed, relax
from .restrictions import Lines, PointConstraints, SeamChains, find_chains

__all__ = [
    "ElementPattern",
    "Lines",
    "PointConstraints",
    "Relaxed",
    "SeamChains",
    "StretchEnergy",
    "embedded_disks",
    "find_chains",
    "relax",
    "relaxed_disks",
    "relax_layouts",
    "untangle_seams",
    "untangled_disk",
]
