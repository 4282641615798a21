"""Components that are copies of others, as bolts, bricks and leaves are: their layout is found once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .._arrays import BoolArray, FloatArray
from ..input.components import Component
from ..input.symmetry import AXES, SymmetryUse, find_symmetry
from ..options import Options
from .base import LaidOut

# How far the vertices of a copy, moved, turned and scaled, may be from those of the first, as a share of the largest
# coordinates: what rounding makes of these. And by what share sides may differ: a tenth of what metrics are good to.
ROUNDING, OF_SIDES = 2.0**-48, 1e-10
# Digits of what copies are looked for by, before they are compared.
DIGITS = 6


@dataclass(frozen=True)
class Copy:
    """What a component is a copy of.

    Attributes:
        first: the number of the first of its kind.
        scale: how much larger it is.
    """

    first: int
    scale: float


def find_copies(parts: Sequence[Component], options: Options) -> list[Copy | None]:
    """Return for each component what it is a copy of, None for the first of a kind.

    Copies have triangles of the same numbering, which a rigid motion and a scale take onto each other, and the same is
    said of their vertices and edges.
    """
    found: list[Copy | None] = [None] * len(parts)
    if len(parts) < 2 or options.symmetric in AXES or options.hide_seams or options.lengths is not None:
        return found
    kinds: dict[tuple[object, ...], list[int]] = {}
    for i, part in enumerate(parts):
        if _names_vertices(part):
            continue
        alike = kinds.setdefault(_kind(part), [])
        for first in alike:
            scale = _scale_of_copy(parts[first], part)
            if scale is not None:
                found[i] = Copy(first, scale)
                break
        else:
            alike.append(i)
    return found


def copied(first: LaidOut, part: Component, scale: float, options: Options) -> LaidOut | None:
    """Return the layout of a copy by that of the first of its kind; None if that does not serve.

    It does not where triangles were cut, or where a note names vertices.
    """
    if first.notes or first.cuts is not None or len(first.mesh.vertices) != len(part.mesh.vertices):
        return None
    use = first.symmetry
    if use is not None:
        symmetry = find_symmetry(part, options)
        if symmetry is None:
            return None
        use = SymmetryUse(symmetry, use.cones, use.seams)
    return replace(first, mesh=part.mesh, points=scale * first.points, symmetry=use)


def _names_vertices(part: Component) -> bool:
    """Whether something is said of single vertices."""
    said = part.constraints
    weights = said.weights, said.seam_weights, part.visibility
    return bool(
        len(said.cones) or len(said.corners) or len(said.required) or any(one is not None for one in weights)
    )


def _kind(part: Component) -> tuple[object, ...]:
    """Return what is equal for copies, and for few others."""
    said, lengths = part.constraints, part.lengths
    size = np.sqrt((lengths * lengths).sum())
    shape = [float(f"{value / size:.{DIGITS}g}") for value in (lengths[0, 0], lengths.sum(), lengths.max())]
    marks: BoolArray | None = said.on_marks
    return (
        part.mesh.faces.tobytes(),
        part.is_avoided.tobytes(),
        part.is_forbidden.tobytes(),
        said.is_allowed.tobytes(),
        None if marks is None else marks.tobytes(),
        *shape,
    )


def _scale_of_copy(first: Component, part: Component) -> float | None:
    """Return how much larger a component is than one that it is a copy of; None if it is no copy.

    W. Kabsch, "A solution for the best rotation to relate two sets of vectors", 1976.
    """
    one, two = (p.mesh.vertices - p.mesh.vertices.mean(axis=0) for p in (first, part))
    sizes = np.sqrt((one * one).sum()), np.sqrt((two * two).sum())
    if not (sizes[0] > 0 and sizes[1] > 0):
        return None
    scale = float(sizes[1] / sizes[0])
    left, _, right = np.linalg.svd(one.T @ two)
    handed = np.array([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    off: FloatArray = np.abs((one @ ((left * handed) @ right)) * scale - two).max(axis=1)
    reach = float(np.abs(part.mesh.vertices).max() + scale * np.abs(first.mesh.vertices).max())
    sides = np.abs(scale * first.lengths - part.lengths)
    is_copy = off.max() <= ROUNDING * reach and (sides <= OF_SIDES * part.lengths).all()
    return scale if is_copy else None
