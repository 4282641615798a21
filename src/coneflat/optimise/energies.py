"""Energies of a triangle's map, given by its singular values."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Real
from typing import ClassVar, NamedTuple, Protocol

import numpy as np

from ..base.arrays import FloatArray
from ..errors import OptionError


class Derivatives(NamedTuple):
    """An energy and its derivatives by the singular values s1 >= s2 > 0 of each map, (f,) each."""

    value: FloatArray
    by_1: FloatArray
    by_2: FloatArray
    by_11: FloatArray
    by_12: FloatArray
    by_22: FloatArray


class Energy(Protocol):
    """The energy of a triangle's map per area.

    It must be symmetric in the singular values, smooth for s1, s2 > 0, and grow without bound as s1 s2 goes to 0,
    unless it is regularised: finite and smooth for flipped triangles, too, whose smaller singular value is negative.
    """

    @property
    def is_regularised(self) -> bool:
        """Return whether the energy of flipped triangles is finite."""
        ...

    @property
    def minimum(self) -> float:
        """Return the minimum of the energy."""
        ...

    def values(self, s1: FloatArray, s2: FloatArray) -> FloatArray:
        """Return (f,) the energy at singular values (f,) each, both positive."""
        ...

    def derivatives(self, s1: FloatArray, s2: FloatArray) -> Derivatives:
        """Return the energy and its derivatives."""
        ...


@dataclass(frozen=True)
class StretchEnergy:
    """Energy of angles and areas: (M A^stretch)^sharpness, M = (s1/s2 + s2/s1) / 2 and A = (s1 s2 + 1/(s1 s2)) / 2.

    Attributes:
        stretch: from 0, which measures angles alone (MIPS: Hormann and Greiner 2000), to 1, which is the symmetric
            Dirichlet energy, minimal for isometries (Smith and Schaefer 2015). Larger values increase the weight of
            areas further.
        sharpness: 1 or more; larger values increase the weight of the worst triangles.

    Raises:
        OptionError: `stretch` is negative, `sharpness` is below 1, or one of them is not finite.

    Notes:
        P. Degener, J. Meseth, R. Klein, "An adaptable surface parametrization method", 2003.
    """

    stretch: float = 0.0
    sharpness: float = 1.0

    def __post_init__(self) -> None:
        if not (isinstance(self.stretch, Real) and np.isfinite(self.stretch) and self.stretch >= 0):
            raise OptionError(f"stretch must be a number, 0 or more, got {self.stretch!r}")
        if not (isinstance(self.sharpness, Real) and np.isfinite(self.sharpness) and self.sharpness >= 1):
            raise OptionError(f"sharpness must be a number, 1 or more, got {self.sharpness!r}")

    is_regularised: ClassVar[bool] = False
    #: The minimum of the energy, for isometries.
    minimum: ClassVar[float] = 1.0

    def values(self, s1: FloatArray, s2: FloatArray) -> FloatArray:
        """Return (f,) the energy at singular values (f,) each, both positive."""
        result: FloatArray = (s1 / s2 + s2 / s1) / 2
        if self.stretch != 0:
            area = s1 * s2
            result = result * ((area + 1 / area) / 2) ** self.stretch
        return result if self.sharpness == 1 else result**self.sharpness

    @np.errstate(all="ignore")  # triangles that are flipped by rounding; a step is not finite then
    def derivatives(self, s1: FloatArray, s2: FloatArray) -> Derivatives:
        """Return the energy and its derivatives."""
        ratio, inverse = s1 / s2, s2 / s1
        angle = Derivatives(
            (ratio + inverse) / 2,
            (1 - inverse**2) / (2 * s2),
            (1 - ratio**2) / (2 * s1),
            inverse / s1**2,
            -(1 / s2**2 + 1 / s1**2) / 2,
            ratio / s2**2,
        )
        product = angle if self.stretch == 0 else _product(angle, self._area(s1, s2))
        return product if self.sharpness == 1 else _power(product, self.sharpness)

    def _area(self, s1: FloatArray, s2: FloatArray) -> Derivatives:
        """Return A^stretch and its derivatives."""
        area = s1 * s2
        mean = (area + 1 / area) / 2
        power = mean**self.stretch
        slope, bend = (1 - area**-2) / 2, area**-3  # of A, by the area
        first = self.stretch * power / mean * slope
        second = self.stretch * power / mean * ((self.stretch - 1) / mean * slope**2 + bend)
        return Derivatives(
            power, first * s2, first * s1, second * s2**2, second * area + first, second * s1**2
        )


@dataclass(frozen=True, eq=False)
class UntanglingEnergy:
    """Regularised energy (N + (1 + D^2) / 2) / p with N = (s1^2 + s2^2) / 2 and the determinant D = s1 s2.

    The denominator p = (D + sqrt(epsilon^2 + D^2)) / 2 is positive, and about D for unflipped triangles.

    Attributes:
        epsilon: (f,) regularisation of the determinant of each triangle, positive.

    Notes:
        V. Garanzha et al., "Foldover-free maps in 50 lines of code", 2021.
    """

    epsilon: FloatArray
    is_regularised: ClassVar[bool] = True
    minimum: ClassVar[float] = 0.0

    def values(self, s1: FloatArray, s2: FloatArray) -> FloatArray:
        """Return (f,) the energy at singular values (f,) each."""
        return self._parts(s1, s2)[3]

    def derivatives(self, s1: FloatArray, s2: FloatArray) -> Derivatives:
        """Return the energy and its derivatives."""
        det, root, p, energy = self._parts(s1, s2)
        by_norm, by_det, mixed = 1 / p, det / p - energy / root, -1 / (p * root)
        by_det_twice = 1 / p - det / (p * root) - by_det / root + energy * det / root**3
        return Derivatives(
            energy,
            by_norm * s1 + by_det * s2,
            by_norm * s2 + by_det * s1,
            by_norm + 2 * mixed * det + by_det_twice * s2**2,
            by_det + mixed * (s1**2 + s2**2) + by_det_twice * det,
            by_norm + 2 * mixed * det + by_det_twice * s1**2,
        )

    def _parts(self, s1: FloatArray, s2: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return D, sqrt(epsilon^2 + D^2), p and the energy."""
        det = s1 * s2
        root: FloatArray = np.hypot(self.epsilon, det)
        # Without cancellation where the determinant is negative.
        p = np.where(det > 0, (det + root) / 2, self.epsilon**2 / (2 * (root + np.abs(det))))
        return det, root, p, ((s1**2 + s2**2) / 2 + (1 + det**2) / 2) / p


def _product(f: Derivatives, g: Derivatives) -> Derivatives:
    return Derivatives(
        f.value * g.value,
        f.by_1 * g.value + f.value * g.by_1,
        f.by_2 * g.value + f.value * g.by_2,
        f.by_11 * g.value + 2 * f.by_1 * g.by_1 + f.value * g.by_11,
        f.by_12 * g.value + f.by_1 * g.by_2 + f.by_2 * g.by_1 + f.value * g.by_12,
        f.by_22 * g.value + 2 * f.by_2 * g.by_2 + f.value * g.by_22,
    )


def _power(f: Derivatives, exponent: float) -> Derivatives:
    slope = exponent * f.value ** (exponent - 1)
    bend = (exponent - 1) * slope / f.value
    return Derivatives(
        f.value**exponent,
        slope * f.by_1,
        slope * f.by_2,
        slope * f.by_11 + bend * f.by_1**2,
        slope * f.by_12 + bend * f.by_1 * f.by_2,
        slope * f.by_22 + bend * f.by_2**2,
    )
