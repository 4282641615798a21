"""What the user of the studio should know of cones that were set by hand: said on the page, and noted on the result."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

from ...base import MAX_CONE_ANGLE, MIN_CONE_ANGLE, list_some, plural
from .choices import Choices
from .paint import Region

if TYPE_CHECKING:
    from ... import Flattening


def misplaced(chosen: Choices) -> tuple[str, ...]:
    """Return a sentence on cones that lie where none are to be, as painted, which binds searches alone."""
    inside = within(chosen.paint.no_cone, [cone.vertex for cone in chosen.cones])
    if not inside:
        return ()
    verb = "lies" if len(inside) == 1 else "lie"
    return (
        f"{plural(len(inside), 'cone')} set by hand or locked {verb} where none are to be, as painted: "
        f"{_vertices(inside)}. Searches keep off such places; what is set by hand stays.",
    )


def within(region: Region, vertices: Iterable[int]) -> list[int]:
    """Return those of some vertices that are in a region."""
    runs = region.runs
    firsts = [first for first, _ in runs]

    def is_inside(vertex: int) -> bool:
        at = bisect_right(firsts, vertex) - 1
        return at >= 0 and vertex <= runs[at][1]

    return [vertex for vertex in vertices if is_inside(vertex)]


def strained(chosen: Choices, result: Flattening) -> tuple[str, ...]:
    """Return a sentence on cones of a result whose angle is out of bounds, as those that were typed leave no other."""
    least, most = MIN_CONE_ANGLE, MAX_CONE_ANGLE
    typed = {cone.vertex for cone in chosen.cones if cone.angle is not None}
    if not (chosen.by_hand and typed):
        return ()
    slack = 1e-9 * most  # rounding
    names = result.cones if result.vertex_origin is None else result.vertex_origin[result.cones]
    angles = 2 * math.pi - result.curvatures
    off = [
        f"vertex {vertex} {math.degrees(angle):.4g}"
        for vertex, angle in sorted(zip(names.tolist(), angles.tolist(), strict=True))
        if vertex not in typed and not least - slack <= angle <= most + slack
    ]
    if not off:
        return ()
    return (
        f"The angles that are typed leave {plural(len(off), 'cone')} none from {math.degrees(least):g} to "
        f"{math.degrees(most):g} degrees: {list_some(off)}. Type others, or add a cone whose angle is computed.",
    )


def noted(result: Flattening, chosen: Choices) -> Flattening:
    """Return a result of what was chosen with what is to be known of it among its notes."""
    return replace(result, notes=(*result.notes, *misplaced(chosen), *strained(chosen, result)))


def _vertices(vertices: list[int]) -> str:
    return f"{'vertex' if len(vertices) == 1 else 'vertices'} {list_some(vertices)}"
