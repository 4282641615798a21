"""Triangles without area in an input whose coordinates are rounded too coarsely for them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import FloatArray, IntArray, unit_exponent
from ..base.notes import Unmet
from ..base.text import plural
from ..errors import DegenerateFaceError, EmptyMeshError
from ..geometry import double_areas, edge_lengths
from ..geometry.triangles import ZERO_AREA

#: Steps of the coordinates that the longest side of a triangle has at most, if rounding can have removed its area,
MAX_STEPS = 4
#: and that of a median triangle, if the coordinates are too coarse for the mesh.
MAX_MEDIAN_STEPS = 100
#: Steps from the origin to the farthest coordinate at least: integers of small grids are not rounded numbers.
MIN_STEPS = 1e5


def coarse_step(vertices: FloatArray, faces: IntArray) -> tuple[float, int]:
    """Return the step of coarsely rounded coordinates and the number of triangles that it left without area.

    Coordinates are coarse if the triangles have sides of few steps, but are many steps from the origin: the 32-bit
    numbers of STL, GLB and most PLY files for a model far from the origin, or text with few digits.

    Returns:
        The largest of the smallest differences of coordinates along the axes; 0, 0 if rounding is not the cause.
    """
    if not faces.size or not np.isfinite(vertices[np.unique(faces)]).all():
        return 0.0, 0
    used = vertices[np.unique(faces)]
    # Scaling by a power of two avoids underflow and overflow of squared lengths.
    exponent = unit_exponent(used)
    points, used = np.ldexp(vertices, -exponent), np.ldexp(used, -exponent)
    lengths = edge_lengths(points, faces)
    longest = lengths.max(axis=1)
    is_flat = double_areas(lengths) <= ZERO_AREA * longest**2
    step = max(_step(axis) for axis in used.T)
    is_small = is_flat & (longest <= MAX_STEPS * step)
    is_coarse = np.median(longest) <= MAX_MEDIAN_STEPS * step and np.abs(used).max() >= MIN_STEPS * step
    if not is_coarse or not is_small.any():
        return 0.0, 0
    return float(np.ldexp(step, exponent)), int(np.count_nonzero(is_small))


def _step(values: FloatArray) -> float:
    """Return the smallest difference of (k,) coordinates on an axis, or that of 32-bit numbers if they are such."""
    differences = np.diff(np.unique(values))
    rounded = values.astype(np.float32)
    is_single = np.array_equal(rounded, values)
    single = float(np.spacing(np.abs(rounded).max())) if is_single else 0.0
    return max(single, float(differences.min()) if len(differences) else 0.0)


def rounding_notes(vertices: ArrayLike, faces: ArrayLike) -> list[Unmet]:
    """Return a note on triangles that rounding of the input has left without area, if there are any."""
    step, count = coarse_step(np.asarray(vertices, dtype=np.float64), np.asarray(faces))
    if not count:
        return []
    verb = "has" if count == 1 else "have"
    return [
        Unmet(
            f"{plural(count, 'triangle')} {verb} no area in the input because its coordinates are rounded to steps of "
            f"{step:.2g}: move the model to the origin before it is saved, or save it with more digits."
        )
    ]


@contextmanager
def named_rounding(vertices: ArrayLike, faces: ArrayLike) -> Iterator[None]:
    """Add to errors on triangles without area that rounding of the input is the cause, if it is.

    Raises:
        DegenerateFaceError, EmptyMeshError: those of the block.
    """
    try:
        yield
    except (DegenerateFaceError, EmptyMeshError) as error:
        step, _ = coarse_step(np.asarray(vertices, dtype=np.float64), np.asarray(faces))
        if not step:
            raise
        raise type(error)(
            f"{error}: coordinates of the input are rounded to steps of {step:.2g}; move the model to the origin "
            "before it is saved, or save it with more digits"
        ) from error
