"""Cone placement and target curvatures, one file per strategy."""

from .corners import MAX_POLYHEDRON_CORNERS, with_corners
from .find import (
    CONE_ANGLE_PER_TRIANGLE,
    close_search,
    coneless_solution,
    find_cones,
    leaves_flat_disks,
    open_search,
    unmet_requests,
    uses_sparse_search,
)
from .greedy import greedy_cones
from .prescribed import cones_at, cones_with_curvature
from .solution import GroundedLaplacian
from .sparse import SparseCones
from .sparse.limits import MAX_SEARCHED
from .sparse.search import ConeSearch

__all__ = [
    "ConeSearch", "GroundedLaplacian", "CONE_ANGLE_PER_TRIANGLE", "MAX_POLYHEDRON_CORNERS",
    "MAX_SEARCHED", "SparseCones", "close_search", "cones_at", "cones_with_curvature", "find_cones", "greedy_cones",
    "coneless_solution", "leaves_flat_disks", "open_search", "unmet_requests", "uses_sparse_search",
    "with_corners",
]  # fmt: skip
