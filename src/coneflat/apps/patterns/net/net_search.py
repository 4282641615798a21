"""The search for nets: trees of faces, of which subtrees are moved until no two faces of a piece overlap."""

from __future__ import annotations

import math

import numpy as np

from ....base import BoolArray, FloatArray, IntArray, compiled
from .net_kernels import Faces, Placement, find_collisions, walk_joined
from .net_moves import (
    Workspace,
    choose_cut,
    list_candidates,
    move_side,
    path_between,
    random_below,
    walk_smaller_side,
)

# Hinges that are tried for each subtree that moves.
TRIED_HINGES = 12
# Mean number of additional collisions that a move may cause: it falls from HOT to 0 in each cycle of comparisons.
HOT, CYCLE = 4.0, 10**8


@compiled
def keep_joined_pairs(work: Workspace, number: int) -> int:
    """Keep those of the first pairs of `work.pairs` that `work.walk` does not separate, and return their number."""
    remaining = 0
    for i in range(number):
        is_first = work.walk.place[work.owner[work.pairs[i, 0]]] >= 0
        if is_first == (work.walk.place[work.owner[work.pairs[i, 1]]] >= 0):
            work.pairs[remaining] = work.pairs[i]
            remaining += 1
    return remaining


@compiled
def untangle(
    faces: Faces,
    net: Placement,
    lengths: FloatArray,
    number: int,
    budget: int,
    work: Workspace,
    result: BoolArray,
) -> tuple[int, int]:
    """Move subtrees until no pair of triangles of a piece overlaps, or the budget is spent.

    Simulated annealing: a random pair is chosen, a hinge of the path between its faces is cut, and the smaller side is
    attached where it causes the fewest collisions.

    Args:
        faces, net: the faces and where they are.
        lengths: (h,) lengths of the hinges; among equal moves, longer ones are joined.
        number: pairs in `work.pairs`.
        budget: the number of comparisons of boxes.
        work: space.
        result: (h,) the joined hinges with the fewest collisions on return.

    Returns:
        The number of collisions of the result, and the comparisons made.
    """
    fewest, spent = number, 0
    result[:] = net.is_joined
    while number > 0 and spent < budget:
        pair = work.pairs[random_below(work.seed, number)]
        first, second = work.owner[pair[0]], work.owner[pair[1]]
        steps = path_between(faces, net, first, second, work)
        cut, count = walk_smaller_side(faces, net, choose_cut(steps, work), work)
        spent += 4 * len(net.piece)
        resolved = 0
        for i in range(number):
            is_first = work.walk.place[work.owner[work.pairs[i, 0]]] >= 0
            resolved += is_first != (work.walk.place[work.owner[work.pairs[i, 1]]] >= 0)
        temperature = HOT * (1 - (spent % CYCLE) / CYCLE)
        slack = int(-temperature * math.log((1 + random_below(work.seed, 1 << 30)) / (1 << 30)))
        limit = min(resolved + slack + 1, len(work.pairs) - number + resolved)
        choices = list_candidates(faces, count, cut, work)
        chosen, least_added = -1, limit
        for i in range(min(choices, TRIED_HINGES)):
            j = i + random_below(work.seed, choices - i)
            hinge = work.candidates[j]
            work.candidates[j] = work.candidates[i]
            added, comparisons = find_collisions(
                faces, net, work.walk, count, hinge, min(least_added + 1, limit), work.space, work.added
            )
            spent += comparisons
            if added < least_added or (added == least_added < limit and lengths[hinge] > lengths[chosen]):
                chosen, least_added = hinge, added
        if chosen < 0:
            continue
        find_collisions(faces, net, work.walk, count, chosen, limit, work.space, work.added)
        remaining = keep_joined_pairs(work, number)
        work.pairs[remaining : remaining + least_added] = work.added[:least_added]
        number = remaining + least_added
        move_side(faces, net, count, cut, chosen, work)
        if number < fewest:
            fewest = number
            result[:] = net.is_joined
    return fewest, spent


@compiled
def cut_collisions(faces: Faces, net: Placement, lengths: FloatArray, number: int, work: Workspace) -> None:
    """Cut hinges until no pair of `work.pairs` is in the same piece, each time the one between the most pairs."""
    counts = np.zeros(len(lengths), np.int64)
    while number > 0:
        counts[:] = 0
        for i in range(number):
            first, second = work.owner[work.pairs[i, 0]], work.owner[work.pairs[i, 1]]
            steps = path_between(faces, net, first, second, work)
            for j in range(steps):
                counts[work.walk.hinges[work.path[j]]] += 1
        cut = 0
        for hinge in range(len(lengths)):
            if counts[hinge] > counts[cut] or (
                counts[hinge] == counts[cut] and lengths[hinge] < lengths[cut]
            ):
                cut = hinge
        net.is_joined[cut] = False
        walk_joined(faces, net.is_joined, faces.hinge_faces[cut, 0], -1, work.walk)
        number = keep_joined_pairs(work, number)


@compiled
def join_longest(
    faces: Faces, net: Placement, lengths: FloatArray, order: IntArray, budget: int, work: Workspace
) -> tuple[int, int]:
    """Join pieces at hinges where nothing overlaps, and exchange joined hinges for longer ones; return the changes.

    Args:
        faces, net: the faces and where they are, without collisions.
        lengths: (h,) lengths of the hinges.
        order: (h,) hinges in the order in which they are tried.
        budget: the number of comparisons of boxes.
        work: space.

    Returns:
        The number of changes, and the comparisons made.
    """
    changes, spent = 0, 0
    for hinge in order:
        first, second = faces.hinge_faces[hinge, 0], faces.hinge_faces[hinge, 1]
        if net.is_joined[hinge] or spent > budget:
            continue
        spent += 4 * len(net.piece)
        cut = -1
        if net.piece[first] == net.piece[second]:
            steps = path_between(faces, net, first, second, work)
            shortest = work.path[0]
            for i in range(steps):
                if lengths[work.walk.hinges[work.path[i]]] < lengths[work.walk.hinges[shortest]]:
                    shortest = work.path[i]
            if lengths[work.walk.hinges[shortest]] >= lengths[hinge]:
                continue
            cut, count = walk_smaller_side(faces, net, shortest, work)
        else:
            count = walk_joined(faces, net.is_joined, second, -1, work.walk)
        added, comparisons = find_collisions(faces, net, work.walk, count, hinge, 1, work.space, work.added)
        spent += comparisons
        if added == 0:
            move_side(faces, net, count, cut, hinge, work)
            changes += 1
    return changes, spent


@compiled
def join_at(faces: Faces, net: Placement, hinge: int, limit: int, work: Workspace) -> tuple[int, int]:
    """Join two pieces at a hinge if fewer than `limit` pairs then overlap, and write them to `work.pairs`.

    Returns:
        The number of pairs, `limit` if the pieces were not joined, and the comparisons made.
    """
    count = walk_joined(faces, net.is_joined, faces.hinge_faces[hinge, 1], -1, work.walk)
    number, spent = find_collisions(faces, net, work.walk, count, hinge, limit, work.space, work.pairs)
    if number < limit:
        move_side(faces, net, count, -1, hinge, work)
    return number, spent
