"""The options of quads: their own, and those of a flattening that make sense for them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from ...options import (
    ANGLE,
    ANGLE_OR_NONE,
    COUNT,
    Choice,
    ConeBounds,
    ConeNumber,
    Number,
    RunOptions,
    WordOrVertices,
    option,
    strength,
)

#: Where nothing else is said: how many quads, and rounds of smoothing, of which more change little.
QUADS, ROUNDS = 10_000, 10


@dataclass(frozen=True, kw_only=True)
class QuadOptions(ConeNumber, ConeBounds, RunOptions):
    """Quads.

    What is not here, or has another default, is what quads need of a flattening: `OPTIONS` of `integer_grid`.

    Attributes:
        quads: About how many quads; 10,000 unless a size is given.
        size: The length of their edges in model units, instead.
        stretch: What quads are to be alike in: from angles, 0, to sizes as well, 1.
        smooth: Rounds of smoothing on the surface; 0 for none.
        sharp_angle: Edges at which the surface bends by more lie on grid lines, and the boundary with them: quads run
            along them.
        cones: auto: the search finds them. Or vertices, each with its curvature, a multiple of pi/2: pi/2 for three
            quads, -pi/2 for five. On surfaces with handles few that are given have a grid.
        boundary: straight: it lies on grid lines, between corners that the search finds like cones, and no square is
            lost. free: it runs across squares, and those that it cuts are left out. auto: straight where such a grid is
            found, unless cones are given.
        min_cone_angle: The sharpest cone, pi/2 for each quad at it; with straight sides it is pi/2, one quad, at
            corners.
        max_cone_angle: The widest saddle; 3pi is six quads.
        max_cones: The search stops at so many cones per component.
    """

    quads: int | None = option(None, COUNT)
    size: float | None = option(None, Number(is_positive=True, optional=True))
    stretch: float = option(0.0, strength(1))
    smooth: int = option(ROUNDS, COUNT)
    sharp_angle: float | None = option(None, ANGLE_OR_NONE)
    cones: str | Mapping[int, float] = option("auto", WordOrVertices(("auto",), "cone"), one_mesh=True)
    boundary: str = option("auto", Choice(("auto", "straight", "free")))
    min_cone_angle: float = option(1.5 * math.pi, ANGLE)
    max_cone_angle: float | None = option(3 * math.pi, ANGLE_OR_NONE)
    max_cones: int | None = option(None, COUNT)
