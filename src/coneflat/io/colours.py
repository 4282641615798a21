"""Colours of vertices and images: their numbers in files, as 0 to 1 in this package, and linear or sRGB."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ..base.arrays import FloatArray
from ..mesh.polygons import COLOURS
from .attributes import ALPHA

if TYPE_CHECKING:
    from .mesh_file import MeshFile

#: Largest value of a colour in bytes.
BYTE = 255
#: End of the linear part of sRGB.
LINEAR_SRGB = 0.04045


def colour_shades(values: NDArray[Any], kind: DTypeLike = np.float64) -> FloatArray:
    """Return the parts of colours in a file as 0 to 1.

    Args:
        values: the numbers in the file.
        kind: their type there. Integers are fractions of the largest one of their type; of others, numbers above 1 mean
            that all are bytes.
    """
    numbers, kind = np.asarray(values, np.float64), np.dtype(kind)
    if kind.kind in "iu":
        return numbers / np.iinfo(kind).max
    return numbers / BYTE if np.nanmax(numbers, initial=0.0) > 1 else numbers


def stored_shades(shades: FloatArray, kind: DTypeLike) -> NDArray[Any]:
    """Return parts of colours, 0 to 1, as numbers of a type in a file: the inverse of `colour_shades`."""
    kind = np.dtype(kind)
    return in_type(shades * np.iinfo(kind).max if kind.kind in "iu" else shades, kind)


def as_bytes(shades: FloatArray) -> NDArray[np.uint8]:
    """Return numbers from 0 to 1 as bytes; NaN becomes 0."""
    return stored_shades(shades, np.uint8)


def in_type(values: NDArray[Any], kind: DTypeLike) -> NDArray[Any]:
    """Return numbers in a type; those that an integer type does not have are clipped, and NaN becomes 0."""
    kind = np.dtype(kind)
    if kind.kind in "iu" and values.dtype.kind == "f":
        limits = np.iinfo(kind)
        values = np.clip(np.rint(np.nan_to_num(values)), limits.min, limits.max)
    return values.astype(kind)


def linear_colours(mesh: MeshFile) -> FloatArray | None:
    """Return (n, 4) the linear colours and the alphas of the vertices of a file, 0 to 1; None if it has no colours.

    Colours of files are sRGB. Alpha is 1 if the file has none; a PLY file has it in the type of the file.
    """
    if not mesh.has_colours:
        return None
    shades = np.stack([mesh.properties[name] for name in COLOURS], axis=1)
    alpha = colour_shades(mesh.properties.get(ALPHA.name, np.ones(len(mesh.vertices))))
    linear = to_linear(np.clip(np.nan_to_num(shades), 0, 1))
    return np.column_stack([linear, np.clip(np.nan_to_num(alpha), 0, 1)])


def to_linear(values: NDArray[Any]) -> FloatArray:
    """Return linear values of sRGB ones, both from 0 to 1."""
    return np.where(values <= LINEAR_SRGB, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def to_srgb(values: FloatArray) -> FloatArray:
    """Return sRGB values of linear ones, both from 0 to 1."""
    return np.where(values <= LINEAR_SRGB / 12.92, values * 12.92, 1.055 * values ** (1 / 2.4) - 0.055)
