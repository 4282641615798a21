"""Lengths for triangles without area."""

from __future__ import annotations

import numpy as np

from .._arrays import FloatArray, IntArray
from ..errors import DegenerateFaceError
from ..text import list_some, plural
from .triangles import double_areas, slacks

# Twice the area over the longest side squared. Lengths, rounded, know no smaller areas; the flattest triangles of
# real scans have 1e-3.
ZERO_AREA = 1e-7
# What the triangle inequality is given to spare, in mean side lengths: enough for angles good to 1e-11.
SLACK = 1e-5


def mollify(
    lengths: FloatArray, *, strict: bool = False, names: IntArray | None = None
) -> tuple[FloatArray, str | None]:
    """Return lengths with which every triangle has area, and a note if they had to change.

    Where some triangle has none, every side of the mesh grows by the same small length, which opens
    collapsed triangles and keeps all others (N. Sharp and K. Crane 2020, Section 4.5).

    Args:
        lengths: (m, 3) side lengths.
        strict: refuse such triangles instead.
        names: (m,) what the user calls each face.

    Raises:
        DegenerateFaceError: with `strict`, or when the mesh as a whole has no area.
    """
    areas, squares = double_areas(lengths), lengths.max(axis=1) ** 2
    bad = np.flatnonzero(areas <= ZERO_AREA * squares)
    if not len(bad):
        return lengths, None
    if areas.sum() <= ZERO_AREA * squares.sum():
        raise DegenerateFaceError(
            f"the mesh has no area: {plural(len(lengths), 'triangle')} on a line or point"
        )
    where = list_some(bad if names is None else names[bad])
    if strict:
        raise DegenerateFaceError(
            f"{plural(len(bad), 'triangle')} without area: {where}; "
            "leave out --strict (strict=False) to open them by a tiny perturbation"
        )
    mean = float(lengths.mean())
    growth = SLACK * mean - min(float(slacks(lengths[bad]).min()), 0.0)
    note = (
        f"Opened {plural(len(bad), 'triangle')} without area ({where}) by lengthening every edge "
        f"by {growth / mean:.1e} of the mean edge."
    )
    return lengths + growth, note
