"""Measures of a result whose points have moved, as in another texture or in a file."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from .atlas.overlap import Overlaps
from .distortion import measure_at_any_size
from .mesh import TriangleMesh
from .promises import DOUBLE, broken_promises
from .rotations import Rotations, seam_rotations

if TYPE_CHECKING:
    from .result import Flattening


def measured_anew(
    result: Flattening,
    changed: Flattening,
    unit: float = DOUBLE,
    notes: tuple[str, ...] = (),
    overlaps: Overlaps | None = None,
) -> Flattening:
    """Return a result whose points were moved, measured, with the notes that it then has.

    Args:
        result: before the change.
        changed: with the measures and notes of that.
        unit: rounding of its coordinates.
        notes: more of them.
        overlaps: of its triangles, if they are known.
    """
    told = broken_promises(result)
    old = result.distortion
    distortion = measure_at_any_size(
        TriangleMesh(changed.vertices, changed.faces),
        changed.corner_uv,
        (old.curvature_error, old.curvature_error_max),
        changed.cones,
        changed.prescribed,
        overlaps,
    )
    changed = replace(changed, distortion=distortion, rotations=_rotations(result, changed))
    kept = tuple(note for note in result.notes if note not in told)
    return replace(changed, notes=(*kept, *broken_promises(changed, unit), *notes))


def _rotations(result: Flattening, changed: Flattening) -> Rotations | None:
    """Return the rotations of seams after points were moved a little: the worst of them is measured anew."""
    before = result.rotations
    if before is None:
        return None
    old, new = (
        seam_rotations(TriangleMesh(each.vertices, each.faces), each.corner_uv, before.quantum)
        for each in (result, changed)
    )
    # Polygons may have other diagonals.
    free = old.edges[~before.binds(old.off)]
    count = len(changed.vertices)
    bound = ~np.isin(new.edges @ [count, 1], free @ [count, 1])
    return replace(before, worst=float(new.off[bound].max(initial=0.0)))
