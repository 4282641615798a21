"""What the user of the studio has chosen, as keyword arguments of `coneflat.flatten`."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from .choices import Choices

CORNERS = 4  # of a rectangle


def meaning(chosen: Choices) -> dict[str, Any]:
    """Return keyword arguments of `coneflat.flatten`; whether they go together is not looked at."""
    words = dict(chosen.options)
    if chosen.by_hand:
        words.pop("distortion", None)
        words.pop("cone_count", None)
        words |= _cones_by_hand(chosen)
    elif chosen.cones:
        words["required_cones"] = [cone.vertex for cone in chosen.cones]
    if words.get("boundary") == "rectangle":
        words |= _rectangle(words.pop("boundary"), chosen)
    if chosen.cuts:
        cut = _pairs(chosen.cuts)
        words["seams"] = ("input", cut) if "seams" in words else cut
    if chosen.kept:
        words["forbidden_seams"] = _pairs(chosen.kept)
    return words | _painted(chosen)


def _cones_by_hand(chosen: Choices) -> dict[str, Any]:
    vertices = [cone.vertex for cone in chosen.cones]
    if not vertices:
        return {"cones": "none"}
    if any(cone.angle is not None for cone in chosen.cones):
        return {"cones": {cone.vertex: cone.curvature for cone in chosen.cones}}
    # A search that has nothing to choose finds the angles of the least area distortion.
    return {"required_cones": vertices, "allowed_cones": vertices}


def _rectangle(boundary: str, chosen: Choices) -> dict[str, Any]:
    """Return the corners of a rectangle; while some are still to be picked, nothing, so that the boundary is free."""
    return {"boundary": dict.fromkeys(chosen.corners)} if len(chosen.corners) == CORNERS else {}


def _painted(chosen: Choices) -> dict[str, Any]:
    """Return what is painted, as far as it means something: cones placed by hand or locked lie where they are."""
    paint = chosen.paint
    words: dict[str, Any] = {}
    if paint.no_seam:
        words["seamless"] = paint.no_seam.vertices()
    if paint.no_cone and not chosen.by_hand:
        locked = {cone.vertex for cone in chosen.cones}
        words["forbidden_cones"] = [v for v in paint.no_cone.vertices() if v not in locked]
    # Where all angles are given there is nothing to weigh.
    if paint.importance and (not chosen.by_hand or any(cone.angle is None for cone in chosen.cones)):
        words["weights"] = paint.weights()
    return words


def _pairs(paths: Iterable[tuple[int, ...]]) -> Any:
    edges = {tuple(sorted(edge)) for path in paths for edge in edges_of(path)}
    return np.array(sorted(edges), dtype=np.int64)


def edges_of(path: tuple[int, ...]) -> set[frozenset[int]]:
    """Return the edges that a path runs along."""
    return {frozenset(edge) for edge in pairwise(path)}
