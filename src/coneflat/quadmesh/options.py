"""Options of quads: their own, and the options of a flattening that apply to them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Real
from typing import TYPE_CHECKING, Any, ClassVar

from ..errors import OptionError
from ..options import (
    ANGLE,
    ANGLE_OR_NONE,
    COUNT,
    Choice,
    ConeBounds,
    ConeNumber,
    Flag,
    Number,
    RunOptions,
    WordOrVertices,
    option,
    strength,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

#: Default number of quads.
QUADS = 10_000
#: Default bound of the area distortion of the map before areas are evened: those of 90% of the quads then differ by a
#: factor of two.
DISTORTION = 0.13
#: Tolerance, in radians or squares, for sides to be straight or parallel up to quarter turns, and for points to
#: coincide: far above rounding, far below relevant differences.
GRID_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Sizes(Number):
    """A length; or relative sizes at the vertices, which are checked with the mesh."""

    metavar: ClassVar[str] = "LENGTH|curvature|NAME|FILE"

    def parse(self, name: str, value: Any) -> Any:
        return super().parse(name, value) if isinstance(value, Real) else value

    @property
    def text(self) -> str:
        return f"{super().text}, `curvature`, numbers or the name of a vertex property"


@dataclass(frozen=True, kw_only=True)
class QuadOptions(ConeNumber, ConeBounds, RunOptions):
    """Quads.

    Options that are fixed for a grid, and defaults that differ from those of `flatten`, are in `FLATTENING_OPTIONS`.

    Attributes:
        quads: Approximate number of quads; 10,000 unless size is given.
        size: Length of the edges of quads in model units, which replaces quads. Or relative sizes at the vertices;
            curvature makes quads smaller where the surface is more curved.
        stretch: Trade-off between equal angles (0) and also equal sizes (1) of quads.
        loops: Prefer grid lines from irregular vertices that soon end at others: shorter loops and edge rings, and
            fewer patches, for larger angle deviations.
        smooth: Rounds of smoothing on the surface; 0 for none.
        symmetry: auto: quads of a surface with a plane of symmetry are symmetric, too. none: they need not be.
        sharp_angle: Put edges with a larger dihedral angle, and the boundary, on grid lines, so that edges of quads
            follow them.
        cones: auto: cones for which quads have even sizes and follow sharp edges, the boundary and directions of
            curvature. sparse: the fewest for the distortion allowed. Or vertices, each with its curvature, a multiple
            of pi/2: pi/2 for three quads, -pi/2 for five.
        boundary: straight: the boundary lies on grid lines, between corners that the search finds together with the
            cones. free: the boundary cuts squares, which a layer of quads along it replaces. auto: straight if such a
            grid is found and cones are not given, else free.
        min_cone_angle: Smallest cone angle, pi/2 for each quad at the cone; with a straight boundary it is pi/2, one
            quad, at corners.
        max_cone_angle: Largest cone angle; 3pi is six quads.
        distortion: Variation of the sizes of quads: the standard deviation of the log of their edges that should not be
            exceeded. A larger value needs fewer irregular vertices.
        max_cones: Largest number of cones per component, at which the search stops.
    """

    distortion: float = option(DISTORTION, Number(is_positive=True))
    quads: int | None = option(None, Number(1, is_integer=True, optional=True))
    size: ArrayLike | None = option(None, Sizes(is_positive=True, optional=True))
    stretch: float = option(0.3, strength(1))
    loops: bool = option(False, Flag())
    # Further rounds change little.
    smooth: int = option(10, Number(0, is_integer=True))
    symmetry: str = option("auto", Choice(("auto", "none")))
    sharp_angle: float | None = option(None, ANGLE_OR_NONE)
    cones: str | Mapping[int, float] = option(
        "auto", WordOrVertices(("auto", "sparse"), "cone"), one_mesh=True
    )
    boundary: str = option("auto", Choice(("auto", "straight", "free")))
    min_cone_angle: float = option(1.5 * math.pi, ANGLE)
    max_cone_angle: float | None = option(3 * math.pi, ANGLE_OR_NONE)
    max_cones: int | None = option(None, COUNT)


#: Options of the flattening for a grid: three, five or six quads at a cone, and rotations by quarter turns.
FLATTENING_OPTIONS = {
    "quantise": math.pi / 2,
    "correct_handles": True,
    "charts": "one",
    "distortion": DISTORTION,
    "min_cone_angle": QuadOptions.min_cone_angle,
    "max_cone_angle": QuadOptions.max_cone_angle,
}


def flattening_defaults(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the default options of the flattening for a grid; given cones are not searched for.

    Raises:
        OptionError: curvatures of given cones are not multiples of pi/2.
    """
    cones = options.get("cones", "auto")
    # With straight sides, bounds of cone angles apply to the double of the surface, two copies glued along the
    # boundary, where a corner of pi/2 is a cone of pi.
    if isinstance(cones, str):
        corners = {"min_cone_angle": math.pi / 2} if str(options.get("boundary")) == "straight" else {}
        return FLATTENING_OPTIONS | corners
    parsed = WordOrVertices((), "cone").parse("cones", cones)
    for vertex, curvature in parsed.items() if isinstance(parsed, dict) else ():
        if curvature is None or not abs(math.remainder(curvature, math.pi / 2)) <= GRID_TOLERANCE:
            raise OptionError(
                f"cones of a grid must have curvatures that are multiples of pi/2; that of vertex {vertex} is "
                f"{'not given' if curvature is None else f'{curvature:g}'}"
            )
    return {"charts": "one", "quantise": math.pi / 2, "correct_handles": True}
