"""Steps of the user of the studio: their effect on the choices, and the undo history."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

from ... import ConeflatError
from ...base import short_repr
from ...errors import StudioError
from ...options import as_number
from .choices import Choices
from .paint import Region
from .paths import as_vertex
from .pins import Pin, Pins


def _step(change: Callable[..., Choices]) -> Callable[[Choices, Mapping[str, Any], Iterable[int]], Choices]:
    """Return a step that first turns the cones that a search has found into placed cones."""
    return lambda chosen, action, cones: change(chosen.placed(cones), action)


def _angle(action: Mapping[str, Any]) -> float | None:
    degrees = action.get("degrees")
    return None if degrees is None else math.radians(as_number("an angle", degrees))


def _vertex(action: Mapping[str, Any], name: str = "vertex") -> int:
    return as_vertex("a vertex", action[name])


#: For each kind of step, a function (choices before, action, cones found by the search) -> choices after.
STEPS: dict[str, Callable[[Choices, Mapping[str, Any], Iterable[int]], Choices]] = {
    "set": lambda chosen, action, cones: chosen.with_option(action["name"], action["value"]),
    "hand": _step(lambda chosen, action: chosen),
    "add": _step(lambda chosen, action: chosen.added(_vertex(action), _angle(action))),
    "move": _step(lambda chosen, action: chosen.moved(_vertex(action), _vertex(action, "to"))),
    "remove": _step(lambda chosen, action: chosen.removed(_vertex(action))),
    "angle": _step(lambda chosen, action: chosen.with_angle(_vertex(action), _angle(action))),
    "lock": lambda chosen, action, cones: chosen.locked(_vertex(action), action["locked"] is True),
    "cut": lambda chosen, action, cones: chosen.cut(tuple(action["path"])),
    "keep": lambda chosen, action, cones: chosen.with_uncut(tuple(action["path"])),
    "erase": lambda chosen, action, cones: chosen.erased(*(as_vertex("a vertex", v) for v in action["edge"])),
    "paint": lambda chosen, action, cones: chosen.painted(
        action["layer"], Region.of_text(action["where"]), action.get("weight")
    ),
    "corner": lambda chosen, action, cones: chosen.with_corner(_vertex(action)),
    "texture": lambda chosen, action, cones: chosen.with_texture(action["value"] is True),
    "pin": lambda chosen, action, cones: replace(
        chosen, pins=chosen.pins.with_pin(Pin.from_plain(action["place"]))
    ),
    "unpin": lambda chosen, action, cones: replace(
        chosen, pins=chosen.pins.without(as_vertex("a triangle", action["face"]))
    ),
    "unpin all": lambda chosen, action, cones: replace(chosen, pins=Pins()),
    "pack": lambda chosen, action, cones: replace(
        chosen, pins=replace(chosen.pins, is_packed=action["value"] is True)
    ),
    "units": lambda chosen, action, cones: chosen.with_units(action["of_file"], action["shown"]),
}


#: Steps on the cones of a search, which must have found them.
STEPS_ON_CONES = ("hand", "add", "move", "remove", "angle")


def step_taken(chosen: Choices, action: Mapping[str, Any], cones: Iterable[int]) -> Choices:
    """Return the choices after a step.

    Args:
        chosen: the choices before.
        action: its key `do` is "set" for an option (`name`, `value`); "hand" to place the cones by hand; "add", "move",
            "remove", "angle" or "lock" for a cone (`vertex`; `to`, `degrees`, `locked`); "cut" or "keep" for a `path`;
            "erase" for an `edge`; "paint" for a `layer` (`where`; `weight`); "corner" to add or remove a corner
            (`vertex`); "pin" for the `place` of a chart, as of `Pin.from_plain`; "unpin" for that of a triangle
            (`face`), or "unpin all"; "pack" to pack the other charts around pinned ones or not (`value`); "units" for
            units of length (`of_file`, `shown`); "texture" for a map for a texture or for a conformal one (`value`).
        cones: the vertices of the cones that a search has found.

    Raises:
        StudioError: the action is not valid, or is not possible.
        OptionError: an option is not valid.
    """
    try:
        return STEPS[str(action.get("do"))](chosen, action, cones)
    except (KeyError, TypeError, ValueError) as error:
        if isinstance(error, ConeflatError):
            raise
        raise StudioError(f"the action {short_repr(dict(action))} is not valid") from error


def choices_given(plain: Mapping[str, Any]) -> Choices:
    """Return the choices in values from JSON, as of `Choices.as_plain`; what is missing has its default.

    Raises:
        StudioError: they are not choices, or one is not valid.
        OptionError: an option is not valid, or cannot be combined with others.
    """
    try:
        return Choices.from_plain({**Choices().as_plain(), **plain})
    except ConeflatError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise StudioError(f"expected choices, got {short_repr(dict(plain))}") from error


class History:
    """The undo history of the choices.

    Attributes:
        now: the current choices.
    """

    def __init__(self, now: Choices) -> None:
        self.now = now
        self._past: list[Choices] = []
        self._undone: list[Choices] = []
        self._stroke: object = None

    def change(self, to: Choices, stroke: object = None) -> bool:
        """Take a step, and return whether it changes anything; steps of one stroke (drag) are undone together."""
        if to == self.now:
            return False
        if stroke is None or stroke != self._stroke:
            self._past.append(self.now)
        self._stroke = stroke
        self.now = to
        self._undone.clear()
        return True

    def undo(self) -> bool:
        """Undo a step, and return whether there was one."""
        return self._go(self._past, self._undone)

    def redo(self) -> bool:
        """Redo the step that was undone last, and return whether there was one."""
        return self._go(self._undone, self._past)

    def _go(self, source: list[Choices], target: list[Choices]) -> bool:
        self._stroke = None
        if not source:
            return False
        target.append(self.now)
        self.now = source.pop()
        return True

    @property
    def depth(self) -> tuple[int, int]:
        """Return the numbers of steps that can be undone and redone."""
        return len(self._past), len(self._undone)
