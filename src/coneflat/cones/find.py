"""Cones of a connected mesh by the requested strategy."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from ..base.progress import stage
from ..stages import ConeSolution, ConeSpec
from .strategies.auto import place_automatically
from .strategies.greedy import place_greedy
from .strategies.none import place_none
from .strategies.prescribed import place_prescribed
from .strategies.sparse import place_sparse
from .surface import ConeSurface


class Strategy(NamedTuple):
    """A strategy for cones.

    Attributes:
        place: returns the cones of a surface.
        leaves_flat_disks: a flat disk gets no cones unless options name some. Flat disks are then laid out together,
            without a search.
    """

    place: Callable[[ConeSurface, ConeSpec], ConeSolution]
    leaves_flat_disks: bool = True


STRATEGIES = {
    "auto": Strategy(place_automatically),
    "sparse": Strategy(place_sparse),
    "greedy": Strategy(place_greedy, leaves_flat_disks=False),
    "prescribed": Strategy(place_prescribed),
    "none": Strategy(place_none),
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
    return STRATEGIES[spec.strategy].place(surface, spec)


def leaves_flat_disks(spec: ConeSpec) -> bool:
    """Return whether a flat disk gets no cones: none are requested, and its boundary is free."""
    has_shape = spec.prescribes_boundary or spec.searches_corners
    has_requests = (
        len(spec.prescribed) or len(spec.required) or spec.count is not None or spec.quantum is not None
    )
    return STRATEGIES[spec.strategy].leaves_flat_disks and not has_shape and not has_requests
