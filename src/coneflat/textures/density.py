"""The resolution of a texture that has a number of texels per unit of length of the model."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ..base import FloatArray
from ..errors import OptionError
from .options import MAX_RESOLUTION

#: Resolutions are multiples of it, in texels.
STEP = 4
#: Rough fraction of a texture that charts and their padding cover.
COVERED = 0.65
#: Largest number of packings of a search. It ends after 4 to 8 unless the density is not monotone.
MAX_PACKINGS = 24


def expected_resolution(density: float, areas: FloatArray, padding: float, tiles: int) -> int:
    """Return about the resolution that a texel density will need, before the charts are known.

    Args:
        density: texels per unit of length.
        areas: (k,) the areas of components, which are charts or several of them.
        padding: texels between charts.
        tiles: number of textures.

    Raises:
        OptionError: no texture is large enough, even if charts cover all of it.
    """
    sides = np.sqrt(areas / tiles)
    charts_side = math.sqrt(float((sides**2).sum()))
    # Charts that overlap themselves may need half of this side.
    if density * charts_side > 2 * MAX_RESOLUTION:
        raise _too_large(MAX_RESOLUTION / charts_side)
    padded = math.sqrt(float(((density * sides + padding / math.sqrt(tiles)) ** 2).sum()) / COVERED)
    # Charts need some space next to the padding.
    return STEP * math.ceil(min(max(padded, 16 * padding, STEP), MAX_RESOLUTION) / STEP)


def least_resolution(density: float, padding: float, start: int, scale_at: Callable[[int], float]) -> int:
    """Return a resolution with a texel density: a multiple of 4 that suffices, while the next smaller one does not.

    The density increases with the resolution almost linearly, but not monotonically, because charts are packed again
    for each. So a smaller resolution that was not tried may suffice, too.

    Args:
        density: texels per unit of length, at least.
        padding: texels between charts, less than a quarter of the resolution.
        start: the resolution that is tried first.
        scale_at: UV units per unit of length at a resolution; OptionError if the padding leaves no space.

    Raises:
        OptionError: the largest texture has a smaller density.
    """
    search = _Search(density, scale_at, math.floor(padding), MAX_RESOLUTION // STEP)
    low, high = search.bracket(start // STEP)
    return STEP * search.narrowed(low, high)


class _Search:
    """The search for the first number of steps of texels with a density.

    Attributes:
        densities: those of the numbers of steps that were tried.
    """

    def __init__(self, density: float, scale_at: Callable[[int], float], below: int, limit: int) -> None:
        """Set up the search from `below` (exclusive) to `limit` steps."""
        self.density, self.scale_at, self.below, self.limit = density, scale_at, below, limit
        self.densities: dict[int, float] = {}

    def suffices(self, steps: int) -> bool:
        """Return whether a resolution has the density."""
        if steps not in self.densities:
            try:
                self.densities[steps] = STEP * steps * self.scale_at(STEP * steps)
            except OptionError:  # no space for charts next to the padding
                self.densities[steps] = 0.0
        return self.densities[steps] >= self.density

    def bracket(self, start: int) -> tuple[int, int]:
        """Return a number of steps that does not suffice, or the one below all, and a larger one that does."""
        low, steps = self.below, min(max(start, self.below + 1), self.limit)
        while not self.suffices(steps):
            if steps == self.limit:
                raise _too_large(self.densities[steps])
            # Near the end of a line that is nearly level, extrapolation takes many small steps.
            next_steps = 2 * steps if len(self.densities) > 5 else steps + 1
            low, steps = steps, min(max(self._crossing(low, steps), next_steps), self.limit)
        return low, steps

    def narrowed(self, low: int, high: int) -> int:
        """Return a number of steps that suffices, after one that does not: between `low` and `high`, as they do."""
        wide = 0  # interpolations since the interval was halved
        while high - low > 1 and len(self.densities) < MAX_PACKINGS:
            width, middle = high - low, (low + high) // 2
            # Where there is no space for charts at all, there is no line to interpolate on.
            is_halved = wide == 2 or self.densities.get(low) == 0
            steps = middle if is_halved else min(max(self._crossing(low, high), low + 1), high - 1)
            low, high = (low, steps) if self.suffices(steps) else (steps, high)
            wide = 0 if is_halved or 2 * (high - low) <= width else wide + 1
        return high

    def _crossing(self, low: int, high: int) -> int:
        """Return the number of steps with the density on the line through two numbers; twice the larger for none."""
        low_density, high_density = self.densities.get(low, 0.0), self.densities[high]
        steps = (
            low + (self.density - low_density) / (high_density - low_density) * (high - low)
            if high_density > low_density
            else 2.0 * high
        )
        return math.ceil(min(steps, self.limit))


def _too_large(possible: float) -> OptionError:
    return OptionError(
        f"texel_density is too large: textures of at most {MAX_RESOLUTION:,} texels per side have about "
        f"{possible:.3g} texels per unit of length; expected a smaller density"
    )
