"""What the user's actions do to what is chosen."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from ...options.kinds import as_number, as_whole
from .choices import Choices
from .paint import Region


def _step(change: Callable[..., Choices]) -> Callable[[Choices, Mapping[str, Any], Iterable[int]], Choices]:
    """Return a step that makes the cones that were found the user's before it changes them."""
    return lambda chosen, action, found: change(chosen.placed(found), action)


def _angle(action: Mapping[str, Any]) -> float | None:
    degrees = action.get("degrees")
    return None if degrees is None else math.radians(as_number("an angle", degrees))


def _vertex(action: Mapping[str, Any], name: str = "vertex") -> int:
    return as_whole("a vertex", action[name])


#: By what is to be done: the choices after it, from those before, the action, and the cones that were found.
STEPS: dict[str, Callable[[Choices, Mapping[str, Any], Iterable[int]], Choices]] = {
    "set": lambda chosen, action, found: chosen.with_option(action["name"], action["value"]),
    "hand": _step(lambda chosen, action: chosen),
    "add": _step(lambda chosen, action: chosen.added(_vertex(action), _angle(action))),
    "move": _step(lambda chosen, action: chosen.moved(_vertex(action), _vertex(action, "to"))),
    "remove": _step(lambda chosen, action: chosen.removed(_vertex(action))),
    "angle": _step(lambda chosen, action: chosen.angled(_vertex(action), _angle(action))),
    "lock": lambda chosen, action, found: chosen.locked(_vertex(action), action["locked"] is True),
    "cut": lambda chosen, action, found: chosen.cut(tuple(action["path"])),
    "keep": lambda chosen, action, found: chosen.keep_whole(tuple(action["path"])),
    "erase": lambda chosen, action, found: chosen.erased(*(as_whole("a vertex", v) for v in action["edge"])),
    "paint": lambda chosen, action, found: chosen.painted(
        action["layer"], Region.of_text(action["where"]), action.get("weight")
    ),
    "corner": lambda chosen, action, found: chosen.cornered(_vertex(action)),
    "units": lambda chosen, action, found: chosen.measured_in(action["of_file"], action["shown"]),
}
