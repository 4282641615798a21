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
# Triangles that cutting may add before other cones are tried.
FEW_CUT = 16


def with_held_cones(flatten: Callable[[Component], LaidOut], part: Component) -> LaidOut:
    """Return a component's layout, by other cones if triangles around some of the first have no room for their angles.

    Each further search forbids the cones that those before could not hold. It may find more of them before it finds
    none, so the layout with the fewest is taken. Where triangles may be cut they hold any cone, so one more search is
    made only if that may spare cutting a few.

    Args:
        flatten: searches for cones and lays out.
        part: the component.
    """
    best = laid_out = flatten(part)
    for _ in range(SEARCHES - 1):
        unheld = unheld_cones(laid_out)
        if not len(unheld):
            break
        part = replace(part, constraints=part.constraints.without(unheld))
        laid_out = flatten(part)
        if _lack(laid_out) < _lack(best):
            best = laid_out
        if best.statistics.split_triangles and not best.notes:
            break
    return best


def _lack(laid_out: LaidOut) -> tuple[int, int, int]:
    """Return how often the metric fell short, how many triangles were cut, and how many cones have no room."""
    return len(laid_out.notes), laid_out.statistics.split_triangles, len(unheld_cones(laid_out))


def unheld_cones(laid_out: LaidOut) -> IntArray:
    """Return the cones that the triangles around them cannot make room for, each having an angle below pi.

    Of a layout in which triangles were cut, those that are corners of these, if other cones may do without: where few
    were cut, or the metric fell short besides.
    """
    if laid_out.statistics.split_triangles:
        if laid_out.statistics.split_triangles > FEW_CUT and not laid_out.notes:
            return np.empty(0, dtype=np.int64)
        cut = np.bincount(laid_out.face_origin)[laid_out.face_origin] > 1
        return np.intersect1d(laid_out.mesh.faces[cut], laid_out.cones)
    error = laid_out.target - laid_out.curvature
    return laid_out.cones[np.abs(error[laid_out.cones]) > UNHELD]


def split_notes(laid_out: LaidOut, names: IntArray) -> tuple[str, ...]:
    """Return how many triangles were cut so that none is upside down, and where, if any."""
    added = laid_out.statistics.split_triangles
    if not added:
        return ()
    cut = np.flatnonzero(np.bincount(laid_out.face_origin) > 1)
    corners = laid_out.mesh.faces[np.isin(laid_out.face_origin, cut)]
    where = np.intersect1d(corners, laid_out.cones)
    if len(where):
        around = (
            f"cones among them, as vertex {names[where[0]]}, have too wide an angle for the triangles around"
        )
    else:
        around = f"around vertex {names[corners.min()]}, say"
    return (
        f"{plural(len(cut), 'triangle')} would be upside down on straight sides, or beside one that is: {around}. "
        f"They were cut at their edges, into {plural(added, 'triangle')} more; without (--no-split), they stay as they "
        "are.",
    )


def unheld_notes(laid_out: LaidOut, names: IntArray) -> tuple[str, ...]:
    """Return how many cones the triangles have no room for, if any."""
    notes = []
    unheld = unheld_cones(laid_out)
    if len(unheld) and not laid_out.statistics.split_triangles:
        angle = 2 - laid_out.target[unheld[0]] / np.pi
        notes.append(
            f"{plural(len(unheld), 'cone')} too wide for the triangles around: that at vertex {names[unheld[0]]} has "
            f"an angle of {angle:.3g} pi. Choose others, or refine (--refine)."
        )
    return tuple(notes)
