"""Notes and settings of a result of `unwrap`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from ..base import TYPED_TOLERANCE, Unmet, plural
from ..base.search_time import SearchTime
from ..result import Flattening
from .options import ENERGY_PER_AREA, ISOMETRIC, OWN_NAMES, UnwrapOptions

#: The `method` in the settings of a result of `unwrap`.
FREE = "free seams"


def with_notes(
    result: Flattening,
    options: UnwrapOptions,
    energies: Sequence[float],
    cut: int,
    ended: SearchTime | None = None,
) -> Flattening:
    """Return a result with notes on unmet requests, and with the options of `unwrap` in its settings.

    Args:
        result: the result.
        options: the options.
        energies: those of the components.
        cut: number of forbidden edges that are cut.
        ended: the time of the search if it was up before the search was complete.
    """
    unmet = (
        *_forbidden_notes(cut),
        *_energy_notes(options, energies, result.distortion.energy, ended is not None),
        *chart_notes(options.charts, result.distortion.charts, ended is not None),
    )
    notes = (*_time_notes(ended), *map(Unmet, unmet))
    settings = {**result.settings, **_own_settings(options, result.settings["seams"])}
    return replace(result, settings=settings, notes=(*result.notes, *notes))


def _own_settings(options: UnwrapOptions, seams: Any) -> dict[str, Any]:
    """Return the options that the flattening does not have, or has with other values; seams: its own setting."""
    settings = {name: getattr(options, name) for name in OWN_NAMES if name != "seams"}
    if options.has_no_bound:
        settings["seams"] = "none" if options.marked is None else ["none", seams]
    return settings


def _time_notes(ended: SearchTime | None) -> Iterator[str]:
    """Yield a note on a search that was ended because its time was up."""
    if ended is None or ended.ended_after is None:
        return
    if ended.attempts:
        yield (
            f"The search for seams was ended after {ended.ended_after:.3g} s, as its time is {ended.seconds:g} s: with "
            "more, seams may be shorter, or charts packed more tightly."
        )
    else:
        yield Unmet(
            f"The layout alone took {ended.ended_after:.3g} s, more than the {ended.seconds:g} s for the search, so "
            "that no other seams were tried."
        )


def _forbidden_notes(cut: int) -> Iterator[str]:
    if cut:
        yield f"{plural(cut, 'forbidden edge')} had to be cut to separate overlaps."


def _energy_notes(
    options: UnwrapOptions, energies: Sequence[float], energy: float, is_ended: bool
) -> Iterator[str]:
    """Yield a note on energies of components above the bound, or else on the energy that is measured."""
    above = [energy for energy in energies if energy > options.bound]
    if above:
        name, allowed, reached = "energy", options.bound, max(above)
        if options.area is not None:
            name, allowed = "area distortion", options.area
            reached = ((reached - ISOMETRIC) / ENERGY_PER_AREA) ** 0.5
        advice = "give the search more time" if is_ended else "refine the mesh"
        yield (
            f"The {name} of {plural(len(above), 'component')} is up to {reached:.6g}, above the {allowed:.6g} allowed: "
            f"{advice}, or allow more."
        )
    elif options.area is None and energy > (1 + TYPED_TOLERANCE) * options.bound:
        yield (
            f"The energy is {energy:.6g}, above the {options.bound:.6g} allowed, because of triangles that have "
            "nearly no area: remesh there."
        )


def chart_notes(requested: str | int, count: int, is_ended: bool = False) -> Iterator[str]:
    """Yield a note if the number of charts is not the one requested."""
    if not isinstance(requested, int) or count == requested:
        return
    reason = "components, seams and overlaps need them"
    if count < requested:
        reason = "the time of the search was up" if is_ended else "no further cut divides one"
    yield f"The texture has {plural(count, 'chart')} instead of {requested:,}: {reason}."
