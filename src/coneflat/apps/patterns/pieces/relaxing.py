"""Cut surfaces with less strain, and how far they are beyond a bound."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from ....base import BoolArray, FloatArray
from ....errors import MetricError
from .cut_surface import CutSurface
from .equal_sides import with_equal_sides
from .least_strain import EXPONENTS, least_strain
from .strain import Stretch, relative_strains

#: Exponents of the strain: of layouts in which it is moderately even, and then for the smallest largest one.
EVEN, SMALLEST = (2, 4), (8, 16, 32)
# The strain for which layouts without a bound are made even first; then its largest value is minimised.
FIRST_STRAIN = 0.05
# Strain below which a layout counts as exact: it is not changed.
EXACT = 1e-7
# Excess of the relative strain that is left to rounding.
ROUNDING = 1e-9
# The strain that layouts aim at, relative to the bound: making the sides of seams equally long adds a little.
AIM = 0.99


def relaxed(
    surface: CutSurface,
    stretch: Stretch,
    exponents: Sequence[int],
    is_free: BoolArray | None = None,
    until_within: bool = False,
) -> CutSurface:
    """Return a cut surface with less strain; arguments as of `least_strain`."""
    aim = Stretch(AIM * stretch.warp, AIM * stretch.weft)
    points = least_strain(
        surface.edges, surface.corners, surface.points, aim, tuple(exponents), is_free, until_within
    )
    return surface.with_points(points)


def least_strained(surface: CutSurface) -> CutSurface:
    """Return a cut surface with a small largest strain, the same in all directions, and equal sides of seams."""
    if _largest_strain(surface) <= EXACT:
        return surface
    surface = relaxed(surface, Stretch(FIRST_STRAIN, FIRST_STRAIN), EVEN)
    strain = _largest_strain(surface)
    if strain > EXACT:
        surface = relaxed(surface, Stretch(strain, strain), EXPONENTS)
    return closed_seams(surface)


def _largest_strain(surface: CutSurface) -> float:
    return float(np.abs(surface.edges.strains(surface.points)).max())


def closed_seams(surface: CutSurface, is_free: BoolArray | None = None) -> CutSurface:
    """Return a surface whose seams have sides of the same length; where that is impossible, they are eased.

    is_free: (n,) the points at which they may differ, which are moved if that is enough; None for all.
    """
    for is_moved in [is_free, None] if is_free is not None else [None]:
        with suppress(MetricError):
            points = with_equal_sides(surface.edges, surface.corners, surface.points, is_moved)
            return surface.with_points(points)
    return surface


def excess(surface: CutSurface, stretch: Stretch) -> FloatArray:
    """Return (k,) how far the relative strain of each flat edge is beyond the bound, 0 within it."""
    strains = np.abs(relative_strains(surface.edges, surface.points, stretch))
    return np.where(strains > 1 + ROUNDING, strains - 1, 0.0)
