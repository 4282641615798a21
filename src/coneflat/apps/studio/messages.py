"""What the page says: messages in its words, and warnings of cones that were set by hand.

The warnings are noted on the result, too.
"""

from __future__ import annotations

import math
import re
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

from ...base import MAX_CONE_ANGLE, MIN_CONE_ANGLE, list_some, plural
from ...mesh import REPAIR_ADVICE
from .choices import Choices
from .paint import Region

if TYPE_CHECKING:
    from ... import Flattening

#: By the name of an option: what is written on the control that sets it.
CONTROLS = {
    "distortion": "Distortion",
    "cone_count": "Number",
    "required_cones": "Lock",
    "forbidden_cones": "No cones",
    "weights": "Important",
    "seams": "Keep those of the file's UVs",
    "no_seams": "No seams",
    "sharp_angle": "Cut edges sharper than",
    "hide_seams": "Hide them",
    "boundary": "Boundary",
    "stretch": "From angles to areas",
    "charts": "Charts",
    "resolution": "Texels a side",
    "padding": "Texels between charts",
    "repair": "Repair the mesh",
}
#: A flag, or a name that is not a word; a name that is one means an option where a message begins with it.
_NAMED = re.compile(
    r"--(?P<flag>[a-z]+(?:-[a-z]+)*)(?: (?:greedy|exact|linear)\b)?"
    rf"|\b(?P<name>{'|'.join(name for name in CONTROLS if '_' in name)})\b"
    rf"|\A(?P<first>{'|'.join(CONTROLS)})(?= (?:must|cannot|is|needs)\b)"
)


def in_page(message: str) -> str:
    """Return a message with the page's controls for options and flags; of those without one, whose flag it is."""
    return _NAMED.sub(_control, message.replace(REPAIR_ADVICE, "repair the mesh"))


def _control(found: re.Match[str]) -> str:
    flag = found["flag"]
    name = flag.replace("-", "_") if flag else found["name"] or found["first"]
    return f"“{CONTROLS[name]}”" if name in CONTROLS else f"{found[0]} of coneflat flatten"


def misplaced(chosen: Choices) -> tuple[str, ...]:
    """Return a sentence on cones that lie where none are to be, as painted, which binds searches alone."""
    inside = within(chosen.paint.no_cone, [cone.vertex for cone in chosen.cones])
    if not inside:
        return ()
    verb, what = ("lies", "vertex") if len(inside) == 1 else ("lie", "vertices")
    return (
        f"{plural(len(inside), 'cone')} set by hand or locked {verb} where none are to be, as painted: "
        f"{what} {list_some(inside)}. Searches keep off such places; what is set by hand stays.",
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
