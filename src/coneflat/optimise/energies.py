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
    one: FloatArray
    two: FloatArray
    one_one: FloatArray
    one_two: FloatArray
    two_two: FloatArray


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
    def least(self) -> float:
        """Return the minimum of the energy."""
        ...

    def values(self, one: FloatArray, two: FloatArray) -> FloatArray:
        """Return (f,) the energy at singular values (f,) each, both positive."""
        ...

    def derivatives(self, one: FloatArray, two: FloatArray) -> Derivatives:
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
    least: ClassVar[float] = 1.0

    def values(self, one: FloatArray, two: FloatArray) -> FloatArray:
        """Return (f,) the energy at singular values (f,) each, both positive."""
        result: FloatArray = (one / two + two / one) / 2
        if self.stretch != 0:
            area = one * two
            result = result * ((area + 1 / area) / 2) ** self.stretch
        return result if self.sharpness == 1 else result**self.sharpness

    @np.errstate(all="ignore")  # triangles that are flipped by rounding; a step is not finite then
    def derivatives(self, one: FloatArray, two: FloatArray) -> Derivatives:
        """Return the energy and its derivatives."""
        ratio, inverse = one / two, two / one
        angle = Derivatives(
            (ratio + inverse) / 2,
            (1 - inverse**2) / (2 * two),
            (1 - ratio**2) / (2 * one),
            inverse / one**2,
            -(1 / two**2 + 1 / one**2) / 2,
            ratio / two**2,
        )
        product = angle if self.stretch == 0 else _product(angle, self._area(one, two))
        return product if self.sharpness == 1 else _power(product, self.sharpness)

    def _area(self, one: FloatArray, two: FloatArray) -> Derivatives:
        """Return A^stretch and its derivatives."""
        area = one * two
        mean = (area + 1 / area) / 2
        power = mean**self.stretch
        slope, bend = (1 - area**-2) / 2, area**-3  # of A, by the area
        first = self.stretch * power / mean * slope
        second = self.stretch * power / mean * ((self.stretch - 1) / mean * slope**2 + bend)
        return Derivatives(
            power, first * two, first * one, second * two**2, second * area + first, second * one**2
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
    least: ClassVar[float] = 0.0

    def values(self, one: FloatArray, two: FloatArray) -> FloatArray:
        """Return (f,) the energy at singular values (f,) each."""
        return self._parts(one, two)[3]

    def derivatives(self, one: FloatArray, two: FloatArray) -> Derivatives:
        """Return the energy and its derivatives."""
        det, root, p, energy = self._parts(one, two)
        by_norm, by_det, mixed = 1 / p, det / p - energy / root, -1 / (p * root)
        twice = 1 / p - det / (p * root) - by_det / root + energy * det / root**3
        return Derivatives(
            energy,
            by_norm * one + by_det * two,
            by_norm * two + by_det * one,
            by_norm + 2 * mixed * det + twice * two**2,
            by_det + mixed * (one**2 + two**2) + twice * det,
            by_norm + 2 * mixed * det + twice * one**2,
        )

    def _parts(
        self, one: FloatArray, two: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return D, sqrt(epsilon^2 + D^2), p and the energy."""
        det = one * two
        root: FloatArray = np.hypot(self.epsilon, det)
        # Without cancellation where the determinant is negative.
        p = np.where(det > 0, (det + root) / 2, self.epsilon**2 / (2 * (root + np.abs(det))))
        return det, root, p, ((one**2 + two**2) / 2 + (1 + det**2) / 2) / p


def _product(f: Derivatives, g: Derivatives) -> Derivatives:
    return Derivatives(
        f.value * g.value,
        f.one * g.value + f.value * g.one,
        f.two * g.value + f.value * g.two,
        f.one_one * g.value + 2 * f.one * g.one + f.value * g.one_one,
        f.one_two * g.value + f.one * g.two + f.two * g.one + f.value * g.one_two,
        f.two_two * g.value + 2 * f.two * g.two + f.value * g.two_two,
    )


def _power(f: Derivatives, exponent: float) -> Derivatives:
    slope = exponent * f.value ** (exponent - 1)
    bend = (exponent - 1) * slope / f.value
    return Derivatives(
        f.value**exponent,
        slope * f.one,
        slope * f.two,
        slope * f.one_one + bend * f.one**2,
        slope * f.one_two + bend * f.one * f.two,
        slope * f.two_two + bend * f.two**2,
    )
