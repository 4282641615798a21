"""Where the curvature goes: cone placement and target curvatures, a file per strategy."""

from .given import cones_at, cones_with_curvature
from .greedy import greedy_cones
from .solution import ConeSolution, check_enough, check_feasible

__all__ = [
    "ConeSolution",
    "check_enough",
    "check_feasible",
    "cones_at",
    "cones_with_curvature",
    "greedy_cones",
]
