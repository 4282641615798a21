"""Unwrapping for as many textures of a given resolution as a texel density needs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..atlas import Frame
from ..base import Unmet, search_time, timing, warns
from ..errors import OptionError
from ..geometry import double_areas
from ..io import as_input
from ..mesh import label_faces
from ..options import read_options
from ..result import Flattening
from ..source import Source
from .cut_search import Searched, search_cuts
from .fitting import square_side
from .further_cuts import cut_to_pack
from .options import MAX_TEXTURES, UnwrapOptions, options_of_stages
from .unwrapping import pack_candidates

#: Sides of charts that are tried, relative to that of a texture without its padding: charts may grow when seams move
#: after cuts, and small charts are joined to them.
CHART_SIDES = (0.99, 0.9, 0.8)
#: The same for the largest density that charts permit, if it is smaller than the requested one.
LOOSER_SIDES = (1.0, *CHART_SIDES)
#: Share of the density that the largest chart permits, at which charts are packed if it is smaller than the requested
#: one: the last percent would need a texture for each chart.
PERMITTED = 0.99
#: Smallest factor between numbers of textures that are tried, each of which takes a packing.
MIN_GROWTH = 1.05


@warns()
def unwrap_in_textures(mesh: Any, faces: ArrayLike | None, density: float, **options: Any) -> Flattening:
    """Return UVs in as many textures (UDIM tiles) of a resolution as a texel density needs.

    Charts that are larger than a texture are cut. Fewer textures may suffice, since charts are packed into a few
    numbers of them only.

    Args:
        mesh, faces: as of `coneflat.unwrap`.
        density: texels per unit of length, at least.
        options: those of `coneflat.unwrap`, without `texel_density` and `tiles`.

    Returns:
        The result, with a note if the density is not reached, because charts could not be cut.

    Raises:
        OptionError: an option is invalid, the density needs too many textures, or the padding leaves no space for
            charts.
    """
    parsed = read_options(options, UnwrapOptions)
    with timing(parsed.progress), search_time(parsed.search_time):
        packing = _Packing(search_cuts(Source(as_input(mesh, faces)), parsed), parsed)
        result, side, permitted = packing.densest(density, CHART_SIDES)
        if density_of(result) >= density:
            return result
        # Charts need not be smaller than those that cannot be cut and permit no more.
        possible = PERMITTED * permitted
        looser = packing.densest(possible, LOOSER_SIDES)[0]
        result = looser if density_of(looser) >= possible else packing.at_least(possible, side)
    return replace(result, notes=(*result.notes, too_large_charts(density_of(result), density)))


@dataclass(frozen=True)
class _Packing:
    """A mesh whose cuts are searched, to be packed in various numbers of textures.

    Attributes:
        searched: what was found for the mesh.
        options: the options, without the number of textures.
    """

    searched: Searched
    options: UnwrapOptions

    @property
    def side(self) -> float:
        """The texels along a side of a texture, without its padding, and in whole blocks.

        Raises:
            OptionError: the padding leaves no space for charts.
        """
        options = self.options
        return options.resolution * Frame.of(options.resolution, options.padding, options.block_size).side

    def densest(self, density: float, chart_sides: Sequence[float]) -> tuple[Flattening, float, float]:
        """Return the first result with a density, or else the one whose largest chart permits the largest density.

        Args:
            density: texels per unit of length.
            chart_sides: the sides of charts to try, relative to that of a texture.

        Returns:
            The result, the side to which its charts are cut, in units of length, and the density that they permit.
        """
        results = list[tuple[Flattening, float, float]]()
        for share in chart_sides:
            side = share * self.side / density
            result = self.at_least(density, side)
            results.append((result, side, self.permitted_density(result)))
            if density_of(result) >= density:
                return results[-1]
        return max(results, key=lambda candidate: candidate[2])

    def at_least(self, density: float, chart_side: float) -> Flattening:
        """Return charts that are cut to a side, in few textures with a density; any number if charts do not permit it.

        Raises:
            OptionError: the padding leaves no space for charts.
        """
        stage_options = options_of_stages(self.options)
        textures = self._least_number(density)
        candidates = cut_to_pack(self.searched, self.options, stage_options, chart_side)
        while True:
            options = replace(self.options, tiles=textures)
            try:
                result = pack_candidates(self.searched, candidates, options, options_of_stages(options))
            except OptionError:  # Maybe there is no space for so many charts in so few textures.
                if textures == MAX_TEXTURES:
                    raise
                textures = min(2 * textures, MAX_TEXTURES)
                continue
            reached, largest = density_of(result), min(result.distortion.charts, MAX_TEXTURES)
            if reached >= density or textures >= largest or self.permitted_density(result) < density:
                return result
            needed = textures * max((density / reached) ** 2, MIN_GROWTH)
            textures = min(math.ceil(needed), largest)

    def _least_number(self, density: float) -> int:
        """Return the number of textures that are needed if charts cover all of them.

        Raises:
            OptionError: there would be too many.
        """
        areas = [float(double_areas(component.lengths).sum()) / 2 for component in self.searched.components]
        root = float(np.ldexp(math.sqrt(sum(areas)), -self.searched.prepared.checked.exponent))
        possible = math.sqrt(MAX_TEXTURES) * self.side / root
        if density > possible:
            raise OptionError(
                f"texel_density is too large: {MAX_TEXTURES:,} textures of {self.options.resolution:,} texels per side "
                f"have about {possible:.3g} texels per unit of length; expected a smaller density"
            )
        return max(math.ceil((density * root / self.side) ** 2), 1)

    def permitted_density(self, result: Flattening) -> float:
        """Return the texels per unit of length at which the largest chart of a result fills a texture."""
        chart = label_faces(result.uv_faces, len(result.uv))[1]
        order = np.argsort(chart, kind="stable")
        starts = np.searchsorted(chart[order], np.arange(1, chart.max() + 1))
        sides = [square_side(result.corner_uv[faces].reshape(-1, 2)) for faces in np.split(order, starts)]
        return self.side * result.uv_scale / max(sides)


def density_of(result: Flattening) -> float:
    """Return the texels per unit of length of a result."""
    return float(result.uv_scale * result.settings["resolution"])


def too_large_charts(reached: float, density: float) -> Unmet:
    """Return the note that a texel density is not reached."""
    return Unmet(
        f"There are {reached:.6g} texels per unit of length instead of {density:.6g}, because charts are too large."
    )
