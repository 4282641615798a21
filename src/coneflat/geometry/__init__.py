"""Geometry: lengths, angles, areas, Laplacian, intrinsic triangulations, exact predicates, overlaps, visibility."""

from .coarsen import coarse_mesh
from .coverage import approximate_overlap_areas
from .handles import handle_loops
from .intrinsic import halfedge_twins
from .layers import MAX_CELLS
from .nearest import TriangleTree, surface_distances
from .opening import mollify
from .operators import angle_defect, cotangent_laplacian
from .orientation import fill_orientations, orientation
from .overlap import Overlaps, find_overlaps
from .planar import (
    as_complex,
    as_pairs,
    complex_sums,
    layout_curvature,
    map_factors,
    mean_energy,
    qc_distortion,
    sides_between,
    signed_angles,
    signed_double_areas,
    triangle_energies,
    vertex_log_scale,
)
from .quarter_turns import TURNS, UNITS, quarters_around, rotated, turn
from .straight import FlatTriangles, flat_triangles, rest_sides
from .triangles import (
    CREASE_COSINE,
    corner_angles,
    corner_normals,
    cotangents,
    dihedral_angles,
    double_areas,
    edge_lengths,
    face_normals,
    is_broken,
    unit_vectors,
    vertex_normals,
)
from .upward import rotated_up
from .visibility import fill_nearest, visible_share

__all__ = [
    "CREASE_COSINE", "FlatTriangles", "MAX_CELLS", "Overlaps", "TURNS", "TriangleTree", "UNITS", "angle_defect",
    "as_complex", "as_pairs", "coarse_mesh", "complex_sums", "corner_angles", "corner_normals", "cotangent_laplacian",
    "cotangents", "dihedral_angles", "double_areas", "edge_lengths", "face_normals", "fill_nearest",
    "fill_orientations", "find_overlaps", "flat_triangles", "handle_loops", "halfedge_twins", "is_broken",
    "approximate_overlap_areas", "layout_curvature", "map_factors", "mean_energy", "mollify", "orientation",
    "qc_distortion", "quarters_around", "rest_sides", "rotated", "rotated_up", "sides_between", "signed_angles",
    "signed_double_areas", "surface_distances", "triangle_energies", "turn", "unit_vectors",
    "vertex_log_scale", "vertex_normals", "visible_share",
]  # fmt: skip
