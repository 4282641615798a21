"""Rigid faces in the plane, joined at hinges: where they are placed, and which of them collide."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ....base import BoolArray, FloatArray, IntArray, compiled


class Faces(NamedTuple):
    """Faces of a polyhedron of m triangles, sorted by face, and the hinges between them.

    Attributes:
        starts: (f + 1,) the first triangle of each face, and m.
        triangles: (m, 6) x and y of their corners in the frame of the face, counterclockwise.
        sides: (m, 3) lengths of the sides; side i runs from corner i to corner i + 1.
        hinge_faces: (h, 2) the two faces of each hinge.
        hinge_ends: (h, 2, 4) x and y of its ends in the frames of both.
        hinge_starts, hinges: (f + 1,) and (2h,) the hinges of each face.
        touching: depth up to which triangles touch and do not overlap.
    """

    starts: IntArray
    triangles: FloatArray
    sides: FloatArray
    hinge_faces: IntArray
    hinge_ends: FloatArray
    hinge_starts: IntArray
    hinges: IntArray
    touching: float


class Placement(NamedTuple):
    """Faces in the plane. Those joined at hinges form trees, the pieces.

    Attributes:
        is_joined: (h,) whether the faces are joined at each hinge.
        piece: (f,) the piece of each face.
        frames: (f, 4) cosine and sine of the rotation of each face, and its shift.
        triangles: (m, 6) the corners.
        boxes: (m, 4) bounding boxes x0, y0, x1, y1.
    """

    is_joined: BoolArray
    piece: IntArray
    frames: FloatArray
    triangles: FloatArray
    boxes: FloatArray


class Walk(NamedTuple):
    """Space for a walk through joined faces.

    Attributes:
        faces: (f,) the faces in breadth-first order.
        hinges: (f,) the hinge through which each of them was reached, -1 for the first.
        before: (f,) the place in the order of the face from which it was reached.
        place: (f,) the place of each face in the order; -1 for faces that were not reached.
    """

    faces: IntArray
    hinges: IntArray
    before: IntArray
    place: IntArray


@compiled
def walk_joined(faces: Faces, is_joined: BoolArray, start: int, barred: int, walk: Walk) -> int:
    """Write the faces that are joined with one, without crossing a barred hinge; return their number."""
    walk.place[:] = -1
    walk.faces[0], walk.hinges[0], walk.before[0], walk.place[start] = start, -1, -1, 0
    first, count = 0, 1
    while first < count:
        face = walk.faces[first]
        for k in range(faces.hinge_starts[face], faces.hinge_starts[face + 1]):
            hinge = faces.hinges[k]
            if is_joined[hinge] and hinge != barred:
                neighbour = faces.hinge_faces[hinge, 0] + faces.hinge_faces[hinge, 1] - face
                if walk.place[neighbour] < 0:
                    walk.place[neighbour] = count
                    walk.faces[count], walk.hinges[count], walk.before[count] = neighbour, hinge, first
                    count += 1
        first += 1
    return count


@compiled
def attach(faces: Faces, frames: FloatArray, hinge: int, fixed: int, frame: FloatArray) -> None:
    """Write the frame (4,) of the face at a hinge that is unfolded next to a fixed one."""
    side = 0 if faces.hinge_faces[hinge, 0] == fixed else 1
    fixed_ends, moving_ends = faces.hinge_ends[hinge, side], faces.hinge_ends[hinge, 1 - side]
    c, s = frames[fixed, 0], frames[fixed, 1]
    x, y = (fixed_ends[0] + fixed_ends[2]) / 2, (fixed_ends[1] + fixed_ends[3]) / 2
    u, v = fixed_ends[2] - fixed_ends[0], fixed_ends[3] - fixed_ends[1]
    target_u, target_v = c * u - s * v, s * u + c * v
    local_u, local_v = moving_ends[2] - moving_ends[0], moving_ends[3] - moving_ends[1]
    cosine, sine = local_u * target_u + local_v * target_v, local_u * target_v - local_v * target_u
    size = math.hypot(cosine, sine)
    frame[0], frame[1] = cosine / size, sine / size
    local_x, local_y = (moving_ends[0] + moving_ends[2]) / 2, (moving_ends[1] + moving_ends[3]) / 2
    frame[2] = c * x - s * y + frames[fixed, 2] - (frame[0] * local_x - frame[1] * local_y)
    frame[3] = s * x + c * y + frames[fixed, 3] - (frame[1] * local_x + frame[0] * local_y)


@compiled
def move_triangle(corners: FloatArray, frame: FloatArray, moved: FloatArray, box: FloatArray) -> None:
    """Write a triangle (6,) after a rotation and a shift (4,), and its bounding box (4,)."""
    box[0], box[1], box[2], box[3] = np.inf, np.inf, -np.inf, -np.inf
    for i in range(0, 6, 2):
        x = frame[0] * corners[i] - frame[1] * corners[i + 1] + frame[2]
        y = frame[1] * corners[i] + frame[0] * corners[i + 1] + frame[3]
        moved[i], moved[i + 1] = x, y
        box[0], box[1], box[2], box[3] = min(box[0], x), min(box[1], y), max(box[2], x), max(box[3], y)


@compiled
def place_joined(faces: Faces, net: Placement, walk: Walk, count: int) -> None:
    """Write the frames and triangles of the faces of a walk, whose first frame is given."""
    for k in range(count):
        face = walk.faces[k]
        if walk.before[k] >= 0:
            attach(faces, net.frames, walk.hinges[k], walk.faces[walk.before[k]], net.frames[face])
        for t in range(faces.starts[face], faces.starts[face + 1]):
            move_triangle(faces.triangles[t], net.frames[face], net.triangles[t], net.boxes[t])


@compiled
def _lies_outside(first: FloatArray, sides: FloatArray, second: FloatArray, touching: float) -> bool:
    """Return whether a side of a triangle has the other triangle on its right, but for touching."""
    for i in range(3):
        x, y = first[2 * i], first[2 * i + 1]
        u, v = first[(2 * i + 2) % 6] - x, first[(2 * i + 3) % 6] - y
        limit = touching * sides[i]
        if (
            u * (second[1] - y) - v * (second[0] - x) <= limit
            and u * (second[3] - y) - v * (second[2] - x) <= limit
            and u * (second[5] - y) - v * (second[4] - x) <= limit
        ):
            return True
    return False


@compiled
def triangles_overlap(
    faces: Faces, first: int, place: FloatArray, second: int, second_place: FloatArray
) -> bool:
    """Return whether two triangles at places (6,) in the plane overlap by more than they may touch."""
    return not _lies_outside(place, faces.sides[first], second_place, faces.touching) and not _lies_outside(
        second_place, faces.sides[second], place, faces.touching
    )


class Space(NamedTuple):
    """Space for moved triangles.

    Attributes:
        items: (m,) the triangles that move.
        triangles, boxes: (m, 6) and (m, 4) where they are moved.
        nearby: (m,) triangles that may collide with them.
        frame: (4,) the motion.
    """

    items: IntArray
    triangles: FloatArray
    boxes: FloatArray
    nearby: IntArray
    frame: FloatArray


@compiled
def find_collisions(
    faces: Faces,
    net: Placement,
    walk: Walk,
    count: int,
    hinge: int,
    limit: int,
    space: Space,
    pairs: IntArray,
) -> tuple[int, int]:
    """Write pairs of triangles that would overlap if the faces of a walk were attached at a hinge to a face beyond.

    Args:
        faces, net: the faces and where they are.
        walk, count: the faces that move.
        hinge: a hinge between one of them and a face that does not move, in whose piece collisions count.
        limit: the search ends at this number of pairs.
        space: for moved triangles.
        pairs: (limit or more, 2) a triangle that does not move, and a moved one.

    Returns:
        The number of pairs, and the number of comparisons of boxes.
    """
    fixed, moving = faces.hinge_faces[hinge, 0], faces.hinge_faces[hinge, 1]
    if walk.place[fixed] >= 0:
        fixed, moving = moving, fixed
    attach(faces, net.frames, hinge, fixed, space.frame)
    # The motion from where the faces are now.
    c, s, x, y = net.frames[moving, 0], net.frames[moving, 1], net.frames[moving, 2], net.frames[moving, 3]
    cosine, sine = space.frame[0] * c + space.frame[1] * s, space.frame[1] * c - space.frame[0] * s
    space.frame[2] -= cosine * x - sine * y
    space.frame[3] -= sine * x + cosine * y
    space.frame[0], space.frame[1] = cosine, sine
    x0, y0, x1, y1 = np.inf, np.inf, -np.inf, -np.inf
    size = 0
    for k in range(count):
        face = walk.faces[k]
        for t in range(faces.starts[face], faces.starts[face + 1]):
            box = space.boxes[size]
            move_triangle(net.triangles[t], space.frame, space.triangles[size], box)
            x0, y0, x1, y1 = min(x0, box[0]), min(y0, box[1]), max(x1, box[2]), max(y1, box[3])
            space.items[size] = t
            size += 1
    close = 0
    for face in range(len(net.piece)):
        if net.piece[face] != net.piece[fixed] or walk.place[face] >= 0:
            continue
        for t in range(faces.starts[face], faces.starts[face + 1]):
            box = net.boxes[t]
            if box[0] < x1 and box[1] < y1 and box[2] > x0 and box[3] > y0:
                space.nearby[close] = t
                close += 1
    number, comparisons = 0, len(net.boxes) + size
    for j in range(close):
        t = space.nearby[j]
        box = net.boxes[t]
        comparisons += size
        for k in range(size):
            moved = space.boxes[k]
            if box[0] < moved[2] and box[1] < moved[3] and box[2] > moved[0] and box[3] > moved[1]:
                u = space.items[k]
                if triangles_overlap(faces, t, net.triangles[t], u, space.triangles[k]):
                    pairs[number, 0], pairs[number, 1] = t, u
                    number += 1
                    if number >= limit:
                        return number, comparisons
    return number, comparisons


@compiled
def find_all_collisions(faces: Faces, net: Placement, owner: IntArray, pairs: IntArray) -> int:
    """Write the pairs of triangles of the same piece that overlap until `pairs` is full; return their number."""
    number = 0
    for t in range(len(owner)):
        for u in range(t + 1, len(owner)):
            if (
                net.boxes[t, 0] < net.boxes[u, 2]
                and net.boxes[t, 1] < net.boxes[u, 3]
                and net.boxes[t, 2] > net.boxes[u, 0]
                and net.boxes[t, 3] > net.boxes[u, 1]
                and owner[t] != owner[u]
                and net.piece[owner[t]] == net.piece[owner[u]]
                and triangles_overlap(faces, t, net.triangles[t], u, net.triangles[u])
            ):
                pairs[number, 0], pairs[number, 1] = t, u
                number += 1
                if number == len(pairs):
                    return number
    return number
