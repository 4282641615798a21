"""Search for the cut of a texture.

Cones choose the cut. The fewer they are, the shorter are the seams, and the higher is the energy of the layout with
free seams. The candidates are the cones that the search finds for an area distortion, which is varied.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ... import TriangleMesh
from ...atlas import separate_overlaps
from ...base import FloatArray
from ...cones import close_search
from ...flatten import Method, lay_out_part
from ...seams import seam_costs
from ...source import Part
from ...stages import Layout, Surface
from .free import freed

# The area distortion of the first candidate, and the maximum number of candidates: half as many for meshes with more
# than MANY_TRIANGLES, for which each takes seconds. More than six shorten seams by less than 1%.
FIRST_DISTORTION, MAX_CANDIDATES, MANY_TRIANGLES = 0.25, 6, 200_000


@dataclass(frozen=True, eq=False)
class Candidate:
    """A layout with free seams.

    Attributes:
        distortion: the area distortion for which its cones were searched.
        layout: the layout; if its energy is within the bound, without overlaps.
        energy: its mean symmetric Dirichlet energy.
        cost: the cost of its seams if the energy is within the bound, else the energy.
    """

    distortion: float
    layout: Layout
    energy: float
    cost: float


class CutSearch:
    """The search for the cut of a part.

    Args:
        part: a connected part of the input.
        max_energy: largest symmetric Dirichlet energy.
        method: how the part is laid out.
    """

    def __init__(self, part: Part, max_energy: float, method: Method) -> None:
        self._part, self._max_energy = part, max_energy
        self._method = replace(method, surface_of=self._surface_of)
        self._surface: Surface | None = None
        self._costs = seam_costs(part.mesh, part.lengths, part.seams)

    def best(self) -> Candidate:
        """Return the candidate within the bound whose seams cost least, or else the one with the least energy.

        Raises:
            CurvatureError, MetricError, SeamError: a candidate could not be laid out.
        """
        within, beyond, distortion = list[Candidate](), list[Candidate](), FIRST_DISTORTION
        is_large = len(self._part.faces) > MANY_TRIANGLES
        for _ in range(MAX_CANDIDATES // 2 if is_large else MAX_CANDIDATES):
            one = self._candidate(distortion)
            (within if one.energy <= self._max_energy else beyond).append(one)
            if not within:
                distortion /= 2
                continue
            low = max(within, key=lambda each: each.distortion)
            high = min(beyond, key=lambda each: each.distortion, default=None)
            if not len(low.layout.seams) or (high and len(low.layout.cones) <= len(high.layout.cones) + 1):
                break
            distortion = 2 * distortion if high is None else float(np.sqrt(low.distortion * high.distortion))
        best = min(within or beyond, key=lambda each: each.cost)
        if self._surface is not None:
            close_search(self._surface)
            self._surface = None
        return best if within else replace(best, layout=self._separated(best.layout))

    def _candidate(self, distortion: float) -> Candidate:
        spec = replace(self._part.cones, distortion=distortion)
        layout, energy = freed(lay_out_part(replace(self._part, cones=spec), self._method))
        if energy > self._max_energy:
            return Candidate(distortion, layout, energy, energy)
        layout = self._separated(layout)
        return Candidate(distortion, layout, energy, self._cost(layout))

    def _separated(self, layout: Layout) -> Layout:
        return separate_overlaps(layout, self._costs, self._part.seams) if self._method.separates else layout

    def _cost(self, layout: Layout) -> float:
        """Return the length of the seams of a layout, weighted by the options for seams."""
        ends = [len(self._part.mesh.vertices), 1]
        is_seam = np.isin(np.sort(self._part.mesh.edges, axis=1) @ ends, np.sort(layout.seams, axis=1) @ ends)
        return float(self._costs[is_seam].sum())

    def _surface_of(self, mesh: TriangleMesh, lengths: FloatArray, flips: bool) -> Surface:
        if self._surface is None:
            self._surface = Surface.of(mesh, lengths, flips)
            self._surface.is_reused = True
        return self._surface
