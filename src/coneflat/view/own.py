"""Numbers of the user's own at vertices or triangles, to be shown as colours."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING
from zipfile import BadZipFile

import numpy as np

from .._arrays import FloatArray, IntArray
from ..errors import MeshFileError, OptionError
from ..geometry import edge_lengths
from ..geometry.triangles import double_areas
from ..quality.distortion import quantile
from ..text import shown
from .quantity import ColorScale, Quantity

if TYPE_CHECKING:
    from ..result.flattening import Flattening

#: Parts of all numbers that lie beyond an end of their scale, which single ones must not stretch.
BEYOND = 0.01
#: Of numbers that are all the same, half the length of the scale, relative to them.
LEAST_RANGE = 0.5
FILES = (".npy", ".npz")


def own_quantity(result: Flattening, name: str, archive: Path | None = None) -> Quantity:
    """Return numbers of the user's own, with a scale: from dark to light, or to both sides of 0 where there are both.

    Args:
        result: on which they are shown.
        name: of a property of the vertices in the mesh's file (PLY); of an array in the result's archive; a file .npy;
            or a file and an array in it, FILE.npz:NAME. There is one for each vertex, or for each triangle, of the
            result or of the input.
        archive: the .npz file that the result was read from, if any.

    Raises:
        OptionError: there is no such property, or its numbers do not fit the mesh.
        MeshFileError: the file cannot be read.
    """
    if not isinstance(name, str):
        raise OptionError(f"color must be the name of a property, or of a file, not {shown(name)}")
    label, values = _named(result, name, archive)
    if values.dtype.kind not in "fiub" or values.ndim != 1:
        raise OptionError(
            f"{label}: colours are made of one number for each vertex or triangle, not of an array of shape "
            f"{values.shape} and type {values.dtype}"
        )
    values, corners = _fitted(result, label, values.astype(np.float64))
    values = np.where(np.isfinite(values), values, np.nan)
    if corners is None:
        weights = double_areas(edge_lengths(result.vertices, result.faces)) / 2
    else:
        weights = np.bincount(corners.ravel(), minlength=len(values)).astype(np.float64)
    known = np.isfinite(values) & (weights > 0)
    if not known.any():
        raise OptionError(f"{label} has no finite number on this mesh to be shown")
    return Quantity(label, values, weights, _scale(values[known], weights[known]), ".4g", corners)


def _named(result: Flattening, name: str, archive: Path | None) -> tuple[str, FloatArray]:
    """Return what numbers are called, and the numbers."""
    properties = {} if result.source is None else result.source.properties
    if name in properties:
        return name, np.asarray(properties[name])
    path, _, array = name.rpartition(":") if ".npz:" in name.lower() else (name, "", "")
    if Path(path).suffix.lower() in FILES:
        return array or Path(path).stem, _read(Path(path), array)
    if archive is not None:
        return name, _read(archive, name)
    has = "it has " + ", ".join(properties) if properties else "it has none"
    raise OptionError(f"the mesh has no property {shown(name)} at its vertices to take colours from; {has}")


def _read(path: Path, array: str) -> FloatArray:
    try:
        found = np.load(path, allow_pickle=False)
        if isinstance(found, np.ndarray):
            return found
        with found:
            if array in found.files:
                return np.asarray(found[array])
            has = ", ".join(found.files) or "none"
    except (OSError, ValueError, TypeError, EOFError, BadZipFile) as error:
        raise MeshFileError(f"cannot read numbers from {path}: {' '.join(str(error).split())}") from error
    raise OptionError(f"{path} has no array {shown(array)}: it has {has}")


def _fitted(result: Flattening, label: str, values: FloatArray) -> tuple[FloatArray, IntArray | None]:
    """Return numbers of the result's vertices and the corners' indices into them; or of its triangles and None."""
    count, origin = len(values), result.vertex_origin
    inputs = -1 if result.source is None else len(result.source.vertices)
    if origin is not None and count == inputs:
        # Vertices that are new have none.
        return np.where(origin >= 0, values[np.maximum(origin, 0)], np.nan), result.faces
    if count == len(result.vertices):
        return values, result.faces
    if count == len(result.faces):
        return values, None
    raise OptionError(
        f"{label} has {count:,} numbers, which fits neither the {len(result.vertices):,} vertices nor the "
        f"{len(result.faces):,} triangles of the mesh"
    )


def _scale(values: FloatArray, weights: FloatArray) -> ColorScale:
    low, high = quantile(values, weights, BEYOND), quantile(values, weights, 1 - BEYOND)
    is_signed = low < 0 < high
    if is_signed:
        high = max(-low, high)
        low = -high
    elif low == high:
        reach = LEAST_RANGE * (abs(low) or 1.0)
        low, high = low - reach, high + reach
    # By halves, so that the largest numbers do not overflow.
    ticks = tuple((x, f"{x:.3g}") for x in (low, low / 2 + high / 2, high))
    return ColorScale(low, high, "PuOr_r" if is_signed else "viridis_r", "linear", ticks)
