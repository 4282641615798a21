"""A few more cones, where triangles are distorted more than is wanted."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from ..errors import CurvatureError
from ..input.components import Component
from ..options import Options
from .base import LaidOut
from .relaxed import mean_ratio

# Part of the cones that there may be more of; one may be at least.
MORE = 0.2


def with_quality(flatten: Callable[[Options], LaidOut], part: Component, options: Options) -> LaidOut:
    """Return a component's layout by the first number of cones whose mean quasi-conformal distortion is as wanted.

    Before there are more of them, all triangles are relaxed. If nothing reaches it, the least distorted layout is
    returned, with a note. More cones leave less area distortion, and so
    bend triangles less; that near cones themselves is a tenth of the whole, as a rule.

    Args:
        flatten: searches for cones and lays out, by options.
        part: the component.
        options: with a quality wanted, or without.
    """
    best = flatten(options)
    if options.quality is None:
        return best
    least, count = mean_ratio(best, part), len(best.cones)
    whole = replace(options, polish="whole" if options.polish == "auto" else options.polish)
    tries = [whole] if whole != options else []
    more = max(1, math.floor(MORE * count))
    tries += [replace(whole, cone_count=cones) for cones in range(count + 1, count + more + 1)]
    for choice in tries:
        if least <= options.quality:
            return best
        try:
            tried = flatten(choice)
        except CurvatureError:  # so many cannot carry the curvature within the bounds
            continue
        if mean_ratio(tried, part) < least:
            best, least = tried, mean_ratio(tried, part)
    if least <= options.quality:
        return best
    note = (
        f"The mean QC distortion is {least:.4f} with {len(best.cones)} cones, not {options.quality:g} as wanted; less "
        "area distortion allowed (--distortion) brings more cones, a finer mesh less distortion with as many."
    )
    return replace(best, notes=(*best.notes, note))
