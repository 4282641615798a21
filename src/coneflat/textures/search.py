"""Search for the cut of a texture.

Cones choose the cut. The fewer they are, the shorter are the seams, and the higher is the energy of the layout with
free seams. The candidates are the cones that the search finds for an area distortion, which is varied. The tips of the
best candidate's seams are then moved to where the energy is the largest allowed. On large meshes, both are done on a
coarse mesh, and only the cones found there are taken over, unless the mesh itself needs others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np

from ..base import mask_of, part_of_work, within_time
from ..cones import MAX_POLYHEDRON_CORNERS, MAX_SEARCHED, with_corners
from ..errors import CurvatureError, MetricError, SeamError
from ..geometry import triangle_energies
from ..layout import NEARLY_FLAT, is_flat_inside, lay_out_flat_disks
from ..seams import NO_EDGES, find_seams, without_loose_ends
from ..source import coarse_component, is_large
from ..stages import VertexCurvatures
from .candidates import COST_PER_ENERGY, Candidate, CutModel
from .energy import EnergyBound
from .free_seams import recut, seam_edges
from .options import ISOMETRIC
from .shortening import shortened

# The area distortion of the first candidate, and one so large that the fewest cones reach it.
FIRST_DISTORTION, ANY_DISTORTION = 0.25, 1e3
# Number of searches after which a candidate within the bound is enough; twice as many are the maximum.
ENOUGH_SEARCHES = 5
# The search ends where the costs within and beyond the bound differ by less than this factor, or the numbers of cones
# by one. A surface of 50 handles needs about 160 cones, and each search for them more than a second.
SIMILAR_COSTS = 1.06
# What the energy of a coarse mesh has more, relative to what is allowed above that of an isometry.
COARSE_EXCESS = 0.15
# Energy above the bound, relative to what is allowed above that of an isometry, from which a candidate is given up.
# Moving the tips of those hardly ever succeeds: trying it takes a tenth more time for seams shorter by 0.5%.
MAX_EXCESS = 0.2
# Fractions of the work that is left, for the progress: of the search on a coarse mesh, of the layout with its cones, of
# the search for cones, and of a further candidate.
COARSE_SHARE, LAYOUT_SHARE, SEARCH_SHARE, CANDIDATE_SHARE = 0.15, 0.5, 0.8, 0.35
# Energy above that of an isometry that is due to rounding.
ISOMETRIC_ROUNDING = 1e-9
#: Errors of a candidate, after which others are tried: with opened holes, or without a coarse mesh.
FAILURES = CurvatureError, MetricError, SeamError


def best_cut(model: CutModel) -> Candidate:
    """Return the candidate within the bound whose seams cost least, or else the one with the least energy.

    Without a bound, the seams are those that open the component to a disk, or to a disk with holes.

    Raises:
        CurvatureError, MetricError, SeamError: a candidate could not be laid out.
    """
    isometric = _without_distortion(model)
    if isometric is not None:
        return isometric
    if not model.bound.is_finite:
        return _best_of_variants(model, _with_fewest_seams)[1]
    if not is_large(model.component) or model.component.seams.is_forbidden.any():
        return _best_of_variants(model, _best_of_searched)[1]
    try:
        variant, candidate = _from_coarse(model)
    except FAILURES:
        return _best_of_variants(model, _best_of_searched)[1]
    if not model.is_within(candidate):
        # The bound is too low, or the surface too noisy, for the cones of a coarse mesh.
        candidate = _best_of_searched(variant, [candidate])
        if variant.component.keeps_holes and not model.is_within(candidate):
            opened_candidate = within_time(lambda: _best_of_searched(model.with_holes(False)))
            candidate = _best_within(model, candidate, opened_candidate or candidate)
        return candidate
    variant.surface.close_search()
    return model.separated(candidate)


def _without_distortion(model: CutModel) -> Candidate | None:
    """Return the candidate that is isometric without seams, if there is one: none is better."""
    mesh, lengths = model.component.mesh, model.component.lengths
    if not is_flat_inside(mesh, lengths, NEARLY_FLAT):
        return None
    (layout,) = lay_out_flat_disks([mesh], [lengths], [model.component.metric.keeps_length], NEARLY_FLAT)
    if layout is None:
        return None
    energy = float(triangle_energies(lengths, layout.points[layout.corners]).sum() / layout.area)
    if energy > ISOMETRIC + ISOMETRIC_ROUNDING:
        return None
    return Candidate(layout, energy, 0.0, 0.0, is_separated=True, keeps_points=True)


def _best_of_variants(model: CutModel, search: Callable[[CutModel], Candidate]) -> tuple[CutModel, Candidate]:
    """Return the better variant of a component, with its holes kept or opened, and the candidate that a search gives.

    Opened holes are tried only where the bound is not met, or if their seams may cost less.
    """
    opened, variant = model.with_holes(False), model.with_holes(True)
    if not variant.component.keeps_holes:
        return opened, search(opened)
    try:
        candidate = search(variant)
    except FAILURES:
        return opened, search(opened)
    if model.is_within(candidate) and _is_cheapest(model, candidate):
        return variant, candidate
    with suppress(*FAILURES):
        opened_candidate = within_time(lambda: search(opened))
        if opened_candidate and _best_within(model, candidate, opened_candidate) is opened_candidate:
            return opened, opened_candidate
    return variant, candidate


def _is_cheapest(model: CutModel, candidate: Candidate) -> bool:
    """Return whether no seams to all holes cost less than those of a candidate that keeps them.

    The seams that are found cost at most twice as much as the cheapest ones.
    """
    if not (model.bound.is_finite and len(candidate.layout.seams)):
        return True
    opening = model.seam_costs[find_seams(model.component.mesh, NO_EDGES, model.seam_costs)].sum()
    return bool(model.expected_cost(candidate) <= opening / 2 - COST_PER_ENERGY * candidate.layout.area**0.5)


def _best_within(model: CutModel, *candidates: Candidate) -> Candidate:
    """Return the candidate within the bound whose seams cost least, or else the one with the least energy."""
    within = [candidate for candidate in candidates if model.is_within(candidate)]
    lowest = min(candidates, key=lambda candidate: candidate.energy)
    return min(within, key=model.expected_cost, default=lowest)


def _with_fewest_seams(model: CutModel) -> Candidate:
    """Return a candidate cut between the fewest cones, and only along closed curves where there are handles."""
    mesh = model.component.mesh
    layout = model.laid_out(replace(model.component.cones, distortion=ANY_DISTORTION))
    model.surface.close_search()
    if len(layout.cones) and mesh.euler_characteristic < 2 and not mesh.is_boundary_edge.any():
        is_cut = mask_of(len(mesh.edges), seam_edges(layout))
        layout = replace(layout, points=0 * layout.points, cones=np.empty(0, dtype=np.int64))
        layout = recut(layout, np.flatnonzero(without_loose_ends(mesh, is_cut)))
    layout, energy = model.freed(layout)
    candidate = Candidate(layout, energy, model.cost_of(layout), ANY_DISTORTION)
    return model.settled(model.separated(candidate))


def _from_coarse(model: CutModel) -> tuple[CutModel, Candidate]:
    """Return the variant of a component that is better on a coarse mesh, and a candidate with the best cones there."""
    coarse, vertices = coarse_component(model.component)
    bound = EnergyBound(model.bound.plus(COARSE_EXCESS), model.bound.by_area)
    with part_of_work(COARSE_SHARE, "on a coarse mesh"):
        coarse_variant, best = _best_of_variants(CutModel(coarse, bound, model.steps), _best_of_searched)
    variant = model.with_holes(coarse_variant.component.keeps_holes)
    cones = vertices[best.layout.cones]
    prescribed = VertexCurvatures(cones, np.full(len(cones), np.nan))
    with part_of_work(LAYOUT_SHARE, "layout"):
        layout = variant.laid_out(
            replace(model.component.cones, strategy="prescribed", prescribed=prescribed)
        )
    with part_of_work(SEARCH_SHARE, "relaxing"):
        candidate = variant.candidate(layout, layout.statistics.area_distortion_linear, settles=True)
    excess = candidate.energy - model.bound.largest
    if 0 < excess <= MAX_EXCESS * model.bound.allowed:
        candidate = shortened(variant, candidate)
    return variant, candidate


def _best_of_searched(model: CutModel, earlier: Sequence[Candidate] = ()) -> Candidate:
    """Return the best of the candidates that searches for an area distortion give, and of earlier ones."""
    with part_of_work(SEARCH_SHARE):
        candidates = _by_distortion(model, earlier)
    if all(len(candidate.layout.seams) or not model.is_within(candidate) for candidate in candidates):
        candidates += within_time(lambda: _at_corners(model)) or []
    promising = [
        within_time(partial(model.separated, candidate)) or candidate
        for candidate in candidates
        if candidate.energy <= model.bound.plus(MAX_EXCESS)
    ]
    promising.sort(key=model.expected_cost)
    if promising and not model.is_within(promising[0]):
        promising.append(shortened(model, promising[0]))
    model.surface.close_search()
    within = [candidate for candidate in promising if model.is_within(candidate)]
    lowest = min([*promising, *candidates], key=lambda candidate: candidate.energy)
    return model.separated(min(within, key=model.expected_cost, default=lowest))


def _by_distortion(model: CutModel, earlier: Sequence[Candidate]) -> list[Candidate]:
    """Return candidates for different area distortions, with energies around the bound among them."""
    candidates = list(earlier)
    for tries in range(2 * ENOUGH_SEARCHES):
        distortion = _next_distortion(model.bound, candidates, tries)
        if distortion is None:
            break
        with part_of_work(CANDIDATE_SHARE, f"candidate {tries + 1}"):
            search = partial(_for_distortion, model, distortion, candidates)
            result = within_time(search) if candidates else search()
        if result is None:
            break
        candidate, reached = result
        is_within, is_repeated = model.is_within(candidate), candidate in candidates
        if is_repeated:
            candidates.remove(candidate)
            distortion = distortion if is_within else min(distortion, reached)
        candidates.append(replace(candidate, distortion=distortion))
        has_all_cones = not is_within and distortion < reached and len(candidate.layout.cones) >= MAX_SEARCHED
        if has_all_cones or (is_repeated and (is_within or distortion < reached)):
            break  # The search finds no others.
    return candidates


def _for_distortion(
    model: CutModel, distortion: float, candidates: Sequence[Candidate]
) -> tuple[Candidate, float]:
    """Return the candidate with the cones for an area distortion, and the area distortion that they reach.

    If one of the given candidates has the same cones, it is returned itself.
    """
    layout = model.laid_out(replace(model.component.cones, distortion=distortion))
    repeated = (old for old in candidates if np.array_equal(old.layout.cones, layout.cones))
    candidate = next(repeated, None) or model.candidate(layout, distortion)
    return candidate, layout.statistics.area_distortion_linear


def _next_distortion(bound: EnergyBound, candidates: Sequence[Candidate], tries: int) -> float | None:
    """Return the area distortion of the next candidate, or None if enough are found.

    Args:
        bound: the bound of the energy.
        candidates: those so far, in the order in which they were found.
        tries: how many searches were made.
    """
    if not candidates:
        return FIRST_DISTORTION
    rising = sorted(candidates, key=lambda candidate: candidate.distortion)
    within = [candidate for candidate in rising if candidate.energy <= bound.largest]
    beyond = [candidate for candidate in rising if candidate.energy > bound.largest]
    # At least one search is made, also after candidates from a coarse mesh.
    if within and tries and (tries >= ENOUGH_SEARCHES or not len(within[-1].layout.seams)):
        return None
    if within and beyond and tries:
        low, high = within[-1], beyond[0]
        is_next = len(low.layout.cones) <= len(high.layout.cones) + 1
        is_similar = is_next or low.cost <= SIMILAR_COSTS * high.cost
        return None if is_similar else float(np.sqrt(low.distortion * high.distortion))
    # The energy above that of an isometry is about a multiple of the square of the distortion.
    latest = candidates[-1]
    above = float(np.clip(latest.energy - ISOMETRIC, bound.allowed / 16, bound.allowed * 16))
    margin = 8 / 7 if within and not beyond else 7 / 8
    return float(latest.distortion * np.sqrt(bound.allowed / above) * margin)


def _at_corners(model: CutModel) -> list[Candidate]:
    """Return a candidate that is open at all corners of a polyhedron with few of them, if it is one."""
    component = model.component
    cones = with_corners(component.mesh, component.lengths, component.cones, MAX_POLYHEDRON_CORNERS)
    return [] if cones is None else [model.candidate(model.laid_out(cones), 0.0)]
