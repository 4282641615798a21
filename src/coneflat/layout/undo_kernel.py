"""Undoing edge flips in a flat metric, compiled."""

from __future__ import annotations

import math

from .._arrays import ComplexArray, FloatArray, IntArray
from ..geometry.compiled import compiled


@compiled
def place_triangles(length: FloatArray, sides: ComplexArray) -> None:
    """Fill the three sides of each triangle as vectors in a frame of its own, its longest side along x."""
    for base in range(0, len(length), 3):
        i = 0
        for k in range(1, 3):
            if length[base + k] > length[base + i]:
                i = k
        h, h1, h2 = base + i, base + (i + 1) % 3, base + (i + 2) % 3
        a, b, c = length[h], length[h1], length[h2]
        slack_a = max(min(b, c) - (a - max(b, c)), 0.0)
        slack_b = min(c, a) - (b - max(c, a))
        slack_c = min(a, b) - (c - max(a, b))
        perimeter = a + b + c
        height = math.sqrt(perimeter * slack_a * slack_b * slack_c) / (2 * a)
        # b and c times the cosines at the longest side, through the slacks: short sides keep their digits.
        sides[h] = complex(a, 0.0)
        sides[h1] = complex(-(perimeter * slack_c - slack_a * slack_b) / (4 * a), height)
        sides[h2] = complex(-(perimeter * slack_b - slack_a * slack_c) / (4 * a), -height)


@compiled
def find_turns(twin: IntArray, sides: ComplexArray, turns: ComplexArray) -> None:
    """Fill the unit number that takes the frame of the twin's triangle to that of each half-edge's own."""
    for h in range(len(twin)):
        t = twin[h]
        if t > h:
            turn = -sides[h] * sides[t].conjugate()
            turns[h] = turn / abs(turn)
            turns[t] = turns[h].conjugate()
        elif t < 0:
            turns[h] = 1.0


@compiled
def undo_flips(
    twin: IntArray, tail: IntArray, sides: ComplexArray, turns: ComplexArray, flips: IntArray
) -> None:
    """Undo flips, the last one first, each by unfolding its two triangles into the plane.

    The frames of triangles are carried along: vectors are added and turned, never divided by a side, which
    may have length zero on the way.
    """
    for k in range(len(flips) - 1, -1, -1):
        h = flips[k]
        t = twin[h]
        h1 = h - h % 3 + (h + 1) % 3
        h2 = h - h % 3 + (h + 2) % 3
        t1 = t - t % 3 + (t + 1) % 3
        t2 = t - t % 3 + (t + 2) % 3
        turn = turns[h]
        # The edge turns clockwise: sides move h1 to h2, h2 to t1, t1 to t2, t2 to h1; of these the second
        # changes from the frame of h to that of t, the fourth from t to h.
        old = (h1, h2, t1, t2)
        new = (h2, t1, t2, h1)
        into = (1.0 + 0.0j, turn.conjugate(), 1.0 + 0.0j, turn)
        moved = (sides[h1], sides[h2] * into[1], sides[t1], sides[t2] * into[3])
        twins = (twin[h1], twin[h2], twin[t1], twin[t2])
        outer = (turns[h1], turns[h2], turns[t1], turns[t2])
        p, u, q, v = tail[h1], tail[h2], tail[t1], tail[t2]
        for i in range(4):
            other, total = twins[i], into[i] * outer[i]
            for j in range(4):
                if twins[i] == old[j]:
                    other = new[j]
                    total *= into[j].conjugate()
            total /= abs(total)
            sides[new[i]] = moved[i]
            twin[new[i]] = other
            turns[new[i]] = total
            if other >= 0:
                twin[other] = new[i]
                turns[other] = total.conjugate()
        sides[h] = -(sides[h1] + sides[h2])
        sides[t] = -sides[h] * turn.conjugate()
        tail[h], tail[h1], tail[h2] = u, v, p
        tail[t], tail[t1], tail[t2] = v, u, q
