"""Lengths for triangles without area."""

from __future__ import annotations

import numpy as np

from .._arrays import FloatArray
from ..errors import DegenerateFaceError
from ..text import list_some, plural
from .triangles import double_areas, slacks

# Twice the area over the longest side squared. Lengths, rounded, know no smaller areas; the flattest triangles of
# real scans have 1e-3.
ZERO_AREA = 1e-7
# What the triangle inequality is given to spare, in mean side lengths: enough for angles good to 1e-11.
SLACK = 1e-5


def mollify(lengths: FloatArray, *, strict: bool = False) -> tuple[FloatArray, str | None]:
    """Return lengths with which every triangle has area, and a note if they had to change.

    Where some triangle has none, every side of the mesh grows by the same small length, which opens
    collapsed triangles and keeps all others (N. Sharp and K. Crane 2020, Section 4.5).

    Args:
        lengths: (m, 3) side lengths.
        strict: refuse such triangles instead.

    Raises:
        DegenerateFaceError: with `strict`, or when no triangle has area.
    """
    bad = np.flatnonzero(double_areas(lengths) <= ZERO_AREA * lengths.max(axis=1) ** 2)
    if not len(bad):
        return lengths, None
    if len(bad) == len(lengths):
        raise DegenerateFaceError(f"none of the {len(lengths)} triangles has area")
    if strict:
        raise DegenerateFaceError(
            f"{plural(len(bad), 'triangle')} without area: {list_some(bad)}; "
            "leave out --strict (strict=False) to open them by a tiny perturbation"
        )
    mean = float(lengths.mean())
    growth = SLACK * mean - min(float(slacks(lengths[bad]).min()), 0.0)
    note = (
        f"Opened {plural(len(bad), 'triangle')} without area ({list_some(bad)}) by lengthening every edge "
        f"by {growth / mean:.1e} of the mean edge."
    )
    return lengths + growth, note
