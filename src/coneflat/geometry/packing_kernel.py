"""Inversive distances of circles at the vertices of a triangulation, compiled.

Circles of radii g_i about the vertices with inversive distances I_ij, l_ij^2 = g_i^2 + g_j^2 + 2 I_ij g_i g_j, are
points w_i = g_i v_i of Minkowski space, where <v_i, v_i> = 1 and <v_i, v_j> = -I_ij, and a triangle is the affine one
between its points. The v_i make a hyperbolic surface, which no change of radii changes; the surface of the w_i
bends at an edge as the edge is or is not weighted Delaunay (A. Bobenko and C. Lutz, "Decorated discrete conformal maps
and convex polyhedral cusps", 2023). Both follow from I_ij and g_i, also where l_ij break the triangle inequality.
"""

from __future__ import annotations

import math

from .._arrays import FloatArray, IntArray
from .compiled import compiled


@compiled
def spread(edge: float, one: float, two: float) -> float:
    """Return minus the Gram determinant of three circles with these inversive distances; symmetric in them."""
    return edge * edge + one * one + two * two + 2 * edge * one * two - 1


@compiled
def inversive_distance(length: float, one: float, two: float) -> float:
    """Return the inversive distance of two circles with radii one and two, their centres so far from each other."""
    # 1 and a term with the gap between the circles, which keeps its digits.
    return 1 + (length - (one + two)) * (length + (one + two)) / (2 * (one * two))


@compiled
def tilts(
    tail: IntArray, sides: FloatArray, radius: FloatArray, are_lengths: bool, h: int
) -> tuple[float, float]:
    """Return the slope of the triangle of h along its side h, and a bound of the terms that it is made of.

    An edge is weighted Delaunay if the slopes from both sides do not sum to a negative number. Where the triangle
    exists, its radical centre is at a height over the side with the sign of the slope.

    sides: (3m,) inversive distances, or lengths.
    """
    base = h - h % 3
    h1 = base + (h + 1) % 3
    h2 = base + (h + 2) % 3
    gi, gj, gk = radius[tail[h]], radius[tail[h1]], radius[tail[h2]]
    c, jk, ik = sides[h], sides[h1], sides[h2]
    if are_lengths:
        c, jk, ik = (
            inversive_distance(c, gi, gj),
            inversive_distance(jk, gj, gk),
            inversive_distance(ik, gi, gk),
        )
    up = gk * ((gj + c * gi) * ik + (gi + c * gj) * jk)
    down = gi * gj * (c * c - 1)
    length = math.sqrt(gi * gi + gj * gj + 2 * c * gi * gj)
    size = length * gk * math.sqrt(spread(c, ik, jk))
    return (up - down) / size, (up + abs(down)) / size


@compiled
def other_inversive_distance(e: float, b: float, c: float, b2: float, c2: float) -> float:
    """Return the inversive distance along the other diagonal of the quad of two triangles on the edge e from u to v.

    b, b2 are those of the apices from u; c, c2 from v. e is more than 1: tangent circles need no flip.
    """
    across = b * b2 + c * c2 + e * (b * c2 + b2 * c)
    return (across + math.sqrt(spread(e, b, c) * spread(e, b2, c2))) / (e * e - 1)
