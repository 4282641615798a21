"""Layout of a flat metric on a disk as points in the plane."""

from .lay_out import lay_out
from .least_squares import far_pins, fit_shapes, least_squares_layout, pinned_least_squares, shapes_of_angles
from .relax import Lines, PointConstraints, Relaxed, StretchEnergy, relax
from .relax.relax import rest_sides
from .relax.seam_chains import SeamChains, find_chains
from .relax_layouts import relax_layouts
from .unfold import closed_chain, unfold
from .untangle_seams import untangle_seams

__all__ = [
    "Lines",
    "PointConstraints",
    "Relaxed",
    "SeamChains",
    "StretchEnergy",
    "closed_chain",
    "far_pins",
    "find_chains",
    "fit_shapes",
    "untangle_seams",
    "lay_out",
    "least_squares_layout",
    "pinned_least_squares",
    "relax",
    "relax_layouts",
    "rest_sides",
    "shapes_of_angles",
    "unfold",
]
