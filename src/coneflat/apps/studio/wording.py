"""Messages in the words of the page: its controls for the options that they name."""

from __future__ import annotations

import re

from ...mesh import REPAIR_ADVICE

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
#: A flag, or a name that is no word; a name that is one means an option where a message begins with it.
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
