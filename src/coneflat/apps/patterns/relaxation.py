"""Layouts with the least strain that was found, in a material that is alike in all directions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...errors import MetricError
from .cut_surface import CutSurface
from .strain import EXPONENTS, Stretch, least_strain, with_equal_sides

# The strain for which layouts are evened out first; then its largest value is minimised.
FIRST_STRAIN, FIRST_EXPONENTS = 0.05, (2, 4)
# Strain below which a layout counts as exact: it is not changed.
EXACT = 1e-7


def relaxed(surface: CutSurface) -> CutSurface:
    """Return a surface in the plane with a small largest strain, and both sides of every seam equally long.

    Where they could not be made equally long, they are not, which the pattern says.

    Args:
        surface: the surface, without flipped triangles.
    """
    if _largest_strain(surface) <= EXACT:
        return surface
    surface = _relaxed_for(surface, FIRST_STRAIN, FIRST_EXPONENTS)
    strain = _largest_strain(surface)
    if strain > EXACT:
        surface = _relaxed_for(surface, strain)
    try:
        points = with_equal_sides(surface.edges, surface.corners, surface.points)
    except MetricError:
        return surface
    return replace(surface, points=points)


def _largest_strain(surface: CutSurface) -> float:
    return float(np.abs(surface.edges.strains(surface.points)).max())


def _relaxed_for(surface: CutSurface, strain: float, exponents: tuple[int, ...] = EXPONENTS) -> CutSurface:
    stretch = Stretch(strain, strain)
    points = least_strain(surface.edges, surface.corners, surface.points, stretch, exponents=exponents)
    return replace(surface, points=points)
