"""Candidates for the cut of a component: layouts with free seams, and how they are computed and compared."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..base import BoolArray, FloatArray, IntArray, has_any, mask_of
from ..cones import ConeSurface
from ..flattening import Steps, lay_out_component
from ..geometry import find_overlaps
from ..mesh import nearby
from ..seams import seam_costs
from ..source import Component
from ..stages import ConeSpec, Layout
from .energy import EnergyBound
from .free_seams import freed, seam_edges, separate_charts, side_by_side
from .moving_apart import moved_apart
from .tips import RINGS

# Cost of seams that lowers the energy to that of an isometry, relative to the square root of the area.
COST_PER_ENERGY = 0.6
# Tolerance of energies, see `relax`: candidates are relaxed with five times as much and settled with twice as much, as
# the step that meets it is taken. Candidates above the bound by less than twice as much may be within it once settled.
TOLERANCE = 1e-2
# Number of times that a layout is settled to avoid contacts.
MAX_SETTLINGS = 4


@dataclass(frozen=True, eq=False)
class Candidate:
    """A layout with free seams.

    Attributes:
        layout: the layout.
        energy: its energy, see `EnergyBound`.
        cost: the cost of its seams.
        distortion: an area distortion for which its cones are found.
        is_separated: whether its overlaps are separated, which may add seams.
        keeps_points: whether its points stay where they are if it is cut further.
        settled: (k,) the seams for which all of its points were relaxed to the smaller tolerance; None if they were
            not, see `CutModel.settled`.
    """

    layout: Layout
    energy: float
    cost: float
    distortion: float
    is_separated: bool = False
    keeps_points: bool = False
    settled: IntArray | None = None


@dataclass(frozen=True, eq=False)
class CutModel:
    """A component, and how its cuts are laid out and compared.

    Attributes:
        component: the component.
        bound: the bound of its energy.
        steps: the functions that lay it out, and whether overlaps are separated.
    """

    component: Component
    bound: EnergyBound
    steps: Steps

    @cached_property
    def surface(self) -> ConeSurface:
        """The component with its operators, which searches for cones share."""
        surface = self.steps.surface(self.component)
        surface.is_reused = True
        return surface

    def with_holes(self, are_kept: bool) -> CutModel:
        """Return the model of the component with its holes kept, where they can be, or opened."""
        component = self.component
        return replace(
            self, component=component.with_kept_holes() if are_kept else component.with_opened_holes()
        )

    @cached_property
    def seam_costs(self) -> FloatArray:
        """(e,) the costs of cutting the edges."""
        return seam_costs(self.component.mesh, self.component.lengths, self.component.seams)

    @property
    def costs(self) -> FloatArray:
        """(e,) the costs of cutting the edges, infinite for edges to avoid."""
        seams = self.component.seams
        return np.where(seams.is_avoided | seams.is_forbidden, np.inf, self.seam_costs)

    @property
    def settled_bound(self) -> float:
        """The energy up to which a candidate may be within the bound once it is settled."""
        return self.bound.plus(2 * TOLERANCE)

    def cost_of(self, layout: Layout) -> float:
        """Return the cost of the seams of a layout."""
        return float(self.seam_costs[seam_edges(layout)].sum())

    def laid_out(self, cones: ConeSpec) -> Layout:
        """Return a layout of the component, cut between the cones that a specification gives.

        Cones that their triangles cannot realise are no problem for free seams.
        """
        return lay_out_component(self.surface, replace(self.component, cones=cones), self.steps)

    def candidate(
        self, layout: Layout, distortion: float, free: BoolArray | None = None, settles: bool = False
    ) -> Candidate:
        """Return the candidate that a layout becomes with free seams.

        Args:
            layout: the layout.
            distortion: see `Candidate`.
            free: (c,) the points that move; None for all.
            settles: whether all points are relaxed to the smaller tolerance, see `settled`.
        """
        # Notes on cones and the metric do not apply to layouts with free seams.
        layout, energy = self.freed(replace(layout, notes=()), free, (2 if settles else 5) * TOLERANCE)
        candidate = Candidate(layout, energy, self.cost_of(layout), distortion)
        return replace(candidate, settled=seam_edges(layout)) if settles else candidate

    def freed(
        self, layout: Layout, free: BoolArray | None = None, tolerance: float = 2 * TOLERANCE
    ) -> tuple[Layout, float]:
        """Return a layout with the least energy, and the energy that is bounded; arguments as of `free_seams.freed`."""
        layout, energy = freed(
            layout, free, tolerance, self.component.seams if self.bound.is_finite else None
        )
        return layout, self.bound.energy(layout) if self.bound.by_area else energy

    def separated(self, candidate: Candidate) -> Candidate:
        """Return a candidate whose overlaps are separated."""
        if candidate.is_separated or not self.steps.separates:
            return candidate
        apart = self._moved_apart(candidate)
        if apart is not None:
            return apart
        layout = separate_charts(candidate.layout, self.seam_costs, self.component.seams)
        return replace(candidate, layout=layout, cost=self.cost_of(layout), is_separated=True)

    def _moved_apart(self, candidate: Candidate) -> Candidate | None:
        """Return a candidate in one chart whose overlaps are moved apart within the bound, if they are small."""
        if candidate.layout.chart.any():
            return None
        layout = moved_apart(candidate.layout, 2 * TOLERANCE)
        if layout is None:
            return None
        energy = self.bound.energy(layout)
        is_allowed = energy <= max(self.bound.largest, candidate.energy)
        return replace(candidate, layout=layout, energy=energy, is_separated=True) if is_allowed else None

    def settled(self, candidate: Candidate) -> Candidate:
        """Return a candidate with the least energy without overlaps: its separating cuts are free, too.

        If it was settled before and is within the bound, only points near edges move that were cut or closed since.
        """
        is_free = np.ones(len(candidate.layout.points), dtype=bool)
        if candidate.settled is not None and self.is_within(candidate):
            is_free = points_near(
                candidate.layout, np.setxor1d(candidate.settled, seam_edges(candidate.layout))
            )
        if not is_free.any():
            return candidate
        for _ in range(MAX_SETTLINGS):
            layout, energy = self.freed(candidate.layout, is_free)
            pairs = find_overlaps(side_by_side(layout).points[layout.corners]).pairs
            if not (len(pairs) and self.steps.separates):
                return replace(candidate, layout=layout, energy=energy, settled=seam_edges(layout))
            # Points where charts would touch themselves stay.
            corners = candidate.layout.corners
            is_free &= ~nearby(corners, mask_of(len(corners), pairs), RINGS)
        return candidate

    def expected_cost(self, candidate: Candidate) -> float:
        """Return the cost of the seams at which the energy would be the largest allowed, roughly."""
        if not self.bound.is_finite:
            return candidate.cost
        excess = (candidate.energy - self.bound.largest) / self.bound.allowed
        return candidate.cost + excess * COST_PER_ENERGY * float(np.sqrt(candidate.layout.area))

    def is_within(self, candidate: Candidate) -> bool:
        """Return whether a candidate is within the bound."""
        return candidate.energy <= self.bound.largest


def points_near(layout: Layout, edges: IntArray) -> BoolArray:
    """Return (c,) flags of the points of a layout near edges (k,), which move where those are cut or closed.

    Most of what moves is near: more rings change the seams by less than 1%.
    """
    is_changed = mask_of(len(layout.mesh.vertices), layout.mesh.edges[edges])
    return nearby(layout.corners, has_any(is_changed, layout.mesh.faces), 4 * RINGS)
