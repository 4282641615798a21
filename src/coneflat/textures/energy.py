"""The bound of the distortion of a component, as an energy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base import FloatArray
from ..geometry import double_areas, signed_double_areas, triangle_energies
from ..stages import Layout
from .options import ENERGY_PER_AREA, ISOMETRIC


@dataclass(frozen=True)
class EnergyBound:
    """The bound of the energy of a layout with free seams, averaged by area.

    Attributes:
        largest: the largest energy; infinite for no seams but those that are necessary.
        by_area: whether the energy is the one that belongs to an area distortion, see `ENERGY_PER_AREA`, instead of the
            symmetric Dirichlet energy.

    Notes:
        The symmetric Dirichlet energy of a triangle with singular values s and t is s^2 + t^2 + 1 / s^2 + 1 / t^2. For
        an area distortion it is 4 + 20 u^2, where u is the log conformal factor that the areas have, about half the
        logarithm of their ratio.

    References:
        J. Smith, S. Schaefer, "Bijective parameterization with free boundaries", 2015.
    """

    largest: float
    by_area: bool = False

    @property
    def is_finite(self) -> bool:
        """Whether there is a bound."""
        return bool(np.isfinite(self.largest))

    @property
    def allowed(self) -> float:
        """What is allowed above the energy of an isometry."""
        return self.largest - ISOMETRIC

    def plus(self, share: float) -> float:
        """Return the energy above the bound by a share of what is allowed above that of an isometry."""
        return self.largest + share * self.allowed

    def energies(self, lengths: FloatArray, places: FloatArray) -> FloatArray:
        """Return (m,) the energies of triangles multiplied by their areas.

        Args:
            lengths: (m, 3) side lengths.
            places: (m, 3, 2) corners in the plane.
        """
        if not self.by_area:
            return triangle_energies(lengths, places)
        areas, flat = double_areas(lengths), signed_double_areas(places)
        return (ISOMETRIC + ENERGY_PER_AREA * np.log(flat / areas) ** 2 / 4) * areas / 2

    def energy(self, layout: Layout) -> float:
        """Return the energy of a layout."""
        return float(self.energies(layout.lengths, layout.points[layout.corners]).sum() / layout.area)
