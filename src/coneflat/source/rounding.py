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
from ..geometry.opening import ZERO_AREA

#: Steps of the coordinates that the longest side of a triangle has at most, if rounding can have removed its area,
MAX_STEPS = 4
#: and that of a median triangle, if the coordinates are too coarse for the mesh.
MAX_MEDIAN_STEPS = 100
#: Decimal places of text at most, steps from the origin up to which they are recognised, and the tolerance for it.
MAX_PLACES, MAX_DECIMALS, IS_INTEGER = 8, 1e11, 1e-3
#: Steps from the origin to the farthest coordinate at least: integers of small grids are not rounded numbers.
MIN_STEPS = 1e5


def coarse_step(vertices: FloatArray, faces: IntArray) -> tuple[float, int]:
    """Return the step of coarsely rounded coordinates and the number of triangles that it left without area.

    Coordinates are coarse if the triangles have sides of few steps, but are many steps from the origin: the 32-bit
    numbers of STL, GLB and most PLY files for a model far from the origin, or text with few digits.

    Returns:
        The step, model units; 0, 0 if rounding is not the cause.
    """
    if not faces.size or not vertices.size or not np.isfinite(vertices[np.unique(faces)]).all():
        return 0.0, 0
    coordinates = vertices[np.unique(faces)]
    has_extent = np.ptp(coordinates, axis=0) > 0
    coordinates = coordinates[:, has_extent if has_extent.any() else coordinates.any(axis=0)]
    if not coordinates.size:
        return 0.0, 0
    step = _single_step(coordinates) or _decimal_step(coordinates)
    # Scaling by a power of two avoids underflow and overflow of squared lengths.
    exponent = unit_exponent(coordinates)
    lengths = edge_lengths(np.ldexp(vertices, -exponent), faces)
    longest, unit = lengths.max(axis=1), float(np.ldexp(step, -exponent))
    is_flat = double_areas(lengths) <= ZERO_AREA * longest**2
    is_small = is_flat & (longest <= MAX_STEPS * unit)
    is_coarse = np.median(longest) <= MAX_MEDIAN_STEPS * unit and MIN_STEPS * unit <= 1
    return (step, int(np.count_nonzero(is_small))) if is_coarse and is_small.any() else (0.0, 0)


def _single_step(points: FloatArray) -> float:
    """Return the largest step of the coordinates (n, k) if they are rounded to 32-bit numbers, else 0."""
    with np.errstate(over="ignore"):
        rounded = points.astype(np.float32)
    if not np.array_equal(rounded, points):
        return 0.0
    steps = np.spacing(np.abs(rounded).max(axis=0)).astype(np.float64)
    return max(
        (step for step, axis in zip(steps.tolist(), points.T, strict=True) if _is_step(step, axis)),
        default=0.0,
    )


def _decimal_step(points: FloatArray) -> float:
    """Return the step of the coordinates (n, k) if they are rounded to decimal places, else 0."""
    largest = float(np.abs(points).max())
    for places in range(MAX_PLACES):
        step = 10.0**-places
        # Beyond it, doubles are not exact enough to tell.
        if not largest < MAX_DECIMALS * step:
            break
        numbers = points / step
        if np.abs(numbers - np.rint(numbers)).max() <= IS_INTEGER:
            return step if any(_is_step(step, axis) for axis in points.T) else 0.0
    return 0.0


def _is_step(step: float, values: FloatArray) -> bool:
    """Return whether coordinates on an axis differ by no less than a step, but by it; also if all are equal.

    The coordinates of a regular grid differ by more.
    """
    differences = np.diff(np.unique(values))
    differences = differences[differences > step / 2]
    return not len(differences) or bool(differences.min() < (1 + IS_INTEGER) * step)


def rounding_notes(vertices: ArrayLike, faces: ArrayLike) -> list[Unmet]:
    """Return a note on triangles that rounding of the input has left without area, if there are any."""
    step, count = coarse_step(np.asarray(vertices, dtype=np.float64), np.asarray(faces).astype(np.int64))
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
        step, _ = coarse_step(np.asarray(vertices, dtype=np.float64), np.asarray(faces).astype(np.int64))
        if not step:
            raise
        raise type(error)(
            f"{error}: coordinates of the input are rounded to steps of {step:.2g}; move the model to the origin "
            "before it is saved, or save it with more digits"
        ) from error
