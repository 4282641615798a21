"""Search for the cut of a texture.

Cones choose the cut. The fewer they are, the shorter are the seams, and the higher is the energy of the layout with
free seams. The candidates are the cones that the search finds for an area distortion, which is varied. The tips of the
best candidate's seams are then moved to where the energy is the largest allowed. On large meshes, both are done on a
coarse mesh, and only the cones found there are taken over, unless the mesh itself needs others. At last, small
charts are joined to others where they fit.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..atlas import ChartLayout, Seams, with_charts
from ..base import BoolArray, FloatArray, IntArray, has_any, mask_of
from ..cones import MAX_POLYHEDRON_CORNERS, MAX_SEARCHED, ConeSurface, with_corners
from ..errors import MetricError, SeamError
from ..flattening import Steps, lay_out_component
from ..geometry import (
    coarse_mesh,
    double_areas,
    edge_lengths,
    find_overlaps,
    mollify,
    signed_double_areas,
    triangle_energies,
)
from ..mesh import nearby
from ..seams import seam_costs, without_loose_ends
from ..source import Component
from ..stages import Layout, VertexCurvatures
from .free_seams import as_one_chart, freed, recut, seam_edges, separate_charts, side_by_side
from .options import ENERGY_PER_AREA, ISOMETRIC
from .tips import RINGS, find_tips, moved_tips, moves_for

# The area distortion of the first candidate, one that the fewest cones reach, and the maximum number of candidates.
FIRST_DISTORTION, ANY_DISTORTION, MAX_CANDIDATES = 0.25, 1e3, 5
# The search ends where the costs within and beyond the bound differ by less than this factor, or the numbers of cones
# by one. A surface of 50 handles needs about 160 cones, and each search for them more than a second.
SIMILAR_COSTS = 1.06
# Number of triangles of a coarse mesh; and what its energy has more, relative to what is allowed above that of an
# isometry.
COARSE, COARSE_EXCESS = 4_000, 0.15
# Tips of larger meshes are moved on their coarse meshes only: a try takes seconds.
MANY_TRIANGLES = 60_000
# Number of times that tips are moved to meet the bound, half as often if it is met already, and that a layout is
# settled to avoid contacts.
MAX_TRIES = 4
# Charts below this fraction of the component's area are joined to others; the number of seams that are tried. With 0.05
# instead, 42 models have seams and charts that are 3% and 13% less, but cover 0.02 less of the texture.
SMALL_AREA, MAX_JOINS = 0.005, 8
# Cost of seams that lowers the energy to that of an isometry, relative to the square root of the area.
COST_PER_ENERGY = 0.6
# Tolerance of energies, see `relax`: candidates are relaxed with five times as much and settled with twice as much, as
# the step that meets it is taken. Candidates above the bound by less than twice as much may be within it once settled.
TOLERANCE = 1e-2
# Energy above the bound, relative to what is allowed above that of an isometry, from which a candidate is given up.
# Moving the tips of those hardly ever succeeds: trying it takes a tenth more time for seams shorter by 0.5%.
MAX_EXCESS = 0.2


@dataclass(frozen=True, eq=False)
class Candidate:
    """A layout with free seams.

    Attributes:
        layout: the layout.
        energy: its mean symmetric Dirichlet energy, or the energy that belongs to its area distortion.
        cost: the cost of its seams.
        distortion: an area distortion for which its cones are found.
        is_separated: whether its overlaps are separated, which may add seams.
    """

    layout: Layout
    energy: float
    cost: float
    distortion: float
    is_separated: bool = False


class CutSearch:
    """The search for the cut of a component.

    Args:
        component: a connected part of the input.
        max_energy: largest symmetric Dirichlet energy; infinite for no seams but those that are necessary. It may be
            changed, and candidates for other bounds are used again.
        steps: the functions that lay the component out.
        is_coarse: whether the component is a coarse mesh already.
        by_area: whether the bound is the energy that belongs to an area distortion, see `ENERGY_PER_AREA`.
    """

    def __init__(
        self,
        component: Component,
        max_energy: float,
        steps: Steps,
        is_coarse: bool = False,
        by_area: bool = False,
    ) -> None:
        self.component, self.max_energy, self._steps, self._by_area = component, max_energy, steps, by_area
        self._has_coarse = len(component.faces) > 2 * COARSE and not (
            is_coarse or component.seams.is_forbidden.any()
        )
        self._found = list[Candidate]()

    @property
    def _near(self) -> float:
        """The energy up to which a candidate may be within the bound once it is settled."""
        return self.max_energy + 2 * TOLERANCE * (self.max_energy - ISOMETRIC)

    @cached_property
    def _surface(self) -> ConeSurface:
        surface = ConeSurface.of(self.component.mesh, self.component.lengths, self.component.is_exact)
        surface.is_reused = True
        return surface

    @property
    def may_join(self) -> bool:
        """Whether the component may be cut together with others, see `MinorComponents`."""
        is_bounded, forbidden = np.isfinite(self.max_energy), self.component.seams.is_forbidden
        return bool(is_bounded and len(self.component.faces) <= 2 * COARSE and not forbidden.any())

    @cached_property
    def seam_costs(self) -> FloatArray:
        """(e,) the costs of cutting the edges."""
        return seam_costs(self.component.mesh, self.component.lengths, self.component.seams)

    @property
    def costs(self) -> FloatArray:
        """(e,) the costs of cutting the edges, infinite for edges to avoid."""
        seams = self.component.seams
        return np.where(seams.is_avoided | seams.is_forbidden, np.inf, self.seam_costs)

    def best(self) -> Candidate:
        """Return the candidate within the bound whose seams cost least, or else the one with the least energy.

        Raises:
            CurvatureError, MetricError, SeamError: a candidate could not be laid out.
        """
        if not np.isfinite(self.max_energy):
            return self._with_fewest_seams()
        if self._has_coarse:
            return self._from_coarse()
        candidates, reach = (
            self._by_distortion(),
            self.max_energy + MAX_EXCESS * (self.max_energy - ISOMETRIC),
        )
        if all(len(candidate.layout.seams) or candidate.energy > self.max_energy for candidate in candidates):
            candidates = [*candidates, *self._at_corners()]
        near = [self.separated(candidate) for candidate in candidates if candidate.energy <= reach]
        near.sort(key=self._expected_cost)
        if near and near[0].energy > self.max_energy:
            near.append(self.shortened(near[0]))
        self._surface.close_search()
        within = [candidate for candidate in near if candidate.energy <= self.max_energy]
        least = min([*near, *candidates], key=lambda candidate: candidate.energy)
        return self.separated(min(within, key=self._expected_cost, default=least))

    def shortened(self, start: Candidate, layout: Layout | None = None) -> Candidate:
        """Return a candidate with the tips of its seams moved to where its energy is about the largest allowed.

        Args:
            start: a candidate.
            layout: its layout, if that was cut further.
        """
        start, is_large = self.separated(start), len(self.component.faces) > MANY_TRIANGLES
        if layout is not None:
            start = replace(start, layout=layout, cost=self.cost_of(layout))
        if (layout is not None and not is_large) or self.max_energy < start.energy <= self._near:
            start = self.settled(start)
        slack = self.max_energy - start.energy
        if is_large or (self._has_coarse and 0 <= slack <= 5 * (self._near - self.max_energy)):
            return start
        for one in sorted(map(self.separated, self._moved(start)), key=lambda one: one.cost):
            one = self.settled(one) if one.energy > self.max_energy else one
            if one.energy <= self.max_energy and (one.cost < start.cost or start.energy > self.max_energy):
                return one
        return start

    def small_joined(self, one: Candidate) -> Candidate:
        """Return a candidate in several charts, the smallest joined to others where they fit once their points move."""
        seams, sizes = _chart_seams(one.layout), np.bincount(one.layout.chart, self.component.double_areas)
        stretch = seams.stretches(self.component.mesh)
        is_small = sizes[seams.charts].min(axis=1) < SMALL_AREA * sizes.sum()
        is_small &= seams.charts[:, 0] != seams.charts[:, 1]
        costs = np.bincount(stretch, self.seam_costs[seams.edges] * is_small)
        order = np.argsort(-costs, kind="stable")[: min(MAX_JOINS, np.count_nonzero(costs))]
        for edges in [seams.edges[stretch == each] for each in order]:
            with suppress(MetricError, SeamError):
                joined = self._joined(one, seams, np.isin(seams.edges, edges))
                one, seams = (one, seams) if joined is None else (joined, _chart_seams(joined.layout))
        return one

    def _joined(self, one: Candidate, seams: Seams, at: BoolArray) -> Candidate | None:
        """Return a candidate joined across seam edges that are flagged (k,), or None if its triangles do not fit."""
        layout, sizes = one.layout, np.bincount(one.layout.chart, self.component.double_areas)
        charts = np.unique(seams.charts[at])
        # Charts joined by an earlier seam: the edges are within one, closed from both ends, or beside a large one.
        if len(charts) < 2 or sizes[charts].min() >= SMALL_AREA * sizes.sum():
            return None
        small, other = charts[np.argsort(sizes[charts], kind="stable")]
        is_own, is_small = (seams.charts[at] == small)[:, :1], layout.chart == small
        # The small chart is turned and moved so that its side of the seam is as close as possible to the other one.
        points, sides = layout.points @ np.array([1, 1j]), np.stack([seams.here[at], seams.there[at]])
        ends = np.where(is_own, sides, sides[::-1])
        here, there = points[ends]
        turn, moved = np.vdot(here - here.mean(), there - there.mean()), layout.corners[is_small]
        points[moved] = (points[moved] - here.mean()) * turn / max(abs(turn), 1e-300) + there.mean()
        points[ends] = points[ends].mean(axis=0)
        chart = np.where(is_small, other, layout.chart)
        whole = ChartLayout(points.view(np.float64).reshape(-1, 2), layout.corners, chart)
        whole = whole.joined(ends.reshape(2, -1).T)
        is_near, places = nearby(whole.corners, is_small, RINGS), whole.points[whole.corners]
        near = np.flatnonzero(has_any(is_near, whole.corners))
        # Only the triangles near the small chart are laid out anew.
        patch = as_one_chart(replace(layout, points=whole.points, corners=whole.corners), near)
        free = mask_of(len(patch.points), patch.corners[is_near[whole.corners[near]]])
        after, _ = freed(patch, free, TOLERANCE)
        places[near] = after.points[patch.corners]
        if not (signed_double_areas(places[near]) > 0).all():
            return None
        before = self.energies_of(patch.lengths, layout.points[layout.corners[near]])
        rise = (self.energies_of(patch.lengths, places[near]) - before).sum()
        energy = one.energy + float(rise) / layout.area
        low, high = places[near].min(axis=(0, 1)), places[near].max(axis=(0, 1))
        meets = ((places.min(axis=1) < high) & (places.max(axis=1) > low)).all(axis=1)
        meets &= chart == other
        fits = np.array_equal(after.points[~free], patch.points[~free])
        fits &= energy <= max(self.max_energy, one.energy)
        if not fits or len(find_overlaps(places[meets], limit=1).pairs):
            return None
        whole.points[whole.corners[near]] = places[near]
        layout = with_charts(layout, whole.renumbered())
        return Candidate(layout, energy, self.cost_of(layout), one.distortion, True)

    def cost_of(self, layout: Layout) -> float:
        return float(self.seam_costs[seam_edges(layout)].sum())

    def _with_fewest_seams(self) -> Candidate:
        """Return a candidate cut between the fewest cones, and only along closed curves where there are handles."""
        mesh, spec = self.component.mesh, replace(self.component.cones, distortion=ANY_DISTORTION)
        layout = lay_out_component(self._surface, replace(self.component, cones=spec), self._steps)
        self._surface.close_search()
        if len(layout.cones) and mesh.euler_characteristic < 2 and not mesh.is_boundary_edge.any():
            is_cut = mask_of(len(mesh.edges), seam_edges(layout))
            layout = replace(layout, points=0 * layout.points, cones=np.empty(0, dtype=np.int64))
            layout = recut(layout, np.flatnonzero(without_loose_ends(mesh, is_cut)))
        layout, energy = self._freed(layout)
        return self.settled(self.separated(Candidate(layout, energy, self.cost_of(layout), ANY_DISTORTION)))

    def _from_coarse(self) -> Candidate:
        """Return a candidate with the cones that are best on a coarse mesh, unless the mesh itself needs others."""
        (coarse, kept), allowed = coarse_component(self.component, COARSE), self.max_energy - ISOMETRIC
        bound = self.max_energy + COARSE_EXCESS * allowed
        best = CutSearch(coarse, bound, self._steps, True, self._by_area).best()
        given = VertexCurvatures(kept[best.layout.cones], np.full(len(best.layout.cones), np.nan))
        spec = replace(self.component.cones, strategy="prescribed", prescribed=given)
        layout = lay_out_component(self._surface, replace(self.component, cones=spec), self._steps)
        one = self._candidate(layout, layout.statistics.area_distortion_linear)
        if 0 < one.energy - self.max_energy <= MAX_EXCESS * allowed:
            one = self.shortened(one)
        if one.energy > self.max_energy:
            # The bound is too low, or the surface too noisy, for the cones of a coarse mesh.
            self._has_coarse, self._found = False, [one]
            return self.best()
        self._surface.close_search()
        return self.separated(one)

    def _by_distortion(self) -> list[Candidate]:
        """Return candidates, with energies around the bound among them, and those for earlier bounds."""
        found = self._found
        for tried in range(2 * MAX_CANDIDATES):
            distortion = self._next_distortion(tried)
            if distortion is None:
                break
            spec = replace(self.component.cones, distortion=distortion)
            # Cones that their triangles cannot hold are no problem for free seams.
            layout = lay_out_component(self._surface, replace(self.component, cones=spec), self._steps)
            same = [i for i, each in enumerate(found) if np.array_equal(each.layout.cones, layout.cones)]
            known = found.pop(same[0]) if same else self._candidate(layout, distortion)
            reached, is_within = layout.statistics.area_distortion_linear, known.energy <= self.max_energy
            distortion = min(distortion, reached) if same and not is_within else distortion
            found.append(replace(known, distortion=distortion))
            if same if is_within else (same or len(layout.cones) >= MAX_SEARCHED) and distortion < reached:
                break  # The search finds no others.
        return found

    def _at_corners(self) -> list[Candidate]:
        """Return a candidate that is open at all corners of a polyhedron with few of them, if it is one."""
        component = self.component
        spec = with_corners(component.mesh, component.lengths, component.cones, MAX_POLYHEDRON_CORNERS)
        if spec is None:
            return []
        layout = lay_out_component(self._surface, replace(component, cones=spec), self._steps)
        return [self._candidate(layout, 0.0)]

    def _next_distortion(self, tried: int) -> float | None:
        """Return the area distortion of the next candidate, or None if enough are found."""
        allowed, found = self.max_energy - ISOMETRIC, self._found
        rising = sorted(found, key=lambda each: each.distortion)
        low = next((each for each in rising[::-1] if each.energy <= self.max_energy), None)
        high = next((each for each in rising if each.energy > self.max_energy), None)
        # For another bound, at least one more is tried.
        if low and tried and (tried >= MAX_CANDIDATES or not len(low.layout.seams)):
            return None
        if low and high and tried:
            is_next = len(low.layout.cones) <= len(high.layout.cones) + 1
            is_similar = is_next or low.cost <= SIMILAR_COSTS * high.cost
            return None if is_similar else float(np.sqrt(low.distortion * high.distortion))
        if not found:
            return FIRST_DISTORTION
        # The energy above that of an isometry is about a multiple of the square of the distortion.
        above = float(np.clip(found[-1].energy - ISOMETRIC, allowed / 16, allowed * 16))
        return float(found[-1].distortion * np.sqrt(allowed / above) * (8 / 7 if low and not high else 7 / 8))

    def _candidate(self, layout: Layout, distortion: float, free: BoolArray | None = None) -> Candidate:
        # What the cones or the metric do not meet does not matter where seams are free.
        layout, energy = self._freed(replace(layout, notes=()), free, 5 * TOLERANCE)
        return Candidate(layout, energy, self.cost_of(layout), distortion)

    def _freed(
        self, layout: Layout, free: BoolArray | None = None, tolerance: float = 2 * TOLERANCE
    ) -> tuple[Layout, float]:
        """Return a layout with the least energy, and its energy or the one that belongs to its area distortion."""
        spec = self.component.seams if np.isfinite(self.max_energy) else None
        layout, energy = freed(layout, free, tolerance, spec)
        if self._by_area:
            places = layout.points[layout.corners]
            energy = float(self.energies_of(layout.lengths, places).sum() / layout.area)
        return layout, energy

    def energies_of(self, lengths: FloatArray, places: FloatArray) -> FloatArray:
        """Return (m,) the energies of triangles, multiplied by their areas, see `triangle_energies`."""
        if not self._by_area:
            return triangle_energies(lengths, places)
        areas, flat = double_areas(lengths), signed_double_areas(places)
        return (ISOMETRIC + ENERGY_PER_AREA * np.log(flat / areas) ** 2 / 4) * areas / 2

    def separated(self, one: Candidate) -> Candidate:
        """Return a candidate whose overlaps are separated."""
        if one.is_separated or not self._steps.separates:
            return one
        layout = separate_charts(one.layout, self.seam_costs, self.component.seams)
        return replace(one, layout=layout, cost=self.cost_of(layout), is_separated=True)

    def settled(self, one: Candidate) -> Candidate:
        """Return a candidate with the least energy without overlaps: its separating cuts are free, too."""
        is_free = np.ones(len(one.layout.points), dtype=bool)
        for _ in range(MAX_TRIES):
            layout, energy = self._freed(one.layout, is_free)
            pairs = find_overlaps(side_by_side(layout).points[layout.corners]).pairs
            if not (len(pairs) and self._steps.separates):
                return replace(one, layout=layout, energy=energy)
            # Points where charts would touch themselves stay.
            corners = one.layout.corners
            is_free &= ~nearby(corners, mask_of(len(corners), pairs), RINGS)
        return one

    def _expected_cost(self, one: Candidate) -> float:
        """Return the cost of the seams at which the energy would be the largest allowed, roughly."""
        excess = (one.energy - self.max_energy) / (self.max_energy - ISOMETRIC)
        return one.cost + excess * COST_PER_ENERGY * float(np.sqrt(one.layout.area))

    def _moved(self, start: Candidate) -> list[Candidate]:
        """Return candidates with the tips of the seams moved, so that the energy is about the largest allowed."""
        mesh, seams, found = self.component.mesh, seam_edges(start.layout), list[Candidate]()
        tips = find_tips(start.layout, seams, self.costs)
        if not (np.isfinite(self.max_energy) and (tips.rates > 0).any()):
            return found
        allowed, slack, known = self.max_energy - ISOMETRIC, self.max_energy - start.energy, [seams]
        for _ in range(MAX_TRIES // 2 if slack > 0 else MAX_TRIES):
            moved, cones = moved_tips(start.layout, seams, tips, moves_for(start.layout, tips, slack))
            if any(np.array_equal(moved, each) for each in known):
                # The tips move by whole edges.
                slack += np.sign(slack) * allowed / 4
                continue
            if not (len(moved) or mesh.is_boundary_edge.any()):
                break  # not a disk
            known.append(moved)
            cut = replace(recut(start.layout, moved), cones=cones)
            changed = mask_of(len(mesh.vertices), mesh.edges[np.setxor1d(seams, moved)])
            # Most of what moves is near: more rings change the seams by less than 1%.
            is_free = nearby(cut.corners, has_any(changed, mesh.faces), 4 * RINGS)
            one = self._candidate(cut, start.distortion, is_free)
            excess = one.energy - self.max_energy
            found += [one] if one.energy <= self._near else []
            # A start beyond the bound only has to get within it: the tips move again after the cuts for packing.
            if excess <= 0 and (excess >= -2 * TOLERANCE * allowed or start.energy > self.max_energy):
                break
            slack = slack - excess if (slack - excess) * slack > 0 else slack / 2
        return found


def _chart_seams(layout: Layout) -> Seams:
    return Seams(layout.mesh, ChartLayout(layout.points, layout.corners, layout.chart))


def coarse_component(component: Component, count: int) -> tuple[Component, IntArray]:
    """Return a component with about `count` triangles, and (k,) the vertices of the given component that it keeps."""
    coarse, kept, faces = coarse_mesh(component.mesh, count)
    own, none = edge_lengths(coarse.vertices, coarse.faces), np.zeros(len(coarse.edges), dtype=bool)

    def of_kept(spec: Any, *names: str) -> Any:
        given = [name for name in names if getattr(spec, name) is not None]
        return replace(spec, **{name: getattr(spec, name)[kept] for name in given})

    cones = of_kept(component.cones, "is_allowed", "absorbs_curvature", "names")
    metric = of_kept(component.metric, "keeps_length", "names")
    seams = replace(of_kept(component.seams, "visibility", "weights"), is_avoided=none, is_forbidden=none)
    near = coarse, component.vertices[kept], faces, mollify(own, coarse)[0], double_areas(own)
    return Component(*near, cones, metric, seams), kept
