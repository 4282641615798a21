"""Cone placement and target curvatures, one file per strategy."""

from .corners import MAX_POLYHEDRON_CORNERS, with_corners
from .find import find_cones, leaves_flat_disks
from .greedy import greedy_cones
from .prescribed import cones_at, cones_with_curvature
from .solution import GroundedLaplacian
from .sparse import ConeSearch, SparseCones
from .sparse.limits import CONE_ANGLE_PER_TRIANGLE, MAX_SEARCHED
from .strategies.auto import uses_sparse_search
from .strategies.none import coneless_solution
from .strategies.sparse import unmet_requests
from .surface import ConeSurface

__all__ = [
    "CONE_ANGLE_PER_TRIANGLE", "ConeSearch", "ConeSurface", "GroundedLaplacian", "MAX_POLYHEDRON_CORNERS",
    "MAX_SEARCHED", "SparseCones", "coneless_solution", "cones_at", "cones_with_curvature", "find_cones",
    "greedy_cones", "leaves_flat_disks", "unmet_requests", "uses_sparse_search", "with_corners",
]  # fmt: skip
