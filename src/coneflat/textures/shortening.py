"""Seams of a candidate with their tips moved to where the energy is about the largest allowed."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from ..base import IntArray, each_within_time, part_of_work, within_time
from ..stages import Layout
from .candidates import TOLERANCE, Candidate, CutModel, points_near
from .free_seams import recut, seam_edges
from .tips import find_tips, moved_tips, moves_for

# Number of times that tips are moved to meet the bound, half as often if it is met already: as often takes 10% longer,
# for seams 0.2% shorter.
MAX_TRIES = 4
# Energy below the bound, relative to what is allowed above that of an isometry, that is not used for shorter seams.
ENOUGH_SLACK = 2 * TOLERANCE
# Fraction of the work that is left, for the progress, that a try is.
TRY_SHARE = 0.4
# Tips of larger meshes are moved on their coarse meshes only: a try takes seconds.
MANY_TRIANGLES = 60_000


def shortened(model: CutModel, start: Candidate) -> Candidate:
    """Return a candidate with the tips of its seams moved to where its energy is about the largest allowed.

    Args:
        model: the model of its component.
        start: the candidate; it is returned itself if no moves improve it.
    """
    start = model.separated(start)
    if model.bound.largest < start.energy <= model.settled_bound:
        start = within_time(lambda: model.settled(start)) or start
    return _best_of_moved(model, start)


def cut_further(model: CutModel, candidate: Candidate, layout: Layout) -> Candidate:
    """Return a candidate whose layout was cut further, with its points relaxed and the tips of its seams moved."""
    candidate = model.separated(candidate)
    candidate = replace(candidate, layout=layout, cost=model.cost_of(layout))
    is_large = len(model.component.faces) > MANY_TRIANGLES
    if not is_large or model.bound.largest < candidate.energy <= model.settled_bound:
        candidate = within_time(lambda: model.settled(candidate)) or candidate
    return _best_of_moved(model, candidate)


def _best_of_moved(model: CutModel, start: Candidate) -> Candidate:
    """Return the candidate with moved tips whose seams cost least, or the start if none is better."""
    slack = (model.bound.largest - start.energy) / model.bound.allowed
    if len(model.component.faces) > MANY_TRIANGLES or 0 <= slack <= ENOUGH_SLACK:
        return start
    candidates = [c for c in each_within_time(model.separated, _with_moved_tips(model, start)) if c]
    for candidate in sorted(candidates, key=lambda candidate: candidate.cost):
        settled = candidate if model.is_within(candidate) else within_time(partial(model.settled, candidate))
        if settled is None:
            break
        is_better = settled.cost < start.cost or not model.is_within(start)
        if model.is_within(settled) and is_better:
            return settled
    return start


def _with_moved_tips(model: CutModel, start: Candidate) -> list[Candidate]:
    """Return candidates with the tips of the seams moved, so that the energy is about the largest allowed."""
    seams, bound, candidates = seam_edges(start.layout), model.bound, list[Candidate]()
    tips = within_time(lambda: find_tips(start.layout, seams, model.costs))
    if tips is None or not (bound.is_finite and (tips.rates > 0).any()):
        return candidates
    # The middle of the energies that are near enough to the bound.
    goal = bound.largest - ENOUGH_SLACK / 2 * bound.allowed
    slack, cuts = goal - start.energy, [seams]
    for _ in range(MAX_TRIES // 2 if slack > 0 else MAX_TRIES):
        moved, cones = moved_tips(start.layout, seams, tips, moves_for(start.layout, tips, slack))
        if any(np.array_equal(moved, cut) for cut in cuts):
            # The tips move by whole edges.
            slack += np.sign(slack) * bound.allowed / 4
            continue
        if not (len(moved) or model.component.mesh.is_boundary_edge.any()):
            break  # not a disk
        cuts.append(moved)
        with part_of_work(TRY_SHARE, "moving the ends of seams"):
            candidate = within_time(partial(_recut, model, start, seams, moved, cones))
        if candidate is None:
            break
        excess = candidate.energy - bound.largest
        if candidate.energy <= model.settled_bound:
            candidates.append(candidate)
        # A start beyond the bound only has to get within it: the tips move again after the cuts for packing.
        if excess <= 0 and (excess >= -ENOUGH_SLACK * bound.allowed or not model.is_within(start)):
            break
        excess = candidate.energy - goal
        slack = slack - excess if (slack - excess) * slack > 0 else slack / 2
    return candidates


def _recut(model: CutModel, start: Candidate, seams: IntArray, moved: IntArray, cones: IntArray) -> Candidate:
    """Return a candidate with other seams: only the points near those that differ move.

    Args:
        model, start: the model, and the candidate.
        seams, moved: (k,), (j,) its seams, and the others.
        cones: (s,) vertices at which the others may end.
    """
    layout = replace(recut(start.layout, moved), cones=cones)
    candidate = model.candidate(layout, start.distortion, points_near(layout, np.setxor1d(seams, moved)))
    return replace(candidate, settled=start.settled)
