"""Pure functions of edge lengths: angles, areas, curvature, Laplacian."""

from .operators import angle_defect, cotangent_laplacian
from .triangles import corner_angles, cotangents, double_areas, edge_lengths, is_broken, mollify

__all__ = [
    "angle_defect",
    "corner_angles",
    "cotangent_laplacian",
    "cotangents",
    "double_areas",
    "edge_lengths",
    "is_broken",
    "mollify",
]
