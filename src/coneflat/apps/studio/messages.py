"""Texts of the page: errors in terms of its controls, warnings on cones, and choices as a command and as Python.

Warnings are on cones that were placed by hand, and also added to the notes on the result.
"""

from __future__ import annotations

import math
import re
import shlex
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...base import MAX_CONE_ANGLE, MAX_LISTED, MIN_CONE_ANGLE, list_some, plural
from ...mesh import REPAIR_ADVICE
from .choices import FURTHER_OPTIONS, Choices
from .paint import Region

if TYPE_CHECKING:
    from ... import Flattening

#: Label of the control of each option in the page.
CONTROLS = {
    "distortion": "Distortion", "cone_count": "Number", "required_cones": "Lock", "forbidden_cones": "No cones",
    "weights": "Important", "seams": "Seams", "no_seams": "No seams", "sharp_angle": "Cut edges sharper than",
    "hide_seams": "Hide seams", "boundary": "Boundary", "stretch": "From angles to areas", "charts": "Charts",
    "resolution": "Texels per side", "padding": "Texels between charts",
    "texel_density": "Texels per unit of length", "max_energy": "Energy at most", "repair": "Repair the mesh",
    **FURTHER_OPTIONS,
}  # fmt: skip
#: A flag, or the name of an option. Names that are ordinary words count at the beginning of a message, with or without
#: a value, and as the second of two options.
_NAMED = re.compile(
    r"--(?P<flag>[a-z]+(?:-[a-z]+)*)(?: (?:greedy|exact|linear)\b)?"
    rf"|\b(?P<name>{'|'.join(name for name in CONTROLS if '_' in name)})\b"
    rf"|(?:\A|(?<= and ))(?P<first>{'|'.join(CONTROLS)})(?=(?: none| mirrored| '\w+')? (?:and|must|cannot|is|needs)\b)"
)


#: Notes on unmet numbers, by their option.
_UNMET_NUMBERS = {
    "cone_count": re.compile(r"\A[\d,]+ cones? instead of the [\d,]+ asked for"),
    "charts": re.compile(r"\AThe texture has [\d,]+ charts? instead of"),
}


def page_message(message: str) -> str:
    """Return a message with options and flags replaced by the labels of their controls, if they have one."""
    return _NAMED.sub(_control, message.replace(REPAIR_ADVICE, "repair the mesh"))


def _control(match: re.Match[str]) -> str:
    flag = match["flag"]
    name = flag.replace("-", "_") if flag else match["name"] or match["first"]
    return f"“{CONTROLS[name]}”" if name in CONTROLS else f"{match[0]} of coneflat flatten"


def misplaced_warning(chosen: Choices) -> tuple[str, ...]:
    """Return a sentence on cones in regions painted as "no cones", or nothing; these regions restrict searches only."""
    inside = sorted({cone.vertex for cone in chosen.cones}.intersection(chosen.paint.no_cone.vertices()))
    if not inside or chosen.for_texture:
        return ()
    verb, noun = ("lies", "vertex") if len(inside) == 1 else ("lie", "vertices")
    return (
        f"{plural(len(inside), 'cone')} set by hand or locked {verb} in regions painted as “No cones”: "
        f"{noun} {list_some(inside)}. Searches avoid these regions; cones set by hand remain.",
    )


def angle_warning(chosen: Choices, result: Flattening) -> tuple[str, ...]:
    """Return a sentence on computed cone angles that are out of bounds because of typed ones, or nothing."""
    low, high = MIN_CONE_ANGLE, MAX_CONE_ANGLE
    typed = {cone.vertex for cone in chosen.cones if cone.angle is not None}
    if chosen.for_texture or not (chosen.by_hand and typed):
        return ()
    slack = 1e-9 * high  # Tolerance for rounding.
    names = result.cones if result.vertex_origin is None else result.vertex_origin[result.cones]
    angles = 2 * math.pi - result.curvatures
    outside = [
        f"vertex {vertex} {math.degrees(angle):.4g}"
        for vertex, angle in sorted(zip(names.tolist(), angles.tolist(), strict=True))
        if vertex not in typed and not low - slack <= angle <= high + slack
    ]
    if not outside:
        return ()
    return (
        f"With the typed angles, {plural(len(outside), 'cone')} cannot have an angle from {math.degrees(low):g} to "
        f"{math.degrees(high):g} degrees: {list_some(outside)}. Change them, or add a cone whose angle is computed.",
    )


def notes_on_controls(notes: Iterable[str]) -> dict[str, str]:
    """Return the notes on numbers that were requested and are not met, by their option."""
    return {name: note for note in notes for name, pattern in _UNMET_NUMBERS.items() if pattern.search(note)}


def with_warnings(result: Flattening, chosen: Choices) -> Flattening:
    """Return a result with the warnings on the choices added to its notes."""
    return replace(result, notes=(*result.notes, *misplaced_warning(chosen), *angle_warning(chosen, result)))


def command_line(mesh: str, project: str, choices: Choices) -> str:
    """Return a command that maps a mesh with these choices; drawn paths, paint and pins need the project file."""
    if choices.cuts or choices.uncut or choices.paint or choices.used_pins.pins:
        return shlex.join(["coneflat", choices.command, "--project", project])
    parts = ["coneflat", choices.command, mesh]
    for name, value in choices.keywords().items():
        flag = "--" + name.replace("_", "-")
        if name == "repair":
            parts += ["--repair"] if value else []
        elif isinstance(value, dict):
            parts += [flag, ",".join(str(v) if k is None else f"{v}:{k!r}" for v, k in value.items())]
        else:
            numbers = value if isinstance(value, (tuple, list)) else (value,)
            parts += [flag, ",".join(repr(n) if isinstance(n, float) else str(n) for n in numbers)]
    return shlex.join(parts)


def python_lines(mesh: str, choices: Choices) -> str:
    """Return Python code that maps a mesh with these choices."""
    arguments = [f"    {name}={_written(value)}," for name, value in choices.keywords().items()]
    if sum(map(len, arguments)) > 20_000:  # Characters in the panel.
        return "# The drawn paths and the paint are too large to be shown here; they are in the project file."
    start = f"import coneflat\n\nresult = coneflat.{choices.command}(\n    {mesh!r},"
    pins = [choices.used_pins.code()] if choices.used_pins.pins else []
    return "\n".join([start, *arguments, ")", *pins])


def _written(value: Any) -> str:
    if hasattr(value, "tolist"):
        return repr(value.tolist())
    if isinstance(value, tuple):
        return f"({', '.join(_written(entry) for entry in value)})"
    if isinstance(value, list) and len(value) > MAX_LISTED:
        return f"[{_ranges(value)}]"
    if isinstance(value, dict) and len(value) > MAX_LISTED:
        # Vertices with the same value are grouped.
        groups: dict[Any, list[int]] = {}
        for vertex, entry in value.items():
            groups.setdefault(entry, []).append(vertex)
        if len(groups) <= MAX_LISTED:
            parts = (
                f"**dict.fromkeys([{_ranges(sorted(group))}], {entry!r})" for entry, group in groups.items()
            )
            return f"{{{', '.join(parts)}}}"
    return repr(value)


def _ranges(vertices: list[int]) -> str:
    """Return ascending vertices as the content of a Python list, with consecutive vertices as ranges."""
    runs = Region.of_vertices(vertices).runs
    return ", ".join(str(a) if a == b else f"*range({a}, {b + 1})" for a, b in runs)


class CachedTexts:
    """The warnings on choices, the command line and the Python code, cached until the next change of the choices."""

    def __init__(self) -> None:
        self._cached: tuple[int, tuple[str, ...], dict[str, str]] = 0, (), {}

    def of(
        self, number: int, mesh: Path | None, project: str, chosen: Choices
    ) -> tuple[tuple[str, ...], dict[str, str]]:
        """Return the warnings, and the texts by their names: `command` and `python`.

        Args:
            number: number of the choices, from 1 on.
            mesh: path of the mesh; None if there is none, and the texts are empty.
            project: name of the project file.
            chosen: the choices.
        """
        if self._cached[0] != number:
            texts = {"command": "", "python": ""}
            if mesh is not None:
                texts = {
                    "command": command_line(mesh.name, project, chosen),
                    "python": python_lines(mesh.name, chosen),
                }
            self._cached = number, misplaced_warning(chosen), texts
        return self._cached[1:]
