"""The steps in which a pattern is put together, and what its lines and names mean."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ....base import plural
from ..papers import OVERLAP
from ..result import Pattern


def steps_of(pattern: Pattern) -> list[str]:
    """Return the steps that a pattern needs, each a few sentences."""
    folds = _sewing(pattern) if pattern.is_sewn else _folding_and_joining(pattern)
    return [*_printing(pattern), _cutting(pattern), *folds]


def _printing(pattern: Pattern) -> Iterator[str]:
    tiles = pattern.tiles
    place = "at the bottom of this page" if pattern.paper.height is not None else "below the pieces"
    yield (
        f"Print at 100 % (actual size), without fitting to the page. Measure the ruler {place}: it is 100 mm long."
    )
    if len(tiles) > 1 and tiles[0].overlaps:
        yield (
            f"Join the pages as in the map. Neighbours overlap by {OVERLAP:g} mm: cut one of them along its corner "
            "marks, and tape it onto the other so that the crosses and all lines coincide."
        )
    elif len(tiles) > 1:
        yield "Keep the pages apart: no piece crosses the border of a page."


def _cutting(pattern: Pattern) -> str:
    noun = "the piece" if pattern.piece_count == 1 else f"the {pattern.piece_count} pieces"
    text = f"Cut out {noun} along the solid black lines"
    if not pattern.is_sewn:
        return f"{text}."
    allowance = allowance_text(pattern)
    text += f"; the {allowance} included." if allowance else "; add no seam allowance."
    if pattern.has_grain:
        text += " Lay them on the cloth with the arrow along its grain."
    text += _doubled_cloth(pattern)
    marks = "numbers, notches and the tips of darts" if pattern.darts else "numbers and notches"
    return f"{text} Transfer {marks}."


def allowance_text(pattern: Pattern) -> str:
    """Return how wide the seam allowances are, with a verb; "" if there are none."""
    widths = pattern.allowances
    if not any(widths):
        return ""
    if len(widths) == 1:
        return f"seam allowance of {widths[0]:g} mm is"
    return f"seam allowances of {widths[0]:g} to {widths[-1]:g} mm are"


def _doubled_cloth(pattern: Pattern) -> str:
    """Return that mirrored pieces are cut in pairs, if there are any."""
    pairs = [f"{piece + 1} and {image + 1}" for piece, image in pattern.counterparts.pairs]
    if not pairs:
        return ""
    return f" Mirror images may be cut together from doubled cloth, with the paper of one of them: {'; '.join(pairs)}."


def _folding_and_joining(pattern: Pattern) -> Iterator[str]:
    """Yield the steps of nets and sheets."""
    if len(pattern.folds) or pattern.bends or pattern.tabs:
        radius = (
            " R is the radius of a bend, mm; its line is the middle of what is bent."
            if any(bend.radius for bend in pattern.bends)
            else ""
        )
        verb = "Bend" if pattern.kind == "sheet" else "Fold"
        angle = " by the angle that is written there" if len(pattern.folds) or pattern.bends else ""
        yield (
            f"{verb} along the blue lines{angle}: away from you where they are dash-dotted, towards you where they are "
            f"dashed.{radius}"
        )
    if pattern.seams:
        verb = "Glue each tab behind the side" if pattern.tabs else "Join the sides"
        yield f"{verb} with the same name{_names(pattern)}.{_corner_cuts(pattern)}"


def _corner_cuts(pattern: Pattern) -> str:
    cuts = pattern.corner_cuts
    if not cuts or pattern.kind != "sheet":
        return ""
    return f" {_listed([seam.name for seam in cuts])} {'is a corner cut' if len(cuts) == 1 else 'are corner cuts'}."


def _sewing(pattern: Pattern) -> Iterator[str]:
    """Yield the steps of cloth and gores."""
    count = len(pattern.darts)
    if count:
        yield (
            f"Sew the {plural(count, 'dart')}: fold the piece so that both sides lie on each other, and sew from the "
            "border to the tip, which is marked by a circle."
        )
    if len(pattern.seams) > count:
        order = (
            " Sew piece 1 to 2, 2 to 3, and so on, and the last one to piece 1."
            if pattern.surface.sequence is not None and pattern.piece_count > 2
            else " Begin with A: seams are named along the borders of pieces, from the largest piece."
        )
        yield (
            f"Sew the sides with the same name together along the grey dashed lines{_names(pattern)}. Notches match; a "
            f"double one is at the same place on both sides.{order}"
        )
    eased = sum(seam.is_eased for seam in pattern.seams)
    if eased:
        yield f"At {plural(eased, 'seam')} one side is longer: ease it in evenly."
    if pattern.borders.hems and len(pattern.seams):
        yield "Sides without a name are the border of the object: hem or bind them."


def _names(pattern: Pattern) -> str:
    return (
        ""
        if pattern.piece_count == 1
        else "; A (2) at a side: this is seam A, and piece 2 is on the other side"
    )


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
