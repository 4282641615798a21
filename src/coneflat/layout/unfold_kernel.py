"""Unfolding triangles into the plane one after another, compiled."""

from __future__ import annotations

from .._arrays import BoolArray, ComplexArray, FloatArray, IntArray
from ..geometry.compiled import compiled


@compiled
def walk_border(
    twin: IntArray,
    cut: BoolArray,
    turns: ComplexArray,
    start: int,
    border: IntArray,
    frames: ComplexArray,
) -> int:
    """Fill the half-edges of a border loop, in order, and the frames of their triangles.

    The walk starts in the frame of the first triangle and carries it around each vertex through the fan of
    triangles inside. Returns the length n of the loop; frames[n] is where the first frame has come to.
    """
    count = 0
    h = start
    frame = 1.0 + 0.0j
    while True:
        border[count] = h
        frames[count] = frame
        count += 1
        h = h - h % 3 + (h + 1) % 3
        while twin[h] >= 0 and not cut[h]:
            frame *= turns[h]
            frame /= abs(frame)
            h = twin[h]
            h = h - h % 3 + (h + 1) % 3
        if h == start:
            frames[count] = frame
            return count


@compiled
def spread(
    twin: IntArray,
    cut: BoolArray,
    sides: ComplexArray,
    turns: ComplexArray,
    corner: IntArray,
    queue: IntArray,
    last: int,
    reached: BoolArray,
    frame: ComplexArray,
    placed: BoolArray,
    points: ComplexArray,
) -> int:
    """Lay out, breadth first, all triangles that can be reached from the `last` ones in the queue.

    corner: (3m,) vertex of the cut mesh at each corner. Triangles in the queue are reached, have frames,
    and at least one corner placed. Returns the length of the queue: all triangles laid out.
    """
    first = 0
    while first < last:
        f = queue[first]
        first += 1
        # Side h runs from corner h + 1 to corner h + 2; the second round closes the gaps of the first.
        for step in range(6):
            start, end = corner[3 * f + (step + 1) % 3], corner[3 * f + (step + 2) % 3]
            if placed[start] and not placed[end]:
                points[end] = points[start] + frame[f] * sides[3 * f + step % 3]
                placed[end] = True
        for h in range(3 * f, 3 * f + 3):
            t = twin[h]
            if t >= 0 and not cut[h] and not reached[t // 3]:
                turned = frame[f] * turns[h]
                frame[t // 3] = turned / abs(turned)
                reached[t // 3] = True
                queue[last] = t // 3
                last += 1
    return last


@compiled
def gap_forces(
    corner: IntArray,
    sides: ComplexArray,
    weight: FloatArray,
    frame: ComplexArray,
    points: ComplexArray,
    force: ComplexArray,
) -> None:
    """Add up, at each vertex, how far it lies from where the sides of its triangles put it.

    Weights of one over the squared length of a side make relative gaps what is measured.
    """
    force[:] = 0.0
    for h in range(len(sides)):
        start = corner[h - h % 3 + (h + 1) % 3]
        end = corner[h - h % 3 + (h + 2) % 3]
        gap = (frame[h // 3] * sides[h] - (points[end] - points[start])) * weight[h]
        force[end] += gap
        force[start] -= gap


@compiled
def apply_stiffness(corner: IntArray, weight: FloatArray, shift: ComplexArray, force: ComplexArray) -> None:
    """Fill the force at each vertex by which springs along the sides resist a shift of the vertices."""
    force[:] = 0.0
    for h in range(len(weight)):
        start = corner[h - h % 3 + (h + 1) % 3]
        end = corner[h - h % 3 + (h + 2) % 3]
        pull = weight[h] * (shift[end] - shift[start])
        force[end] += pull
        force[start] -= pull
