"""Cones of a connected mesh by the requested strategy."""

from __future__ import annotations

from collections.abc import Callable

from ..base.progress import stage
from ..stages import ConeSolution, ConeSpec
from .strategies.auto import place_automatically
from .strategies.greedy import place_greedy
from .strategies.none import place_none
from .strategies.prescribed import place_prescribed
from .strategies.sparse import place_sparse
from .surface import ConeSurface

#: The function that places the cones of each strategy.
STRATEGIES: dict[str, Callable[[ConeSurface, ConeSpec], ConeSolution]] = {
    "auto": place_automatically,
    "sparse": place_sparse,
    "greedy": place_greedy,
    "prescribed": place_prescribed,
    "none": place_none,
}


@stage("cones")
def find_cones(surface: ConeSurface, spec: ConeSpec) -> ConeSolution:
    """Return cones with their curvatures and linear log conformal factor.

    Args:
        surface: the connected mesh with its operators.
        spec: what is required of the cones.

    Raises:
        CurvatureError: no metric has the required curvatures.

    See Also:
        greedy_cones: the search of the paper.
        ConeSearch: the fewest cones for an area distortion.
        fitted_cones: the best curvatures of given cones.
    """
    return STRATEGIES[spec.strategy](surface, spec)
