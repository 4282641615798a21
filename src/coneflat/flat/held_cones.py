"""Cones that triangles have no room for, and other ones instead."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from .._arrays import IntArray
from ..input.components import Component
from ..text import plural
from .base import LaidOut

# Searches for cones at most, if some of them are too wide for the triangles around.
SEARCHES = 4
# Radians by which a cone is off then: a full turn, less what rounding and untangled neighbours make.
UNHELD = 1.0


def with_held_cones(flatten: Callable[[Component], LaidOut], part: Component) -> LaidOut:
    """Return a component's layout, by other cones if triangles around some of the first have no room for their angles.

    Each further search forbids the cones that those before could not hold. It may find more of them before it finds
    none, so the layout with the fewest is taken.

    Args:
        flatten: searches for cones and lays out.
        part: the component.
    """
    best = laid_out = flatten(part)
    for _ in range(SEARCHES - 1):
        if not len(unheld_cones(best)):
            break
        part = replace(part, constraints=part.constraints.without(unheld_cones(laid_out)))
        laid_out = flatten(part)
        if len(unheld_cones(laid_out)) < len(unheld_cones(best)):
            best = laid_out
    return best


def unheld_cones(laid_out: LaidOut) -> IntArray:
    """Return the cones that the triangles around them cannot make room for, each having an angle below pi."""
    error = laid_out.target - laid_out.curvature
    return laid_out.cones[np.abs(error[laid_out.cones]) > UNHELD]


def unheld_notes(laid_out: LaidOut, names: IntArray) -> tuple[str, ...]:
    """Return how many cones the triangles have no room for, if any."""
    notes = []
    unheld = unheld_cones(laid_out)
    if len(unheld):
        angle = 2 - laid_out.target[unheld[0]] / np.pi
        notes.append(
            f"{plural(len(unheld), 'cone')} too wide for the triangles around: that at vertex {names[unheld[0]]} has "
            f"an angle of {angle:.3g} pi. Choose others, or refine (--refine)."
        )
    return tuple(notes)
