"""Messages of the page: errors in terms of its controls, and warnings on cones that were placed by hand.

The warnings are also added to the notes on the result.
"""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import TYPE_CHECKING

from ...base import MAX_CONE_ANGLE, MIN_CONE_ANGLE, list_some, plural
from ...mesh import REPAIR_ADVICE
from .choices import MORE, Choices

if TYPE_CHECKING:
    from ... import Flattening

#: Label of the control of each option in the page.
CONTROLS = {
    "distortion": "Distortion", "cone_count": "Number", "required_cones": "Lock", "forbidden_cones": "No cones",
    "weights": "Important", "seams": "Seams", "no_seams": "No seams", "sharp_angle": "Cut edges sharper than",
    "hide_seams": "Hide seams", "boundary": "Boundary", "stretch": "From angles to areas", "charts": "Charts",
    "resolution": "Texels per side", "padding": "Texels between charts",
    "texel_density": "Texels per unit of length", "max_energy": "Energy at most", "repair": "Repair the mesh", **MORE,
}  # fmt: skip
#: A flag, or the name of an option; names that are ordinary words count at the beginning of a message only.
_NAMED = re.compile(
    r"--(?P<flag>[a-z]+(?:-[a-z]+)*)(?: (?:greedy|exact|linear)\b)?"
    rf"|\b(?P<name>{'|'.join(name for name in CONTROLS if '_' in name)})\b"
    rf"|\A(?P<first>{'|'.join(CONTROLS)})(?= (?:must|cannot|is|needs)\b)"
)


def page_message(message: str) -> str:
    """Return a message with options and flags replaced by the labels of their controls, if they have one."""
    return _NAMED.sub(_control, message.replace(REPAIR_ADVICE, "repair the mesh"))


def _control(found: re.Match[str]) -> str:
    flag = found["flag"]
    name = flag.replace("-", "_") if flag else found["name"] or found["first"]
    return f"“{CONTROLS[name]}”" if name in CONTROLS else f"{found[0]} of coneflat flatten"


def misplaced_warning(chosen: Choices) -> tuple[str, ...]:
    """Return a sentence on cones in regions painted as "no cones", or nothing; these regions restrict searches only."""
    inside = sorted({cone.vertex for cone in chosen.cones}.intersection(chosen.paint.no_cone.vertices()))
    if not inside or chosen.for_texture:
        return ()
    verb, what = ("lies", "vertex") if len(inside) == 1 else ("lie", "vertices")
    return (
        f"{plural(len(inside), 'cone')} set by hand or locked {verb} in regions painted as “No cones”: "
        f"{what} {list_some(inside)}. Searches avoid these regions; cones set by hand remain.",
    )


def angle_warning(chosen: Choices, result: Flattening) -> tuple[str, ...]:
    """Return a sentence on computed cone angles that are out of bounds because of typed ones, or nothing."""
    least, most = MIN_CONE_ANGLE, MAX_CONE_ANGLE
    typed = {cone.vertex for cone in chosen.cones if cone.angle is not None}
    if chosen.for_texture or not (chosen.by_hand and typed):
        return ()
    slack = 1e-9 * most  # Tolerance for rounding.
    names = result.cones if result.vertex_origin is None else result.vertex_origin[result.cones]
    angles = 2 * math.pi - result.curvatures
    outside = [
        f"vertex {vertex} {math.degrees(angle):.4g}"
        for vertex, angle in sorted(zip(names.tolist(), angles.tolist(), strict=True))
        if vertex not in typed and not least - slack <= angle <= most + slack
    ]
    if not outside:
        return ()
    return (
        f"With the typed angles, {plural(len(outside), 'cone')} cannot have an angle from {math.degrees(least):g} to "
        f"{math.degrees(most):g} degrees: {list_some(outside)}. Change them, or add a cone whose angle is computed.",
    )


def with_warnings(result: Flattening, chosen: Choices) -> Flattening:
    """Return a result with the warnings on the choices added to its notes."""
    return replace(result, notes=(*result.notes, *misplaced_warning(chosen), *angle_warning(chosen, result)))
