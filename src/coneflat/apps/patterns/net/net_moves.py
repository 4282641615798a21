"""Moves of subtrees of a net: where they are cut off, and where they are attached."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ....base import IntArray, compiled
from .net_kernels import Faces, Placement, Space, Walk, attach, find_all_collisions, place_joined, walk_joined

# Largest number of collisions that are listed, per triangle: with more, a tree is not worth untangling.
COLLISIONS_PER_TRIANGLE = 40
# Constants of a linear congruential generator (Knuth).
MULTIPLIER, INCREMENT = 6364136223846793005, 1442695040888963407


class Workspace(NamedTuple):
    """Space for a search.

    Attributes:
        walk: for walks.
        space: for moved triangles.
        pairs: (p, 2) the pairs of triangles that overlap.
        added: (p, 2) pairs that a move would add.
        loads: (f,) sizes of subtrees.
        path: (f,) hinges of a path.
        candidates: (h,) hinges.
        owner: (m,) the face of each triangle.
        seed: (1,) the state of the random numbers.
    """

    walk: Walk
    space: Space
    pairs: IntArray
    added: IntArray
    loads: IntArray
    path: IntArray
    candidates: IntArray
    owner: IntArray
    seed: IntArray


def workspace_of(faces: Faces) -> Workspace:
    """Return the space for searches of a polyhedron."""
    f, m, h = len(faces.starts) - 1, len(faces.triangles), len(faces.hinge_faces)
    integers = [np.empty(f, dtype=np.int64) for _ in range(6)]
    space = Space(
        np.empty(m, dtype=np.int64),
        np.empty((m, 6)),
        np.empty((m, 4)),
        np.empty(m, dtype=np.int64),
        np.empty(4),
    )
    pairs, added = np.empty((2, COLLISIONS_PER_TRIANGLE * m + 100, 2), dtype=np.int64)
    owner = np.repeat(np.arange(f), np.diff(faces.starts))
    candidates, seed = np.empty(h, dtype=np.int64), np.array([1], dtype=np.int64)
    return Workspace(
        Walk(*integers[:4]), space, pairs, added, integers[4], integers[5], candidates, owner, seed
    )


@compiled
def random_below(seed: IntArray, bound: int) -> int:
    """Return a random integer from 0 to bound - 1."""
    seed[0] = seed[0] * MULTIPLIER + INCREMENT
    return ((seed[0] >> 33) & 0x7FFFFFFF) % bound


@compiled
def place_pieces(faces: Faces, net: Placement, walk: Walk) -> int:
    """Place all pieces as their joined hinges say, and number them; return the number of pieces."""
    net.piece[:] = -1
    number = 0
    for start in range(len(net.piece)):
        if net.piece[start] < 0:
            count = walk_joined(faces, net.is_joined, start, -1, walk)
            net.frames[start, 0], net.frames[start, 1], net.frames[start, 2:] = 1.0, 0.0, 0.0
            place_joined(faces, net, walk, count)
            for k in range(count):
                net.piece[walk.faces[k]] = number
            number += 1
    return number


@compiled
def path_between(faces: Faces, net: Placement, start: int, end: int, work: Workspace) -> int:
    """Write the joined hinges between two faces of a piece, and the sizes of all subtrees; return their number.

    `work.walk` is left as the walk from the start.
    """
    count = walk_joined(faces, net.is_joined, start, -1, work.walk)
    for k in range(count):
        face = work.walk.faces[k]
        work.loads[k] = faces.starts[face + 1] - faces.starts[face]
    for k in range(count - 1, 0, -1):
        work.loads[work.walk.before[k]] += work.loads[k]
    k, number = work.walk.place[end], 0
    while k > 0:
        work.path[number] = k
        number += 1
        k = work.walk.before[k]
    return number


@compiled
def walk_smaller_side(faces: Faces, net: Placement, place: int, work: Workspace) -> tuple[int, int]:
    """Walk through the smaller side of a hinge, given by its place in a walk; return the hinge and its size."""
    walk = work.walk
    hinge = walk.hinges[place]
    is_far = 2 * work.loads[place] <= work.loads[0]
    start = walk.faces[place] if is_far else walk.faces[walk.before[place]]
    return hinge, walk_joined(faces, net.is_joined, start, hinge, walk)


@compiled
def move_side(faces: Faces, net: Placement, count: int, cut: int, hinge: int, work: Workspace) -> None:
    """Detach the faces of a walk at a hinge (-1: nowhere), and attach them at another."""
    walk = work.walk
    fixed, moving = faces.hinge_faces[hinge, 0], faces.hinge_faces[hinge, 1]
    if walk.place[fixed] >= 0:
        fixed, moving = moving, fixed
    if cut >= 0:
        net.is_joined[cut] = False
    for k in range(count):
        net.piece[walk.faces[k]] = net.piece[fixed]
    attach(faces, net.frames, hinge, fixed, net.frames[moving])
    count = walk_joined(faces, net.is_joined, moving, -1, walk)
    place_joined(faces, net, walk, count)
    net.is_joined[hinge] = True


@compiled
def choose_cut(number: int, work: Workspace) -> int:
    """Return a random place of a path, small subtrees with greater probability."""
    total = 0.0
    for i in range(number):
        load = work.loads[work.path[i]]
        total += 1.0 / min(load, work.loads[0] - load)
    target = total * random_below(work.seed, 1 << 30) / (1 << 30)
    for i in range(number):
        load = work.loads[work.path[i]]
        target -= 1.0 / min(load, work.loads[0] - load)
        if target < 0:
            return work.path[i]
    return work.path[number - 1]


@compiled
def list_candidates(faces: Faces, count: int, cut: int, work: Workspace) -> int:
    """Write the hinges at which the faces of a walk could be attached; return their number."""
    number = 0
    for k in range(count):
        face = work.walk.faces[k]
        for j in range(faces.hinge_starts[face], faces.hinge_starts[face + 1]):
            hinge = faces.hinges[j]
            neighbour = faces.hinge_faces[hinge, 0] + faces.hinge_faces[hinge, 1] - face
            if hinge != cut and work.walk.place[neighbour] < 0:
                work.candidates[number] = hinge
                number += 1
    return number


@compiled
def place_and_collide(faces: Faces, net: Placement, work: Workspace) -> int:
    """Place the pieces; return the number of pairs that overlap, written to `work.pairs`."""
    place_pieces(faces, net, work.walk)
    return find_all_collisions(faces, net, work.owner, work.pairs)
